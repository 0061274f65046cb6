"""The compiled stages of the filter behind the signatures of `homsense.backend.Backend`.

Named tuples cross into compiled code as plain ones: numba looks their class up at every call.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense.compiled import (
    exact,
    histograms,
    peaks,
    propagation,
    rasters,
    resetting,
    stages,
)
from homsense.compiled.jit import fingerprint, kept
from homsense.free_space import Walls
from homsense.grid import Raster
from homsense.histogram import Histogram, by_keys, heaviest_first
from homsense.modes import Moments
from homsense.particles import Particles
from homsense.resetting import CellMasses, CodedCells, evidence_bits
from homsense.stages import Move, Reweighed
from homsense.weights import WeightSums

FloatArray = NDArray[np.float64]
Integers = NDArray[np.int32]
IntArray = NDArray[np.int64]
Weights = NDArray[np.uint32]
Codes = NDArray[np.uint16]


def random_words(seed: int, tick: int, purpose: int, count: int) -> Weights:
    """Return four random words for each of the numbers from 0.

    Parameters
    ----------
    seed, tick : int
        In [0, 2**64).
    purpose : int
        Number of the stream, in [0, 2**32).
    count : int
        How many.

    Returns
    -------
    ndarray, shape (4, count), uint32
        As `homsense.philox.random_words` gives them.
    """
    drawn: Weights = _words(np.uint64(seed), np.uint64(tick), int(purpose), count)
    return drawn


def propagate(particles: Particles, move: Move, walls: Walls, seed: int, tick: int) -> Particles:
    """Draw where each particle is after a motion.

    Parameters
    ----------
    particles : Particles
        Before.
    move : Move
        The motion.
    walls : Walls
        What stops.
    seed, tick : int
        Key of the random numbers.

    Returns
    -------
    Particles
        As `homsense.stages.propagate` gives them.
    """
    raster, half_cell_m, clearance = walls
    solid = tuple(raster), half_cell_m, clearance
    return Particles(*_propagate(tuple(particles), *move, solid, np.uint64(seed), np.uint64(tick)))


def reweigh(particles: Particles, raster: Raster, codes: Codes, table: Integers) -> Reweighed:
    """Multiply each weight by the likelihood of the measurement at its place.

    Parameters
    ----------
    particles : Particles
        Before.
    raster : Raster
        The cells.
    codes : ndarray, shape (rows * columns,), uint16
        Code of each cell.
    table : ndarray, shape (n_codes,), int32
        Log-likelihood of each code.

    Returns
    -------
    Reweighed
        As `homsense.stages.reweigh` gives it.
    """
    log_weight, weights, total, squares, gain, before = _reweigh(
        tuple(particles), tuple(raster), codes, table
    )
    return Reweighed(
        Particles(*particles[:3], log_weight),
        weights,
        WeightSums(len(weights), int(total), int(squares)),
        int(gain),
        int(before),
    )


def weigh(particles: Particles) -> tuple[Weights, WeightSums]:
    """Return the weights and their sums.

    Parameters
    ----------
    particles : Particles
        The best log-weight is 0.

    Returns
    -------
    weights : ndarray, shape (N,), uint32
        At most 2**20.
    summed : WeightSums
        Exact.
    """
    weights, total, squares = _weigh(particles.log_weight)
    return weights, WeightSums(len(weights), int(total), int(squares))


def systematic(
    particles: Particles, weights: Weights, total: int, offset: int, count: int, fresh: Particles
) -> Particles:
    """Draw particles with one random offset and equal strides.

    Parameters
    ----------
    particles : Particles
        Before.
    weights : ndarray, shape (N,), uint32
        At most 2**20.
    total : int
        Their sum, positive.
    offset : int
        Random, in [0, total).
    count : int
        How many to draw.
    fresh : Particles
        Who joins them.

    Returns
    -------
    Particles
        As `homsense.stages.systematic` gives them.
    """
    drawn = _systematic(tuple(particles), weights, total, offset, count, tuple(fresh))
    return Particles(*drawn)


def cell_masses(coded: CodedCells, table: Integers) -> CellMasses:
    """Return where a measurement can have been made.

    Parameters
    ----------
    coded : CodedCells
        The cells.
    table : ndarray, shape (n_codes,), int32
        Log-likelihood of each code.

    Returns
    -------
    CellMasses
        As `homsense.resetting.cell_masses` gives them.
    """
    of_code, total, best = _cell_masses(coded.sizes, table)
    return CellMasses(of_code, evidence_bits(coded, total, int(best)))


def draw(coded: CodedCells, masses: CellMasses, seed: int, tick: int, count: int) -> Particles:
    """Draw poses from p(x | z).

    Parameters
    ----------
    coded : CodedCells
        The cells.
    masses : CellMasses
        Of the measurement.
    seed, tick : int
        Key of the random numbers.
    count : int
        How many.

    Returns
    -------
    Particles
        As `homsense.resetting.draw` gives them.
    """
    grid, *by_code = coded
    corner = float(grid.west_m), float(grid.south_m), float(grid.cell_m), grid.columns
    key = np.uint64(seed), np.uint64(tick)
    return Particles(*_draw(*by_code, masses.of_code, corner, key, count))


def histogram(particles: Particles, weights: Weights, cell_m: float) -> Histogram:
    """Return the histogram of some particles.

    Parameters
    ----------
    particles : Particles
        Where.
    weights : ndarray, shape (N,), uint32
        How heavy.
    cell_m : float
        Side of a cell, metres.

    Returns
    -------
    Histogram
        As `homsense.histogram.histogram` gives it.
    """
    column, row, cells, smooth, keys = _histogram(
        tuple(particles), weights, np.float32(1.0 / cell_m)
    )
    order = (
        by_keys(keys, smooth.size.bit_length()) if len(keys) else heaviest_first(smooth.ravel())
    )
    return Histogram(cell_m, column, row, cells, smooth, order)


def hills(smooth: IntArray, order: IntArray) -> IntArray:
    """Assign each cell with mass to a mode.

    Parameters
    ----------
    smooth : ndarray, shape (rows, columns), int64
        Mass of each cell, none at the edge.
    order : ndarray, int64
        Flat indices of the cells with mass, heaviest first.

    Returns
    -------
    ndarray, shape (len(order),), int64
        As `homsense.modes.hills` gives it.
    """
    found: IntArray = _hills(smooth, order)
    return found


def label(found: Histogram, weights: Weights, of_cell: IntArray) -> tuple[IntArray, int]:
    """Return the number of the mode of each particle.

    Parameters
    ----------
    found : Histogram
        Cells of the particles.
    weights : ndarray, shape (N,), uint32
        How heavy they are.
    of_cell : ndarray, int64
        What `hills` gives for the cells with mass.

    Returns
    -------
    of_mode : ndarray, shape (N,), int64
        As `homsense.modes.label` gives them.
    n_modes : int
        How many modes there are.
    """
    of_mode, n_modes = _label(found.cells, found.smooth.size, found.order, weights, of_cell)
    return of_mode, n_modes


def moments(
    particles: Particles, weights: Weights, of_mode: IntArray, n_modes: int, corner: FloatArray
) -> Moments:
    """Sum over the particles of each mode.

    Parameters
    ----------
    particles : Particles
        Poses.
    weights : ndarray, shape (N,), uint32
        How heavy.
    of_mode : ndarray, shape (N,), int64
        Number of the mode of each particle; `n_modes` for the rest.
    n_modes : int
        How many there are.
    corner : ndarray, shape (2,), float64
        Where positions are counted from, metres.

    Returns
    -------
    Moments
        As `homsense.modes.moments` gives them.
    """
    return Moments(*_moments(tuple(particles), weights, of_mode, n_modes, corner))


def _outermost(fingerprint: str) -> tuple[Callable[..., Any], ...]:
    """Return the functions that Python calls; what they enclose is a part of their cache key."""

    def words(seed, tick, purpose, count):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return exact.words(seed, tick, purpose, count)

    def propagate(particles, mean, root, walls, seed, tick):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        raster, half_cell_m, clearance = walls
        solid = Walls(Raster(*raster), half_cell_m, clearance)
        return propagation.propagate(Particles(*particles), mean, root, solid, seed, tick)

    def reweigh(particles, raster, codes, table):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return stages.reweigh(Particles(*particles), Raster(*raster), codes, table)

    def weigh(log_weight):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return stages.weigh(log_weight)

    def systematic(particles, weights, total, offset, count, fresh):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        joining = Particles(*fresh)
        return stages.systematic(Particles(*particles), weights, total, offset, count, joining)

    def cell_masses(sizes, table):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return resetting.cell_masses(sizes, table)

    def draw(sizes, cells, starts, of_code, grid, key, count):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return resetting.draw(sizes, cells, starts, of_code, grid, key, count)

    def histogram(particles, weights, per_m):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return histograms.histogram(Particles(*particles), weights, per_m)

    def hills(smooth, order):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return peaks.hills(smooth, order)

    def label(cells, size, order, weights, of_cell):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return peaks.label(cells, size, order, weights, of_cell)

    def moments(particles, weights, of_mode, n_modes, corner):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        fingerprint  # noqa: B018
        return peaks.moments(Particles(*particles), weights, of_mode, n_modes, corner)

    return (
        kept(words),
        kept(propagate),
        kept(reweigh),
        kept(weigh),
        kept(systematic),
        kept(cell_masses),
        kept(draw),
        kept(histogram),
        kept(hills),
        kept(label),
        kept(moments),
    )


(
    _words,
    _propagate,
    _reweigh,
    _weigh,
    _systematic,
    _cell_masses,
    _draw,
    _histogram,
    _hills,
    _label,
    _moments,
) = _outermost(fingerprint(exact, histograms, peaks, propagation, rasters, resetting, stages))
