"""The modes of the position histogram, compiled; see `homsense.modes`.

Arrays are made one by one: rows of one array are strided to numba, and loops over them no vector
instructions.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import modes
from homsense.compiled.exact import cosine, sine
from homsense.compiled.jit import allocating, apart, inlined
from homsense.particles import Particles

Array = NDArray[Any]

_PROMINENCE, _SHARE = modes.PROMINENCE, modes.ACCURACY_SHARE
_BINS, _MOST, _FARTHEST = modes.RADIUS_BINS, modes.MAX_MODES, modes.FARTHEST
_NEIGHBORS = modes.NEIGHBORS


@allocating
def hills(smooth: Array, order: Array) -> Array:
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
        For each cell of `order`, the place in `order` of the peak of its mode.
    """
    columns, late = smooth.shape[1], np.int32(len(order))
    rank, first = np.full(smooth.size, late, np.int32), np.empty(smooth.size, np.int32)
    peak, reach = np.empty(smooth.size, np.int32), np.empty(smooth.size, np.int32)
    meets = np.empty(smooth.size, np.int32)  # of these, only what is of cells with mass counts
    hill, elder = np.empty(len(order), np.int64), np.arange(len(order))
    _rank(order, rank)
    _heaviest_near(columns, rank, first)
    _climb(smooth.ravel(), order, first, hill, peak, reach)
    _meet(columns, rank, peak, reach, meets)
    steps = np.array([up * columns + right for up, right in _NEIGHBORS])
    _join(smooth.ravel(), order, peak, meets, steps, elder)
    _settle(elder, hill)
    return hill


@apart
def _rank(order: Array, rank: Array) -> None:
    for place in range(len(order)):
        rank[np.uint64(order[place])] = place


@apart
def _heaviest_near(columns: int, rank: Array, first: Array) -> None:
    """Find the lowest rank of each cell and its eight neighbors."""
    wide, one = np.uint64(columns), np.uint64(1)
    for shifted in range(len(rank) - 2 * columns - 2):
        cell = np.uint64(shifted) + wide + one
        south, north = cell - wide, cell + wide
        low = min(rank[south - one], rank[south], rank[south + one])
        high = min(rank[north - one], rank[north], rank[north + one])
        first[cell] = min(low, high, rank[cell - one], rank[cell], rank[cell + one])


@apart
def _climb(
    smooth: Array, order: Array, first: Array, hill: Array, peak: Array, reach: Array
) -> None:
    """Send each cell to the peak of its heaviest neighbor, which has been sent there before.

    A hill of less than half the height of another cannot be its elder: the first cell in order
    that is too low to be a saddle of a hill goes with each of its cells.
    """
    low = 0
    for place in range(len(order)):
        cell = np.uint64(order[place])
        uphill = np.uint64(first[cell])
        if uphill == place:
            while low < len(order) and _saddles(smooth[order[low]], smooth[cell]):
                low += 1
            peak[cell], reach[cell] = place, low
        else:
            peak[cell] = peak[order[uphill]]
            reach[cell] = reach[order[uphill]]
        hill[place] = peak[cell]


@inlined
def _saddles(mass: Any, peak_mass: Any) -> bool:
    """Tell whether a hill joins its elder at a cell of some mass."""
    return bool(mass > _PROMINENCE * peak_mass)


@apart
def _meet(columns: int, rank: Array, peak: Array, reach: Array, meets: Array) -> None:
    """Mark at each cell the neighbors, in their order, across which two hills may join."""
    wide, one = np.uint64(columns), np.uint64(1)
    for shifted in range(len(rank) - 2 * columns - 2):
        cell = np.uint64(shifted) + wide + one
        south, north = cell - wide, cell + wide
        meets[cell] = (
            _may_join(rank, peak, reach, cell, south - one)
            | _may_join(rank, peak, reach, cell, south) << 1
            | _may_join(rank, peak, reach, cell, south + one) << 2
            | _may_join(rank, peak, reach, cell, cell - one) << 3
            | _may_join(rank, peak, reach, cell, cell + one) << 4
            | _may_join(rank, peak, reach, cell, north - one) << 5
            | _may_join(rank, peak, reach, cell, north) << 6
            | _may_join(rank, peak, reach, cell, north + one) << 7
        )


@inlined
def _may_join(rank: Array, peak: Array, reach: Array, cell: Any, near: Any) -> Any:
    high = max(reach[cell], reach[near]) > rank[cell]
    return np.int32((rank[near] < rank[cell]) & (peak[near] != peak[cell]) & high)


@apart
def _join(
    smooth: Array, order: Array, peak: Array, meets: Array, steps: Array, elder: Array
) -> None:
    """Join hills at their saddles, the highest first."""
    for place in range(len(order)):
        cell = order[place]
        sides = meets[np.uint64(cell)]
        if not sides:
            continue
        for side in range(len(steps)):
            if sides >> side & 1:
                near = np.uint64(cell + steps[side])
                low, high = _root(elder, peak[np.uint64(cell)]), _root(elder, peak[near])
                low, high = min(low, high), max(low, high)
                if low != high and _saddles(smooth[cell], smooth[order[high]]):
                    elder[high] = low


@apart
def _settle(elder: Array, hill: Array) -> None:
    """Send each cell to the eldest; elders come first in order."""
    for place in range(len(hill)):
        elder[place] = elder[np.uint64(elder[place])]
        hill[place] = elder[np.uint64(hill[place])]


