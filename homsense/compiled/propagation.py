"""The motion of all particles, compiled; see `homsense.stages.propagate`.

Several short loops become vector instructions where one long loop does not.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import weights
from homsense.compiled.exact import ONE, cosine, sine, two_normals, words, wrap_turns
from homsense.compiled.jit import allocating, apart
from homsense.compiled.rasters import cell_at, find_cells
from homsense.free_space import Walls
from homsense.particles import Particles
from homsense.philox import Purpose

Array = NDArray[Any]

_BLOCKED, _LOWEST = weights.BLOCKED, weights.LOWEST
_NOTHING, _FREE = np.float32(0.0), np.int32(0)
_ZERO, _ONE, _TWO = np.uint32(0), np.uint32(1), np.uint32(2)
_MOTION = int(Purpose.MOTION)


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
    deviates = _deviates(count, seed, tick)
    _move(particles, mean, root, deviates[0], deviates[1], deviates[2], x, y, turns)
    first, until = np.empty(count, np.float32), np.empty(count, np.float32)
    cells, numbers = np.empty(count, np.uint32), np.empty(count, np.uint32)
    stopped, doubtful = np.empty(count, np.bool_), np.empty(count, np.bool_)
    _clear(particles.x_m, particles.y_m, walls, cells, first)
    _clear(x, y, walls, cells, until)
    _vouch(particles, walls, x, y, first, until, stopped, doubtful)
    found, strides = _collect(doubtful, numbers), np.zeros(count, np.uint32)
    _march(particles, walls, numbers[:found], x, y, first, until, strides, stopped)
    _halt(particles, stopped, x, y)
    _blame(particles.log_weight, stopped, log_weight)
    return x, y, turns, log_weight


@allocating
def _deviates(count: int, seed: int, tick: int) -> Array:
    """Return three normal deviates for each particle; a number of the stream gives four."""
    numbers = -(-3 * count // 4)
    drawn = words(seed, tick, _MOTION, numbers)
    normals = np.empty((4, numbers), np.float32)
    _deviate(drawn[0], drawn[1], normals[0], normals[1])
    _deviate(drawn[2], drawn[3], normals[2], normals[3])
    return normals.ravel()[: 3 * count].reshape(3, count)


@apart
def _deviate(distance: Array, direction: Array, one: Array, other: Array) -> None:
    for index in range(len(distance)):
        one[index], other[index] = two_normals(distance[index], direction[index])


@apart
def _move(
    particles: Particles,
    mean: Array,
    root: Array,
    n0: Array,
    n1: Array,
    n2: Array,
    x: Array,
    y: Array,
    turns: Array,
) -> None:
    forward_m, left_m, turned = mean[0], mean[1], mean[2]
    r00, r10, r11, r20, r21, r22 = root[0], root[1], root[2], root[3], root[4], root[5]
    for index in range(len(x)):
        forward = forward_m + r00 * n0[index]
        left = left_m + (r10 * n0[index] + r11 * n1[index])
        turn = turned + ((r20 * n0[index] + r21 * n1[index]) + r22 * n2[index])
        up, right = sine(particles.turns[index]), cosine(particles.turns[index])
        x[index] = particles.x_m[index] + (right * forward - up * left)
        y[index] = particles.y_m[index] + (up * forward + right * left)
        turns[index] = wrap_turns(particles.turns[index] + turn)


@apart
def _clear(x: Array, y: Array, walls: Walls, cells: Array, clearance: Array) -> None:
    find_cells(walls.raster, x, y, cells)
    for index in range(len(cells)):
        halves = np.float32(walls.clearance[cells[index]]) - ONE
        clearance[index] = halves * walls.half_cell_m


@apart
def _vouch(
    particles: Particles,
    walls: Walls,
    x: Array,
    y: Array,
    first: Array,
    until: Array,
    stopped: Array,
    doubtful: Array,
) -> None:
    """Tell who ends where nobody can be, and whose way the two ends do not vouch for.

    The clearances of the ends come in `first` and `until`, which get the part of each way that is
    to be looked at.
    """
    for index in range(len(x)):
        right, up = x[index] - particles.x_m[index], y[index] - particles.y_m[index]
        before, after = first[index], until[index]
        square, reach = right * right + up * up, before + after
        is_stopped = after < _NOTHING
        is_vouched = (before >= _NOTHING) & (square <= reach * reach)
        first[index], until[index] = max(before, walls.half_cell_m), np.sqrt(square) - after
        stopped[index] = is_stopped
        doubtful[index] = (not (is_stopped | is_vouched)) & (first[index] < until[index])


@apart
def _collect(chosen: Array, numbers: Array) -> int:
    """Write the numbers of those that are chosen, and return how many there are."""
    found = np.uint32(0)
    for index in range(len(chosen)):
        numbers[found] = index
        found += np.uint32(chosen[index])
    return int(found)


@apart
def _march(
    particles: Particles,
    walls: Walls,
    numbers: Array,
    x: Array,
    y: Array,
    first: Array,
    until: Array,
    strides: Array,
    stopped: Array,
) -> None:
    """Walk the ways of some particles, given by their numbers, half a cell at a time.

    Each walks as many half cells as the clearance vouches for before the next does, and a way that
    ends is dropped without a branch: no processor foresees which one does.
    """
    walking = len(numbers)
    while walking:
        still = np.uint32(0)
        for place in range(walking):
            index = numbers[place]
            from_x, from_y = particles.x_m[index], particles.y_m[index]
            right, up = x[index] - from_x, y[index] - from_y
            gone = first[index] + np.float32(strides[index]) * walls.half_cell_m
            part = gone / np.sqrt(right * right + up * up)
            cell = cell_at(walls.raster, from_x + right * part, from_y + up * part)
            clearance = np.uint32(walls.clearance[cell])
            strides[index] += max(clearance, _TWO) - _ONE
            gone = first[index] + np.float32(strides[index]) * walls.half_cell_m
            stopped[index] = clearance == _ZERO
            numbers[still] = index
            still += np.uint32((clearance > _ZERO) & (gone < until[index]))
        walking = int(still)


@apart
def _halt(particles: Particles, stopped: Array, x: Array, y: Array) -> None:
    """Leave those where they were whom a wall has stopped."""
    for index in range(len(x)):
        is_stopped, to_x, to_y = stopped[index], x[index], y[index]
        from_x, from_y = particles.x_m[index], particles.y_m[index]
        x[index] = from_x if is_stopped else to_x
        y[index] = from_y if is_stopped else to_y


@apart
def _blame(old: Array, stopped: Array, log_weight: Array) -> None:
    """Make those unlikely whom a wall has stopped; the best has log-weight 0."""
    best = _LOWEST
    for index in range(len(log_weight)):
        cost = _BLOCKED if stopped[index] else _FREE
        log_weight[index] = max(np.int32(old[index] + cost), _LOWEST)
        best = max(best, log_weight[index])
    for index in range(len(log_weight)):
        log_weight[index] -= best
