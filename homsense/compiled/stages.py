"""The stages of the filter over all particles, compiled; see `homsense.stages`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import weights
from homsense.compiled.exact import cosine, random_words, sine, standard_normals, wrap_turns
from homsense.compiled.jit import allocating, apart, inlined
from homsense.free_space import Walls
from homsense.grid import Raster
from homsense.particles import Particles

Array = NDArray[Any]

_FRACTIONS = weights.FRACTIONS
_BLOCKED, _LOWEST = weights.BLOCKED, weights.LOWEST
_UNIT_BITS, _FRACTION_BITS = weights.UNIT_BITS, weights.FRACTION_BITS
_MOST_HALVINGS = weights.MOST_HALVINGS
_NOTHING = np.float32(0.0)


@allocating
def words(seed: int, tick: int, purpose: int, count: int) -> Array:
    """Return four random words for each of the numbers from 0.

    Parameters
    ----------
    seed, tick : uint64
        Key.
    purpose : int
        Number of the stream.
    count : int
        How many.

    Returns
    -------
    ndarray, shape (4, count), uint32
        Random bits.
    """
    drawn = np.empty((4, count), np.uint32)
    for index in range(count):
        drawn[0, index], drawn[1, index], drawn[2, index], drawn[3, index] = random_words(
            index, tick, purpose, seed
        )
    return drawn


@allocating
def propagate(
    particles: Particles, mean: Array, root: Array, walls: Walls, seed: int, tick: int
) -> tuple[Array, Array, Array, Array]:
    """Draw where each particle is after a motion; walls stop it and make it unlikely.

    Parameters
    ----------
    particles : Particles
        Before.
    mean, root : ndarray, float32
        The motion.
    walls : Walls
        What stops.
    seed, tick : uint64
        Key of the random numbers.

    Returns
    -------
    tuple of ndarray
        The four arrays of the particles after.
    """
    count = len(particles.x_m)
    x, y = np.empty(count, np.float32), np.empty(count, np.float32)
    turns, log_weight = np.empty(count, np.float32), np.empty(count, np.int32)
    _move(particles, mean, root, seed, tick, x, y, turns)
    clearance, is_near = np.empty(count, np.float32), np.empty(count, np.bool_)
    _look(particles, walls, x, y, clearance, is_near)
    _stop(particles, walls, x, y, clearance, is_near, log_weight)
    return x, y, turns, log_weight


@apart
def _move(
    particles: Particles,
    mean: Array,
    root: Array,
    seed: int,
    tick: int,
    x: Array,
    y: Array,
    turns: Array,
) -> None:
    forward_m, left_m, turned = mean[0], mean[1], mean[2]
    r00, r10, r11, r20, r21, r22 = root[0], root[1], root[2], root[3], root[4], root[5]
    for index in range(len(x)):
        w0, w1, w2, w3 = random_words(index, tick, 0, seed)
        n0, n1, n2 = standard_normals(w0, w1, w2, w3)
        forward = forward_m + r00 * n0
        left = left_m + (r10 * n0 + r11 * n1)
        turn = turned + ((r20 * n0 + r21 * n1) + r22 * n2)
        up, right = sine(particles.turns[index]), cosine(particles.turns[index])
        x[index] = particles.x_m[index] + (right * forward - up * left)
        y[index] = particles.y_m[index] + (up * forward + right * left)
        turns[index] = wrap_turns(particles.turns[index] + turn)


@apart
def _look(
    particles: Particles, walls: Walls, x: Array, y: Array, clearance: Array, is_near: Array
) -> None:
    """Look up the clearance of each particle, and whether it may meet something."""
    for index in range(len(x)):
        from_x, from_y = particles.x_m[index], particles.y_m[index]
        right, up = x[index] - from_x, y[index] - from_y
        free_m = walls.clearance_m[_cell_at(walls.raster, from_x, from_y)]
        clearance[index] = free_m
        is_near[index] = free_m < _NOTHING or right * right + up * up > free_m * free_m


@apart
def _stop(
    particles: Particles,
    walls: Walls,
    x: Array,
    y: Array,
    clearance: Array,
    is_near: Array,
    log_weight: Array,
) -> None:
    for index in range(len(x)):
        log_weight[index] = particles.log_weight[index]
        if is_near[index]:
            from_x, from_y = particles.x_m[index], particles.y_m[index]
            if _is_blocked(from_x, from_y, x[index], y[index], clearance[index], walls):
                x[index], y[index] = from_x, from_y
                log_weight[index] = max(np.int32(log_weight[index] + _BLOCKED), _LOWEST)
    best = _LOWEST
    for index in range(len(x)):
        best = max(best, log_weight[index])
    for index in range(len(x)):
        log_weight[index] -= best


@inlined
def _is_blocked(
    x_m: Any, y_m: Any, to_x_m: Any, to_y_m: Any, clearance_m: Any, walls: Walls
) -> bool:
    if walls.clearance_m[_cell_at(walls.raster, to_x_m, to_y_m)] < _NOTHING:
        return True
    right, up = to_x_m - x_m, to_y_m - y_m
    length = np.sqrt(right * right + up * up)
    gone = max(clearance_m, walls.half_cell_m)
    while gone < length:
        part = gone / length
        clearance = walls.clearance_m[_cell_at(walls.raster, x_m + right * part, y_m + up * part)]
        if clearance < _NOTHING:
            return True
        gone = gone + max(clearance, walls.half_cell_m)
    return False


@inlined
def _cell_at(raster: Raster, x_m: Any, y_m: Any) -> Any:
    """Return the flat index of a cell, unsigned."""
    column = np.floor((x_m - raster.west_m) * raster.cells_per_m)
    row = np.floor((y_m - raster.south_m) * raster.cells_per_m)
    columns, rows = np.int32(raster.columns), np.int32(raster.rows)
    inside = (
        (column >= _NOTHING)
        & (column < np.float32(columns))
        & (row >= _NOTHING)
        & (row < np.float32(rows))
    )
    return np.uint32(np.int32(row) * columns + np.int32(column) if inside else rows * columns)


@allocating
def reweigh(
    particles: Particles, raster: Raster, codes: Array, table: Array
) -> tuple[Array, int, int, int]:
    """Multiply each weight by the likelihood of the measurement at its place.

    Parameters
    ----------
    particles : Particles
        Before.
    raster : Raster
        The cells.
    codes : ndarray, shape (rows * columns + 1,), int32
        Code of each cell.
    table : ndarray, shape (n_codes,), int32
        Log-likelihood of each code.

    Returns
    -------
    log_weight : ndarray, int32
        The best is 0.
    gain : int
        What the best has gained.
    before, after : int
        Sums of the weights.
    """
    log_weight = np.empty(len(particles.x_m), np.int32)
    best, before, after = _gain(particles, raster, codes, table, log_weight)
    return log_weight, best, before, after


@apart
def _gain(
    particles: Particles, raster: Raster, codes: Array, table: Array, log_weight: Array
) -> Any:
    before = after = np.uint64(0)
    best = np.int32(-(2**31))
    for index in range(len(log_weight)):
        cell = _cell_at(raster, particles.x_m[index], particles.y_m[index])
        old = particles.log_weight[index]
        before += np.uint64(_linear(old))
        log_weight[index] = old + table[np.uint32(codes[cell])]
        best = max(best, log_weight[index])
    for index in range(len(log_weight)):
        log_weight[index] = max(np.int32(log_weight[index] - best), _LOWEST)
        after += np.uint64(_linear(log_weight[index]))
    return best, before, after


@inlined
def _linear(log_weight: Any) -> Any:
    halvings = min(np.int32(-(log_weight >> _UNIT_BITS)), _MOST_HALVINGS)
    return _FRACTIONS[np.uint32(log_weight & _FRACTION_BITS)] >> np.uint32(halvings)


@allocating
def weigh(log_weight: Array) -> tuple[Array, int, int]:
    """Return the weights and their sums.

    Parameters
    ----------
    log_weight : ndarray, shape (N,), int32
        At most 0.

    Returns
    -------
    weights : ndarray, shape (N,), uint32
        At most 2**20.
    total, squares : int
        Their sum, and that of their squares.
    """
    found = np.empty(len(log_weight), np.uint32)
    total, squares = _sum(log_weight, found)
    return found, total, squares


@apart
def _sum(log_weight: Array, found: Array) -> Any:
    total = squares = np.uint64(0)
    for index in range(len(found)):
        weight = _linear(log_weight[index])
        found[index] = weight
        total += np.uint64(weight)
        squares += np.uint64(weight) * np.uint64(weight)
    return total, squares


@allocating
def systematic(
    particles: Particles, weight: Array, total: int, offset: int, count: int
) -> tuple[Array, Array, Array, Array]:
    """Draw particles with one random offset and equal strides.

    Parameters
    ----------
    particles : Particles
        Before.
    weight : ndarray, shape (N,), uint32
        At most 2**20.
    total : int
        Their sum, positive.
    offset : int
        Random, in [0, total).
    count : int
        How many to draw.

    Returns
    -------
    tuple of ndarray
        The four arrays of the drawn particles.
    """
    x, y = np.empty(count, np.float32), np.empty(count, np.float32)
    turns, log_weight = np.empty(count, np.float32), np.zeros(count, np.int32)
    _draw(particles, weight, total, offset, x, y, turns)
    return x, y, turns, log_weight


@apart
def _draw(
    particles: Particles, weight: Array, total: int, offset: int, x: Array, y: Array, turns: Array
) -> None:
    reached, stride = np.int64(0), np.int64(offset)
    place, count = np.uint32(0), np.int64(len(x))
    for index in range(len(weight)):
        reached += count * np.int64(weight[index])
        while stride < reached:
            x[place] = particles.x_m[index]
            y[place] = particles.y_m[index]
            turns[place] = particles.turns[index]
            place += np.uint32(1)
            stride += total