@inlined
def _root(elder: Array, hill: int) -> int:
    while elder[hill] != hill:
        hill = elder[hill]
    return hill


@allocating
def label(
    cells: Array, size: int, order: Array, weights: Array, of_cell: Array
) -> tuple[Array, int]:
    """Return the number of the mode of each particle.

    Parameters
    ----------
    cells : ndarray, shape (N,), int64
        Cell of each particle.
    size : int
        Number of cells.
    order : ndarray, int64
        Cells with mass, heaviest first.
    weights : ndarray, shape (N,), uint32
        How heavy the particles are.
    of_cell : ndarray, int64
        What `hills` gives.

    Returns
    -------
    of_mode : ndarray, shape (N,), int64
        Numbers from 0, the heaviest mode first; that of the rest is `n_modes`.
    n_modes : int
        How many modes there are.
    """
    nowhere = len(of_cell)
    by_cell, of_mode = np.full(size, nowhere), np.empty(len(cells), np.int64)
    mass = np.zeros(nowhere + 1, np.int64)
    _gather(cells, order, weights, of_cell, by_cell, of_mode, mass)
    heaviest = np.empty(_MOST + 1, np.int64)
    heaviest = heaviest[: _find_heaviest(mass[:-1], heaviest)]
    number = np.full(nowhere + 1, len(heaviest))
    number[heaviest] = np.arange(len(heaviest))
    _translate(number, of_mode)
    return of_mode, len(heaviest)


@apart
def _find_heaviest(mass: Array, found: Array) -> int:
    """Write the heaviest of those with mass, and one place behind them; return how many."""
    count = 0
    for peak in range(len(mass)):
        if not mass[peak] or (count == len(found) - 1 and mass[peak] <= mass[found[count - 1]]):
            continue
        place = count
        while place and mass[found[place - 1]] < mass[peak]:
            found[place] = found[place - 1]
            place -= 1
        found[place] = peak
        count = min(count + 1, len(found) - 1)
    return count


@apart
def _gather(
    cells: Array,
    order: Array,
    weights: Array,
    of_cell: Array,
    by_cell: Array,
    peaks: Array,
    mass: Array,
) -> None:
    """Find the peak of each particle, and the mass of each peak."""
    for place in range(len(order)):
        by_cell[np.uint64(order[place])] = of_cell[place]
    for index in range(len(cells)):
        peaks[index] = by_cell[np.uint64(cells[index])]
        mass[np.uint64(peaks[index])] += np.int64(weights[index])


@apart
def _translate(number: Array, words: Array) -> None:
    for index in range(len(words)):
        words[index] = number[np.uint64(words[index])]


@allocating
def moments(
    particles: Particles, weights: Array, of_mode: Array, n_modes: int, corner: Array
) -> tuple[Array, Array]:
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
    tuple of ndarray
        As in `homsense.modes.Moments`.
    """
    sums, means = np.zeros((n_modes + 1, 8)), np.empty((n_modes + 1, 2))
    reach, near = np.empty(n_modes + 1), np.zeros((n_modes + 1, _BINS))
    cos, sin = np.empty(len(weights), np.float32), np.empty(len(weights), np.float32)
    _directions(particles.turns, cos, sin)
    _add(particles, weights, of_mode, corner, cos, sin, sums)
    for mode in range(n_modes + 1):
        reach[mode] = _reach(sums[mode], means[mode])
    per_m = (_BINS - 1) / np.maximum(reach, 1e-9)
    _spread(particles, weights, of_mode, corner, means, per_m, near)
    for mode in range(n_modes + 1):
        reach[mode] *= min(_needed(near[mode], sums[mode, 0]) / (_BINS - 1), 1.0)
    return sums, reach


@apart
def _directions(turns: Array, cos: Array, sin: Array) -> None:
    for index in range(len(turns)):
        cos[index], sin[index] = cosine(turns[index]), sine(turns[index])


@apart
def _add(
    particles: Particles,
    weights: Array,
    of_mode: Array,
    corner: Array,
    cos: Array,
    sin: Array,
    sums: Array,
) -> None:
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
        sums[mode, 6] += w * np.float64(cos[index])
        sums[mode, 7] += w * np.float64(sin[index])


@apart
def _reach(sums: Array, mean: Array) -> float:
    """Write the mean place of a mode; return how far from it its accuracy can reach."""
    mass = max(sums[0], 1.0)
    mean[0], mean[1] = sums[1] / mass, sums[2] / mass
    square = (sums[3] / mass - mean[0] * mean[0]) + (sums[5] / mass - mean[1] * mean[1])
    return float(_FARTHEST * np.sqrt(max(square, 0.0)))


@apart
def _spread(
    particles: Particles,
    weights: Array,
    of_mode: Array,
    corner: Array,
    means: Array,
    per_m: Array,
    near: Array,
) -> None:
    for index in range(len(weights)):
        mode = np.uint64(of_mode[index])
        right = np.float64(particles.x_m[index]) - corner[0] - means[mode, 0]
        up = np.float64(particles.y_m[index]) - corner[1] - means[mode, 1]
        ring = np.sqrt(right * right + up * up) * per_m[mode]
        near[mode, np.uint64(min(ring, _BINS - 1.0))] += np.float64(weights[index])


@apart
def _needed(near: Array, mass: Any) -> int:
    """Count the bins that hold the share of a mode by which its accuracy goes."""
    reached, bins = 0.0, 1
    for index in range(_BINS):
        reached += near[index]
        bins += reached < _SHARE * mass
    return bins
