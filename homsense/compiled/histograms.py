"""The position histogram, compiled; see `homsense.histogram`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import histogram as reference
from homsense.compiled.jit import allocating, apart, inlined
from homsense.particles import Particles

Array = NDArray[Any]

_MARGIN, _KEY_BITS = reference.MARGIN, reference.KEY_BITS


@allocating
def histogram(
    particles: Particles, weights: Array, per_m: Any
) -> tuple[int, int, Array, Array, Array]:
    """Return the first cell, the cell of each particle, the smoothed mass, and what sorts it.

    Parameters
    ----------
    particles : Particles
        Where.
    weights : ndarray, shape (N,), uint32
        How heavy.
    per_m : float32
        Cells a metre.

    Returns
    -------
    column, row : int
        First cell.
    cells : ndarray, shape (N,), int64
        Flat indices.
    smooth : ndarray, shape (rows, columns), int64
        Smoothed mass.
    keys : ndarray, int64
        For each cell with mass its mass, negative, then its index; empty where both together are
        too long.
    """
    west, east, south, north = _extent(particles, per_m)
    columns, rows = east - west + 2 * _MARGIN + 1, north - south + 2 * _MARGIN + 1
    west, south = west - _MARGIN, south - _MARGIN
    cells, size = np.empty(len(weights), np.int64), rows * columns
    mass, smooth = np.zeros(size, np.int64), np.zeros(size, np.int64)
    _fill(particles, weights, per_m, west, south, columns, cells, mass)
    _smooth(mass, 1, smooth)
    _smooth(smooth, columns, mass)
    keys = np.empty(size + 1, np.int64)
    found = _key(mass, keys) if _are_short(mass) else 0
    return west, south, cells, mass.reshape(rows, columns), keys[:found]


@inlined
def _index_bits(mass: Array) -> int:
    bits = 0
    while len(mass) >> bits:
        bits += 1
    return bits


@apart
def _are_short(mass: Array) -> bool:
    """Tell whether a mass and an index fit into one number."""
    heaviest = np.int64(0)
    for cell in range(len(mass)):
        heaviest = max(heaviest, mass[cell])
    return heaviest >> (_KEY_BITS - 1 - _index_bits(mass)) == 0


@apart
def _key(mass: Array, keys: Array) -> int:
    """Write the keys of the cells with mass, and return how many there are."""
    found, bits = np.uint64(0), _index_bits(mass)
    for cell in range(len(mass)):
        keys[found] = (-mass[cell] << bits) | cell
        found += np.uint64(mass[cell] > 0)
    return int(found)


@apart
def _extent(particles: Particles, per_m: Any) -> Any:
    x, y = particles.x_m[0], particles.y_m[0]
    least_x, most_x, least_y, most_y = x, x, y, y
    for index in range(len(particles.x_m)):
        x, y = particles.x_m[index], particles.y_m[index]
        least_x, most_x = min(least_x, x), max(most_x, x)
        least_y, most_y = min(least_y, y), max(most_y, y)
    return (
        np.int64(np.floor(least_x * per_m)),
        np.int64(np.floor(most_x * per_m)),
        np.int64(np.floor(least_y * per_m)),
        np.int64(np.floor(most_y * per_m)),
    )


@apart
def _fill(
    particles: Particles,
    weights: Array,
    per_m: Any,
    west: int,
    south: int,
    columns: int,
    cells: Array,
    mass: Array,
) -> None:
    for index in range(len(weights)):
        column = np.int64(np.floor(particles.x_m[index] * per_m)) - west
        row = np.int64(np.floor(particles.y_m[index] * per_m)) - south
        cells[index] = row * columns + column
        mass[np.uint64(cells[index])] += np.int64(weights[index])


@apart
def _smooth(mass: Array, apart: int, smooth: Array) -> None:
    """Apply the kernel along the cells that lie so far apart; what it meets at the edge is 0."""
    step = np.uint64(apart)
    twice = step + step
    for shifted in range(len(mass) - 4 * apart):
        cell = np.uint64(shifted) + twice
        near, far = mass[cell - step] + mass[cell + step], mass[cell - twice] + mass[cell + twice]
        smooth[cell] = 6 * mass[cell] + 4 * near + far
