"""The motion of all particles, compiled; see `homsense.stages.propagate`.

Several short loops become vector instructions where one long loop does not.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import weights
from homsense.compiled.exact import ONE, cosine, sine, standard_normals, words, wrap_turns
from homsense.compiled.jit import allocating, apart, inlined
from homsense.compiled.rasters import cell_at, find_cells
from homsense.free_space import Walls
from homsense.particles import Particles
from homsense.philox import Purpose

Array = NDArray[Any]

_BLOCKED, _LOWEST = weights.BLOCKED, weights.LOWEST
_NOTHING = np.float32(0.0)
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
    drawn = words(seed, tick, _MOTION, count)
    _deviate(drawn[0], drawn[1], drawn[2], drawn[3], x, y, turns)
    _move(particles, mean, root, x, y, turns)
    before, after = np.empty(count, np.float32), np.empty(count, np.float32)
    cells, doubtful = np.empty(count, np.uint32), np.empty(count, np.bool_)
    _clear(particles.x_m, particles.y_m, walls, cells, before)
    _clear(x, y, walls, cells, after)
    _vouch(particles, before, after, x, y, log_weight, doubtful)
    numbers = np.empty(count, np.uint32)
    found = _collect(doubtful, numbers)
    _march(particles, walls, before, after, numbers[:found], x, y, log_weight)
    _lift(log_weight)
    return x, y, turns, log_weight


@apart
def _deviate(
    first: Array, second: Array, third: Array, fourth: Array, x: Array, y: Array, turns: Array
) -> None:
    """Write normal deviates to where the poses will be."""
    for index in range(len(x)):
        x[index], y[index], turns[index] = standard_normals(
            first[index], second[index], third[index], fourth[index]
        )


@apart
def _move(
    particles: Particles, mean: Array, root: Array, x: Array, y: Array, turns: Array
) -> None:
    """Turn the deviates into poses."""
    forward_m, left_m, turned = mean[0], mean[1], mean[2]
    r00, r10, r11, r20, r21, r22 = root[0], root[1], root[2], root[3], root[4], root[5]
    for index in range(len(x)):
        n0, n1, n2 = x[index], y[index], turns[index]
        forward = forward_m + r00 * n0
        left = left_m + (r10 * n0 + r11 * n1)
        turn = turned + ((r20 * n0 + r21 * n1) + r22 * n2)
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
    before: Array,
    after: Array,
    numbers: Array,
    x: Array,
    y: Array,
    log_weight: Array,
) -> None:
    """Walk the ways of some particles, given by their numbers, and stop who meets a wall."""
    for index in numbers:
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
    halves = np.float32(walls.clearance[cell_at(walls.raster, x_m, y_m)]) - ONE
    return halves * walls.half_cell_m
