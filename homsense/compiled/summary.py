"""Histogram, hills and moments, compiled; see `homsense.histogram` and `homsense.modes`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import histogram as reference
from homsense import modes
from homsense.compiled.exact import cosine, sine
from homsense.compiled.jit import allocating, apart, inlined
from homsense.particles import Particles

Array = NDArray[Any]

_MARGIN = reference.MARGIN
_K0, _K1, _K2 = reference.KERNEL[:3]
_PROMINENCE = modes.PROMINENCE
_BINS = modes.RADIUS_BINS


@allocating
def histogram(particles: Particles, weights: Array, per_m: Any) -> tuple[int, int, Array, Array]:
    """Return the first column and row, the cell of each particle, and the smoothed mass.

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
    """
    west, east, south, north = _extent(particles, per_m)
    columns, rows = east - west + 2 * _MARGIN + 1, north - south + 2 * _MARGIN + 1
    west, south = west - _MARGIN, south - _MARGIN
    cells = np.empty(len(weights), np.int64)
    mass, smooth = np.zeros((rows, columns), np.int64), np.zeros((rows, columns), np.int64)
    _fill(particles, weights, per_m, west, south, cells, mass)
    _smooth_rows(mass, smooth)
    _smooth_columns(smooth, mass)
    return west, south, cells, mass


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
    cells: Array,
    mass: Array,
) -> None:
    columns = mass.shape[1]
    for index in range(len(weights)):
        column = np.uint32(np.int64(np.floor(particles.x_m[index] * per_m)) - west)
        row = np.uint32(np.int64(np.floor(particles.y_m[index] * per_m)) - south)
        cells[index] = row * columns + column
        mass[row, column] += np.int64(weights[index])


@apart
def _smooth_rows(mass: Array, smooth: Array) -> None:
    rows, columns = mass.shape
    for row in range(rows):
        for column in range(columns):
            total = _K2 * mass[row, column]
            if column > 0:
                total += _K1 * mass[row, column - 1]
            if column > 1:
                total += _K0 * mass[row, column - 2]
            if column < columns - 1:
                total += _K1 * mass[row, column + 1]
            if column < columns - 2:
                total += _K0 * mass[row, column + 2]
            smooth[row, column] = total


@apart
def _smooth_columns(mass: Array, smooth: Array) -> None:
    rows, columns = mass.shape
    for row in range(rows):
        for column in range(columns):
            total = _K2 * mass[row, column]
            if row > 0:
                total += _K1 * mass[row - 1, column]
            if row > 1:
                total += _K0 * mass[row - 2, column]
            if row < rows - 1:
                total += _K1 * mass[row + 1, column]
            if row < rows - 2:
                total += _K0 * mass[row + 2, column]
            smooth[row, column] = total


@allocating
def hills(rows: int, columns: int, order: Array, smooth: Array) -> Array:
    """Assign each cell with mass to a mode.

    Parameters
    ----------
    rows, columns : int
        Shape.
    order : ndarray, int64
        Flat indices of the cells with mass, heaviest first.
    smooth : ndarray, shape (rows * columns,), int64
        Mass of each cell.

    Returns
    -------
    ndarray, shape (len(order),), int64
        For each cell of `order`, the place in `order` of the peak of its mode.
    """
    hill, elder = np.empty(len(order), np.int64), np.arange(len(order))
    rank = np.full(rows * columns, len(order))
    around = np.empty(8, np.int64)
    _climb(rows, columns, order, smooth, rank, hill, elder, around)
    return hill


@apart
def _climb(
    rows: int,
    columns: int,
    order: Array,
    smooth: Array,
    rank: Array,
    hill: Array,
    elder: Array,
    around: Array,
) -> None:
    for place in range(len(order)):
        cell = order[place]
        row, column = cell // columns, cell % columns
        best, found = place, 0
        for up in (-1, 0, 1):
            for right in (-1, 0, 1):
                here = (up != 0 or right != 0) and 0 <= row + up < rows
                if here and 0 <= column + right < columns:
                    earlier = rank[cell + up * columns + right]
                    if earlier < place:
                        around[found] = earlier
                        found += 1
                        best = min(best, earlier)
        rank[cell] = place
        hill[place] = place if best == place else hill[best]
        for index in range(found):
            if hill[around[index]] != hill[place]:
                low, high = _root(elder, hill[place]), _root(elder, hill[around[index]])
                low, high = min(low, high), max(low, high)
                if low != high and smooth[cell] > _PROMINENCE * smooth[order[high]]:
                    elder[high] = low
    for place in range(len(order)):
        hill[place] = _root(elder, hill[place])


@inlined
def _root(elder: Array, hill: int) -> int:
    while elder[hill] != hill:
        hill = elder[hill]
    return hill


@allocating
def moments(
    particles: Particles, weights: Array, of_mode: Array, n_modes: int, corner: Array
) -> tuple[Array, Array, Array]:
    """Sum over the particles of each mode.

    Parameters
    ----------
    particles : Particles
        Poses.
    weights : ndarray, shape (N,), uint32
        How heavy.
    of_mode : ndarray, shape (N,), int64
        Number of the mode of each particle.
    n_modes : int
        How many there are.
    corner : ndarray, shape (2,), float64
        Where positions are counted from, metres.

    Returns
    -------
    tuple of ndarray
        As in `homsense.modes.Moments`.
    """
    by_mode, radius = np.zeros((n_modes, 8)), np.zeros(n_modes)
    near, distance = np.zeros((n_modes, _BINS)), np.empty(len(weights))
    _add(particles, weights, of_mode, corner, by_mode)
    sums = by_mode.T.copy()
    mass = np.maximum(sums[0], 1.0)
    _measure(particles, of_mode, corner, sums[1] / mass, sums[2] / mass, distance)
    _reach(of_mode, distance, radius)
    _spread(weights, of_mode, (_BINS - 1) / np.maximum(radius, 1e-9), distance, near)
    return sums, radius, near


@apart
def _add(particles: Particles, weights: Array, of_mode: Array, corner: Array, sums: Array) -> None:
    for index in range(len(weights)):
        mode, w = np.uint64(of_mode[index]), np.float64(weights[index])
        x = np.float64(particles.x_m[index]) - corner[0]
        y = np.float64(particles.y_m[index]) - corner[1]
        wx, wy = w * x, w * y
        sums[mode, 0] += w
        sums[mode, 1] += wx
        sums[mode, 2] += wy
        sums[mode, 3] += wx * x
        sums[mode, 4] += wx * y
        sums[mode, 5] += wy * y
        sums[mode, 6] += w * np.float64(cosine(particles.turns[index]))
        sums[mode, 7] += w * np.float64(sine(particles.turns[index]))


@apart
def _measure(
    particles: Particles,
    of_mode: Array,
    corner: Array,
    mean_x: Array,
    mean_y: Array,
    distance: Array,
) -> None:
    for index in range(len(distance)):
        mode = np.uint64(of_mode[index])
        right = np.float64(particles.x_m[index]) - corner[0] - mean_x[mode]
        up = np.float64(particles.y_m[index]) - corner[1] - mean_y[mode]
        distance[index] = np.sqrt(right * right + up * up)


@apart
def _reach(of_mode: Array, distance: Array, radius: Array) -> None:
    for index in range(len(distance)):
        mode = np.uint64(of_mode[index])
        radius[mode] = max(radius[mode], distance[index])


@apart
def _spread(weights: Array, of_mode: Array, per_m: Array, distance: Array, near: Array) -> None:
    for index in range(len(weights)):
        mode = np.uint64(of_mode[index])
        near[mode, np.uint64(distance[index] * per_m[mode])] += np.float64(weights[index])
