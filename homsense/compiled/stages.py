"""The stages of the filter over all particles, compiled; see `homsense.stages`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import weights
from homsense.compiled.exact import ONE, cosine, random_words, sine, standard_normals, wrap_turns
from homsense.compiled.jit import allocating, apart, inlined
from homsense.free_space import Walls
from homsense.grid import Raster
from homsense.particles import Particles
from homsense.philox import Purpose

Array = NDArray[Any]

_FRACTIONS = weights.FRACTIONS
_BLOCKED, _LOWEST = weights.BLOCKED, weights.LOWEST
_UNIT_BITS, _FRACTION_BITS = weights.UNIT_BITS, weights.FRACTION_BITS
_MOST_HALVINGS = weights.MOST_HALVINGS
_NOTHING = np.float32(0.0)
_MOTION = int(Purpose.MOTION)


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
    before, after = np.empty(count, np.float32), np.empty(count, np.float32)
    cells, doubtful = np.empty(count, np.uint32), np.empty(count, np.bool_)
    _clear(particles.x_m, particles.y_m, walls, cells, before)
    _clear(x, y, walls, cells, after)
    _vouch(particles, before, after, x, y, log_weight, doubtful)
    _march(particles, walls, before, after, doubtful, x, y, log_weight)
    _lift(log_weight)
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
        w0, w1, w2, w3 = random_words(index, tick, _MOTION, seed)
        n0, n1, n2 = standard_normals(w0, w1, w2, w3)
        forward = forward_m + r00 * n0
        left = left_m + (r10 * n0 + r11 * n1)
        turn = turned + ((r20 * n0 + r21 * n1) + r22 * n2)
        up, right = sine(particles.turns[index]), cosine(particles.turns[index])
        x[index] = particles.x_m[index] + (right * forward - up * left)
        y[index] = particles.y_m[index] + (up * forward + right * left)
        turns[index] = wrap_turns(particles.turns[index] + turn)


@apart
def _clear(x: Array, y: Array, walls: Walls, cells: Array, clearance: Array) -> None:
    """Find cells first and look up then: each loop alone is a few vector instructions."""
    _find_cells(walls.raster, x, y, cells)
    for index in range(len(cells)):
        halves = np.float32(walls.clearance[cells[index]]) - ONE
        clearance[index] = halves * walls.half_cell_m


@apart
def _find_cells(raster: Raster, x: Array, y: Array, cells: Array) -> None:
    for index in range(len(x)):
        cells[index] = _cell_at(raster, x[index], y[index])


@apart
def _vouch(
    particles: Particles,
    before: Array,
    after: Array,
    x: Array,
    y: Array,
    log_weight: Array,
    doubtful: Array,
) -> None:
    """Stop who ends where nobody can be, and mark whose way the two ends do not vouch for."""
    for index in range(len(x)):
        from_x, from_y = particles.x_m[index], particles.y_m[index]
        right, up = x[index] - from_x, y[index] - from_y
        reach = before[index] + after[index]
        is_stopped = after[index] < _NOTHING
        is_vouched = (before[index] >= _NOTHING) & (right * right + up * up <= reach * reach)
        doubtful[index] = (not is_stopped) & (not is_vouched)
        old = particles.log_weight[index]
        x[index] = from_x if is_stopped else x[index]
        y[index] = from_y if is_stopped else y[index]
        log_weight[index] = max(np.int32(old + _BLOCKED), _LOWEST) if is_stopped else old


@apart
def _march(
    particles: Particles,
    walls: Walls,
    before: Array,
    after: Array,
    doubtful: Array,
    x: Array,
    y: Array,
    log_weight: Array,
) -> None:
    for index in range(len(x)):
        if not doubtful[index]:
            continue
        from_x, from_y = particles.x_m[index], particles.y_m[index]
        right, up = x[index] - from_x, y[index] - from_y
        length = np.sqrt(right * right + up * up)
        gone, until = max(before[index], walls.half_cell_m), length - after[index]
        while gone < until:
            part = gone / length
            ahead = _clearance_m(walls, from_x + right * part, from_y + up * part)
            if ahead < _NOTHING:
                x[index], y[index] = from_x, from_y
                log_weight[index] = max(np.int32(log_weight[index] + _BLOCKED), _LOWEST)
                break
            gone = gone + max(ahead, walls.half_cell_m)


@apart
def _lift(log_weight: Array) -> None:
    best = _LOWEST
    for index in range(len(log_weight)):
        best = max(best, log_weight[index])
    for index in range(len(log_weight)):
        log_weight[index] -= best


@inlined
def _clearance_m(walls: Walls, x_m: Any, y_m: Any) -> Any:
    halves = np.float32(walls.clearance[_cell_at(walls.raster, x_m, y_m)]) - ONE
    return halves * walls.half_cell_m


@inlined
def _cell_at(raster: Raster, x_m: Any, y_m: Any) -> Any:
    """Return the flat index of a cell, unsigned."""
    last_column, last_row = np.float32(raster.columns - 1), np.float32(raster.rows - 1)
    column = min(max((x_m - raster.west_m) * raster.cells_per_m, _NOTHING), last_column)
    row = min(max((y_m - raster.south_m) * raster.cells_per_m, _NOTHING), last_row)
    return np.uint32(np.int32(row) * np.int32(raster.columns) + np.int32(column))


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
    codes : ndarray, shape (rows * columns,), uint16
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
    count = len(particles.x_m)
    log_weight, cells = np.empty(count, np.int32), np.empty(count, np.uint32)
    _find_cells(raster, particles.x_m, particles.y_m, cells)
    best = _gain(particles.log_weight, cells, codes, table, log_weight)
    _lower(log_weight, best)
    return log_weight, best, _total(particles.log_weight), _total(log_weight)


@apart
def _gain(old: Array, cells: Array, codes: Array, table: Array, log_weight: Array) -> Any:
    best = np.int32(-(2**31))
    for index in range(len(log_weight)):
        log_weight[index] = old[index] + table[np.uint32(codes[cells[index]])]
        best = max(best, log_weight[index])
    return best


@apart
def _lower(log_weight: Array, best: int) -> None:
    for index in range(len(log_weight)):
        log_weight[index] = max(np.int32(log_weight[index] - best), _LOWEST)


@apart
def _total(log_weight: Array) -> Any:
    total = np.uint64(0)
    for index in range(len(log_weight)):
        total += np.uint64(linear(log_weight[index]))
    return total


@inlined
def linear(log_weight: Any) -> Any:
    """Return the weight of a log-weight."""
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
        weight = linear(log_weight[index])
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
    reached, until = np.empty(len(weight), np.int64), np.empty(len(weight), np.uint32)
    ancestors = np.zeros(count + 1, np.uint32)
    _stride(weight, offset, count, reached)
    _divide(reached, total, until)
    _settle(until, ancestors)
    _copy(particles, ancestors, x, y, turns)
    return x, y, turns, log_weight


@apart
def _stride(weight: Array, offset: int, count: int, reached: Array) -> None:
    before = np.int64(-offset)
    for index in range(len(weight)):
        reached[index] = before
        before += np.int64(count) * np.int64(weight[index])


@apart
def _divide(reached: Array, total: int, until: Array) -> None:
    """Divide and round up.

    The quotient is rounded in floating point and then put right, since a division of whole
    numbers takes longer than all the rest.
    """
    all_of_it, per_total = np.int64(total), 1.0 / total
    for index in range(len(reached)):
        quotient = np.int64(np.float64(reached[index]) * per_total)
        quotient += np.int64(quotient * all_of_it < reached[index])
        quotient -= np.int64((quotient - 1) * all_of_it >= reached[index])
        until[index] = np.uint32(quotient)


@apart
def _settle(until: Array, ancestors: Array) -> None:
    """Write each particle where its first offspring goes; of equal places the last one counts."""
    for index in range(len(until)):
        ancestors[until[index]] = index


@apart
def _copy(particles: Particles, ancestors: Array, x: Array, y: Array, turns: Array) -> None:
    last = np.uint32(0)
    for place in range(len(x)):
        last = max(last, ancestors[place])
        x[place] = particles.x_m[last]
        y[place] = particles.y_m[last]
        turns[place] = particles.turns[last]
