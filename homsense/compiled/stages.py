"""Weighing and resampling of all particles, compiled; see `homsense.stages`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import weights
from homsense.compiled.jit import allocating, apart, inlined
from homsense.compiled.rasters import find_cells
from homsense.grid import Raster
from homsense.particles import Particles

Array = NDArray[Any]

_FRACTIONS = weights.FRACTIONS
_LOWEST, _BEST = weights.LOWEST, np.int32(0)
_FULL = np.uint64(weights.FULL)
_UNIT_BITS, _FRACTION_BITS = weights.UNIT_BITS, weights.FRACTION_BITS
_MOST_HALVINGS = weights.MOST_HALVINGS


@allocating
def reweigh(
    particles: Particles, raster: Raster, codes: Array, table: Array
) -> tuple[Array, Array, int, int, int, int]:
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
    weight : ndarray, uint32
        At most 2**20.
    total, squares : int
        Their sum, and that of their squares.
    gain : int
        What the best has gained.
    before : int
        Sum of the weights before.
    """
    count = len(particles.x_m)
    log_weight, cells = np.empty(count, np.int32), np.empty(count, np.uint32)
    weight = np.empty(count, np.uint32)
    find_cells(raster, particles.x_m, particles.y_m, cells)
    best = _gain(particles.log_weight, cells, codes, table, log_weight)
    _lower(log_weight, best)
    total, squares = _sum(log_weight, weight)
    return log_weight, weight, total, squares, best, _total(particles.log_weight)


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
    lowest = _BEST
    for index in range(len(log_weight)):
        lowest = min(lowest, log_weight[index])
    if lowest == _BEST:
        return np.uint64(len(log_weight)) * _FULL
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
    particles: Particles, weight: Array, total: int, offset: int, count: int, fresh: Particles
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
    fresh : Particles
        Who joins them.

    Returns
    -------
    tuple of ndarray
        The four arrays of the drawn particles and the fresh ones.
    """
    size = count + len(fresh.x_m)
    x, y = np.empty(size, np.float32), np.empty(size, np.float32)
    turns, log_weight = np.empty(size, np.float32), np.zeros(size, np.int32)
    x[count:], y[count:], turns[count:] = fresh.x_m, fresh.y_m, fresh.turns
    reached, until = np.empty(len(weight), np.int64), np.empty(len(weight), np.uint32)
    ancestors = np.zeros(count + 1, np.uint32)
    _stride(weight, offset, count, reached)
    _divide(reached, total, until)
    _settle(until, ancestors)
    _copy(particles, ancestors[:count], x, y, turns)
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
        rest = reached[index] - quotient * all_of_it
        until[index] = np.uint32(quotient + np.int64(rest > 0) - np.int64(rest <= -all_of_it))


@apart
def _settle(until: Array, ancestors: Array) -> None:
    """Write each particle where its first offspring goes; of equal places the last one counts."""
    for index in range(len(until)):
        ancestors[until[index]] = index


@apart
def _copy(particles: Particles, ancestors: Array, x: Array, y: Array, turns: Array) -> None:
    last = np.uint32(0)
    for place in range(len(ancestors)):
        last = max(last, ancestors[place])
        x[place] = particles.x_m[last]
        y[place] = particles.y_m[last]
        turns[place] = particles.turns[last]
