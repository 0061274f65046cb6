"""The stages of the filter over all particles, in numpy.

`homsense.compiled.stages` repeats them operation by operation; the results have the same bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.exact import ONE, cosine, sine, standard_normals, wrap_turns
from homsense.free_space import Walls
from homsense.grid import Raster
from homsense.particles import Particles, joined
from homsense.philox import Purpose, random_words
from homsense.resample import strides
from homsense.weights import BLOCKED, LOWEST, WeightSums, linear, sums

Integers = NDArray[np.int32]
IntArray = NDArray[np.intp]
Singles = NDArray[np.float32]
Weights = NDArray[np.uint32]
Codes = NDArray[np.uint16]

BLOCK = 8192
NOTHING = np.float32(0.0)
_STRIDES = np.arange(8, dtype=np.float32)


class Move(NamedTuple):
    """A measured motion in the body frame, and how uncertain it is.

    Parameters
    ----------
    mean : ndarray, shape (3,), float32
        Forward m, left m, turn in turns.
    root : ndarray, shape (6,), float32
        Lower triangle, row by row, of the square root of the covariance.
    """

    mean: Singles
    root: Singles


def propagate(particles: Particles, move: Move, walls: Walls, seed: int, tick: int) -> Particles:
    """Draw where each particle is after a motion; walls stop it and make it unlikely.

    Parameters
    ----------
    particles : Particles
        Before.
    move : Move
        The motion.
    walls : Walls
        What stops.
    seed, tick : int
        Key of the random numbers, in [0, 2**64).

    Returns
    -------
    Particles
        After, with the best log-weight at 0; those that a wall has stopped are where they were,
        turned.
    """
    deviates = _deviates(particles.size, seed, tick)
    parts = [
        _propagate(_block(particles, first), deviates[:, first : first + BLOCK], move, walls)
        for first in range(0, particles.size, BLOCK)
    ]
    moved = parts[0] if len(parts) == 1 else joined(parts)
    return moved._replace(log_weight=moved.log_weight - moved.log_weight.max())


def _deviates(count: int, seed: int, tick: int) -> Singles:
    """Return three normal deviates for each particle; a number of the stream gives four."""
    numbers = -(-3 * count // 4)
    drawn = np.empty((4, numbers), np.float32)
    for first in range(0, numbers, BLOCK):
        block = drawn[:, first : first + BLOCK]
        words = random_words(seed, tick, Purpose.MOTION, block.shape[1], first)
        block[...] = standard_normals(words)
    return drawn.ravel()[: 3 * count].reshape(3, count)


def _block(particles: Particles, first: int) -> Particles:
    part = slice(first, first + BLOCK)
    x, y, turns, log_weight = particles
    return Particles(x[part], y[part], turns[part], log_weight[part])


def _propagate(particles: Particles, deviates: Singles, move: Move, walls: Walls) -> Particles:
    forward, left, turn = _noisy(move, deviates)
    up, right = sine(particles.turns), cosine(particles.turns)
    x = particles.x_m + (right * forward - up * left)
    y = particles.y_m + (up * forward + right * left)
    stopped = np.flatnonzero(blocked(particles.x_m, particles.y_m, x, y, walls))
    x[stopped], y[stopped] = particles.x_m[stopped], particles.y_m[stopped]
    log_weight = particles.log_weight.copy()
    log_weight[stopped] = np.maximum(log_weight[stopped] + BLOCKED, LOWEST)
    return Particles(x, y, wrap_turns(particles.turns + turn), log_weight)


def _noisy(move: Move, deviates: Singles) -> tuple[Singles, Singles, Singles]:
    n0, n1, n2 = deviates
    r00, r10, r11, r20, r21, r22 = move.root
    return (
        move.mean[0] + r00 * n0,
        move.mean[1] + (r10 * n0 + r11 * n1),
        move.mean[2] + ((r20 * n0 + r21 * n1) + r22 * n2),
    )


def cells_at(raster: Raster, x_m: Singles, y_m: Singles) -> Integers:
    """Return the flat index of the cell of each place.

    Parameters
    ----------
    raster : Raster
        The cells.
    x_m, y_m : ndarray, shape (N,), float32
        Places.

    Returns
    -------
    ndarray, shape (N,), int32
        In [0, rows * columns).
    """
    column = _along(x_m, raster.west_m, raster.cells_per_m, raster.columns)
    cells = _along(y_m, raster.south_m, raster.cells_per_m, raster.rows)
    cells *= np.int32(raster.columns)
    cells += column
    return cells


def _along(places_m: Singles, first_m: np.float32, per_m: np.float32, count: int) -> Integers:
    """Return which of some cells in a row holds each place; beyond the ends it is the last one."""
    cells = places_m - first_m
    cells *= per_m
    np.maximum(cells, NOTHING, out=cells)
    np.minimum(cells, np.float32(count - 1), out=cells)
    return cells.astype(np.int32)


def clearances_m(walls: Walls, x_m: Singles, y_m: Singles) -> Singles:
    """Return how far one can go from each place.

    Parameters
    ----------
    walls : Walls
        What stops.
    x_m, y_m : ndarray, shape (N,), float32
        Places.

    Returns
    -------
    ndarray, shape (N,), float32
        Metres; negative where the place is not free.
    """
    found = walls.clearance.take(cells_at(walls.raster, x_m, y_m)).astype(np.float32)
    found -= ONE
    found *= walls.half_cell_m
    return found


def blocked(
    x_m: Singles, y_m: Singles, to_x_m: Singles, to_y_m: Singles, walls: Walls
) -> NDArray[np.bool_]:
    """Tell which straight moves meet a cell that is not free.

    A way no longer than the clearances of its ends together is free. Any other is looked at every
    half cell, from the clearance of its start to that of its end; so no more than a corner can be
    cut.

    Parameters
    ----------
    x_m, y_m, to_x_m, to_y_m : ndarray, shape (N,), float32
        Places before and after.
    walls : Walls
        What stops.

    Returns
    -------
    ndarray, shape (N,), bool
        True where the move is stopped.
    """
    right, up = to_x_m - x_m, to_y_m - y_m
    square = right * right + up * up
    before, after = clearances_m(walls, x_m, y_m), clearances_m(walls, to_x_m, to_y_m)
    reach = before + after
    stopped = after < 0
    near = np.flatnonzero(~stopped & ((before < 0) | (square > reach * reach)))
    length = np.sqrt(square[near])
    first, until = np.maximum(before[near], walls.half_cell_m), length - after[near]
    ways = np.stack([x_m[near], y_m[near], right[near], up[near], length, first, until])
    strides = _STRIDES
    while len(near):
        from_x, from_y, east, north, length, first, until = ways[:, :, None]
        gone = first + strides * walls.half_cell_m
        part = gone / length
        cells = cells_at(walls.raster, from_x + east * part, from_y + north * part)
        met = ((walls.clearance.take(cells) == 0) & (gone < until)).any(axis=1)
        stopped[near] = met
        strides = strides + np.float32(len(strides))
        goes_on = (first + strides[0] * walls.half_cell_m < until)[:, 0]
        on_the_way = np.flatnonzero(goes_on & ~met)
        near, ways = near.take(on_the_way), ways.take(on_the_way, 1)
    return stopped


class Reweighed(NamedTuple):
    """What a measurement has done.

    Parameters
    ----------
    particles : Particles
        With the best log-weight at 0.
    weights : ndarray, shape (N,), uint32
        At most 2**20.
    summed : WeightSums
        Of these weights.
    gain : int
        What the log-weights were lowered by so that the best is 0.
    before : int
        Sum of the weights before.
    """

    particles: Particles
    weights: Weights
    summed: WeightSums
    gain: int
    before: int


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
        The particles, and what their evidence can be computed from.
    """
    before = int(linear(particles.log_weight).sum(dtype=np.uint64))
    cells = cells_at(raster, particles.x_m, particles.y_m)
    gained = particles.log_weight + table.take(codes.take(cells))
    best = gained.max()
    weighed = particles._replace(log_weight=np.maximum(gained - best, LOWEST))
    return Reweighed(weighed, *weigh(weighed), int(best), before)


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
    weights = linear(particles.log_weight)
    return weights, sums(weights)


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
        How many to draw, in [1, 2**20].
    fresh : Particles
        Who joins them.

    Returns
    -------
    Particles
        The drawn ones in the same order, then the fresh ones, of equal weight; each is drawn as
        often as its share of `count` says, rounded down or up.
    """
    kept = chosen(particles, strides(weights, total, offset, count))
    return joined([kept, fresh]) if fresh.size else kept


def chosen(particles: Particles, ancestors: IntArray) -> Particles:
    """Return some particles with equal weight.

    Parameters
    ----------
    particles : Particles
        Before.
    ancestors : ndarray, shape (M,), intp
        Which ones.

    Returns
    -------
    Particles
        Of log-weight 0.
    """
    return Particles(
        particles.x_m.take(ancestors),
        particles.y_m.take(ancestors),
        particles.turns.take(ancestors),
        np.zeros(len(ancestors), np.int32),
    )
