"""Which code runs the stages of the filter: numpy, or the same compiled by numba."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense import audibility, histogram, modes, philox, resemblance, resetting, stages
from homsense.audibility import Audible
from homsense.free_space import Walls
from homsense.grid import Grid, Raster
from homsense.histogram import Histogram
from homsense.modes import Moments
from homsense.particles import Particles
from homsense.resemblance import Nearby
from homsense.resetting import CellMasses, CodedCells
from homsense.stages import Move, Reweighed
from homsense.weights import WeightSums

FloatArray = NDArray[np.float64]
Integers = NDArray[np.int32]
IntArray = NDArray[np.int64]
Codes = NDArray[np.uint16]
Weights = NDArray[np.uint32]


class Backend(NamedTuple):
    """The stages; every backend gives the same bits.

    Parameters
    ----------
    name : str
        ``"numpy"`` or ``"numba"``.
    random_words, propagate, reweigh, weigh, systematic : callable
        As in `homsense.philox` and `homsense.stages`.
    cell_masses, draw : callable
        As in `homsense.resetting`.
    histogram, hills, label, moments : callable
        As in `homsense.histogram` and `homsense.modes`.
    told, heard : callable
        As in `homsense.resemblance` and `homsense.audibility`.
    """

    name: str
    random_words: Callable[[int, int, int, int], Weights]
    propagate: Callable[[Particles, Move, Walls, int, int], Particles]
    reweigh: Callable[[Particles, Raster, Codes, Integers], Reweighed]
    weigh: Callable[[Particles], tuple[Weights, WeightSums]]
    systematic: Callable[[Particles, Weights, int, int, int, Particles], Particles]
    cell_masses: Callable[[CodedCells, Integers], CellMasses]
    draw: Callable[[CodedCells, CellMasses, int, int, int], Particles]
    histogram: Callable[[Particles, Weights, float], Histogram]
    hills: Callable[[IntArray, IntArray], IntArray]
    label: Callable[[Histogram, Weights, IntArray], tuple[IntArray, int]]
    moments: Callable[[Particles, Weights, IntArray, int, FloatArray], Moments]
    told: Callable[[Nearby, IntArray, Integers, int], FloatArray]
    heard: Callable[[Audible, IntArray, FloatArray, FloatArray, int], FloatArray]


NUMPY = Backend(
    "numpy",
    philox.random_words,
    stages.propagate,
    stages.reweigh,
    stages.weigh,
    stages.systematic,
    resetting.cell_masses,
    resetting.draw,
    histogram.histogram,
    modes.hills,
    modes.label,
    modes.moments,
    resemblance.told,
    audibility.heard,
)


@cache
def compiled() -> Backend | None:
    """Return the backend that numba compiles when it is first used.

    Returns
    -------
    Backend or None
        None when numba is not installed (it comes with ``homsense[fast]``).
    """
    try:
        kernels = import_module("homsense.compiled.filter_kernels")
        told = import_module("homsense.compiled.resemblance").told
        heard = import_module("homsense.compiled.audibility").heard
    except ImportError:
        return None
    compiled_stages = {stage: getattr(kernels, stage) for stage in Backend._fields[1:-2]}
    return Backend("numba", **compiled_stages, told=told, heard=heard)


def fastest() -> Backend:
    """Return the compiled backend where it can be had, else numpy.

    Returns
    -------
    Backend
        What a localizer uses unless told otherwise.
    """
    return compiled() or NUMPY


def warmed() -> Backend:
    """Return the compiled backend after it has compiled everything, which may take some seconds.

    Returns
    -------
    Backend
        Numpy when numba is not installed.
    """
    chosen = fastest()
    nobody, nothing = np.zeros(1, np.float32), np.zeros(1, np.int32)
    particles = Particles(nobody, nobody, nobody, nothing)
    raster = Raster(np.float32(-1.0), np.float32(-1.0), np.float32(1.0), 3, 3)
    walls = Walls(raster, np.float32(0.5), np.eye(9, dtype=np.uint8)[4])
    move = Move(np.zeros(3, np.float32), np.zeros(6, np.float32))
    chosen.random_words(0, 0, 0, 1)
    particles = chosen.propagate(particles, move, walls, 0, 1)
    particles = chosen.reweigh(particles, raster, np.zeros(9, np.uint16), nothing).particles
    weights, sums = chosen.weigh(particles)
    chosen.systematic(particles, weights, sums.total, 0, 1, particles)
    coded = CodedCells(Grid(0.0, 0.0, 1.0, 1, 1), np.arange(2.0), *np.zeros((2, 2), np.intp))
    masses = chosen.cell_masses(coded, np.zeros(2, np.int32))
    chosen.draw(coded, masses, 0, 0, 1)
    found = chosen.histogram(particles, weights, 1.0)
    of_cell = chosen.hills(found.smooth, found.order)
    chosen.moments(particles, weights, *chosen.label(found, weights, of_cell), np.zeros(2))
    nearby = Nearby(np.arange(2), np.zeros(1, np.intp), np.zeros(1), nothing, np.zeros(1))
    chosen.told(nearby, np.zeros(1, np.int64), nothing, 1)
    audible = Audible(np.arange(2), nothing, nobody, nobody, nobody)
    chosen.heard(audible, np.zeros(1, np.int64), np.zeros(1), np.zeros(1), 1)
    return chosen
