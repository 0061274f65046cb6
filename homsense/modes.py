"""Modes: the classes of 0-dimensional persistence of the smoothed position histogram.

Cells enter by falling density and join the heaviest neighbor that is there; where two hills meet,
the younger one becomes a part of the elder when its saddle is high (ToMATo: Chazal, Guibas, Oudot,
Skraba 2013).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.exact import cosine, sine
from homsense.histogram import Histogram
from homsense.particles import Particles
from homsense.weights import Weights

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PROMINENCE = 0.5
NEIGHBORS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
RADIUS_BINS = 256
ACCURACY_SHARE = 0.68


class Mode(NamedTuple):
    """One hypothesis about the pose.

    Parameters
    ----------
    weight : float
        Probability mass, in (0, 1].
    x_m, y_m : float
        Mean position, metres.
    covariance : ndarray, shape (2, 2), float64
        Of the position within the mode, square metres.
    heading_rad : float
        Circular mean, radians.
    resultant : float
        Length of the mean direction: 1 when all headings agree, 0 when they cancel.
    accuracy_m : float
        Radius around the mean that holds 68 % of the mode, metres.
    """

    weight: float
    x_m: float
    y_m: float
    covariance: FloatArray
    heading_rad: float
    resultant: float
    accuracy_m: float


class Moments(NamedTuple):
    """Sums over the particles of each mode, relative to one corner.

    Parameters
    ----------
    sums : ndarray, shape (8, n_modes), float64
        Of w, w x, w y, w x x, w x y, w y y, w cos, w sin.
    radius_m : ndarray, shape (n_modes,), float64
        Distance of the farthest particle from the mean.
    near : ndarray, shape (n_modes, RADIUS_BINS), float64
        Weight by distance from the mean, in equal steps up to that radius.
    """

    sums: FloatArray
    radius_m: FloatArray
    near: FloatArray


def hills(shape: tuple[int, int], order: IntArray, smooth: IntArray) -> IntArray:
    """Assign each cell with mass to a mode.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns.
    order : ndarray, int64
        Flat indices of the cells with mass, heaviest first.
    smooth : ndarray, shape (rows * columns,), int64
        Mass of each cell.

    Returns
    -------
    ndarray, shape (len(order),), int64
        For each cell of `order`, the place in `order` of the peak of its mode.

    Examples
    --------
    >>> mass = np.array([4, 1, 3, 2, 3])
    >>> hills((1, 5), np.argsort(-mass, kind="stable"), mass).tolist()
    [0, 1, 1, 1, 0]
    """
    rows, columns = shape
    late = len(order)
    rank = np.full((rows + 2, columns + 2), late)
    inner = np.full(rows * columns, late)
    inner[order] = np.arange(late)
    rank[1:-1, 1:-1] = inner.reshape(rows, columns)
    row, column = np.divmod(order, columns)
    around = np.stack([rank[row + 1 + up, column + 1 + right] for up, right in NEIGHBORS], axis=1)
    uphill = np.minimum(around.min(axis=1, initial=late), np.arange(late))
    while True:
        farther = uphill[uphill]
        if np.array_equal(farther, uphill):
            break
        uphill = farther
    return _joined(uphill, around, smooth[order])


def _joined(uphill: IntArray, around: IntArray, mass: IntArray) -> IntArray:
    """Join hills at their saddles, the highest first."""
    entering, side = np.nonzero(around < np.arange(len(mass))[:, None])
    here, there = uphill[entering], uphill[around[entering, side]]
    saddles = here != there
    entering, here, there = entering[saddles], here[saddles], there[saddles]
    pairs = np.minimum(here, there) * len(mass) + np.maximum(here, there)
    first = np.sort(np.unique(pairs, return_index=True)[1])
    elder = np.arange(len(mass))
    for saddle, one, other in zip(
        mass[entering[first]].tolist(), here[first].tolist(), there[first].tolist(), strict=True
    ):
        low, high = _root(elder, one), _root(elder, other)
        low, high = min(low, high), max(low, high)
        if low != high and saddle > PROMINENCE * mass[high]:
            elder[high] = low
    peaks = np.unique(uphill)
    elder[peaks] = [_root(elder, peak) for peak in peaks.tolist()]
    return elder[uphill]


def _root(elder: IntArray, hill: int) -> int:
    while elder[hill] != hill:
        hill = int(elder[hill])
    return hill


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
        Number of the mode of each particle.
    n_modes : int
        How many there are.
    corner : ndarray, shape (2,), float64
        Where positions are counted from, metres.

    Returns
    -------
    Moments
        The sums.
    """
    x, y = particles.x_m - corner[0], particles.y_m - corner[1]
    w = weights.astype(np.float64)
    wx, wy = w * x, w * y
    terms = (
        w,
        wx,
        wy,
        wx * x,
        wx * y,
        wy * y,
        w * cosine(particles.turns),
        w * sine(particles.turns),
    )
    sums = np.stack([np.bincount(of_mode, term, n_modes) for term in terms]).astype(np.float64)
    mean_x, mean_y = _means(sums)
    right, up = x - mean_x[of_mode], y - mean_y[of_mode]
    distance = np.sqrt(right * right + up * up)
    radius = np.zeros(n_modes)
    np.maximum.at(radius, of_mode, distance)
    per_m = (RADIUS_BINS - 1) / np.maximum(radius, 1e-9)
    bins = (distance * per_m[of_mode]).astype(np.int64) + of_mode * RADIUS_BINS
    near = np.bincount(bins, w, n_modes * RADIUS_BINS).astype(np.float64)
    return Moments(sums, radius, near.reshape(n_modes, RADIUS_BINS))


def _means(sums: FloatArray) -> tuple[FloatArray, FloatArray]:
    mass = np.maximum(sums[0], 1.0)
    return sums[1] / mass, sums[2] / mass


def modes(found: Moments, corner: FloatArray) -> tuple[Mode, ...]:
    """Return the modes by falling weight.

    Parameters
    ----------
    found : Moments
        Sums for each.
    corner : ndarray, shape (2,), float64
        Where positions were counted from, metres.

    Returns
    -------
    tuple of Mode
        Those with mass.
    """
    mass = found.sums[0]
    total = mass.sum()
    x, y = _means(found.sums)
    _, _, _, xx, xy, yy, cos, sin = found.sums / np.maximum(mass, 1.0)
    reached = np.cumsum(found.near, axis=1)
    needed = (reached < ACCURACY_SHARE * mass[:, None]).sum(axis=1) + 1
    accuracy = found.radius_m * np.minimum(needed / (RADIUS_BINS - 1), 1.0)
    variance = np.stack([xx - x * x, xy - x * y, xy - x * y, yy - y * y], axis=1)
    variance[:, [0, 3]] = np.maximum(variance[:, [0, 3]], 0.0)
    order = np.argsort(-mass, kind="stable")
    order = order[mass[order] > 0.0]
    covariance = variance[order].reshape(-1, 2, 2)
    columns = (
        mass / total,
        x + corner[0],
        y + corner[1],
        np.arctan2(sin, cos),
        np.minimum(1.0, np.hypot(sin, cos)),
        accuracy,
    )
    rows = np.stack(columns, axis=1)[order].tolist()
    return tuple(
        Mode(weight, east, north, spread, heading, resultant, accuracy_m)
        for spread, (weight, east, north, heading, resultant, accuracy_m) in zip(
            covariance, rows, strict=True
        )
    )


def label(found: Histogram, of_cell: IntArray) -> tuple[IntArray, int]:
    """Return the number of the mode of each particle.

    Parameters
    ----------
    found : Histogram
        Cells of the particles.
    of_cell : ndarray, int64
        What `hills` gives for the cells with mass.

    Returns
    -------
    of_mode : ndarray, shape (N,), int64
        Numbers from 0.
    n_modes : int
        How many there are.
    """
    is_peak = np.zeros(len(of_cell), np.bool_)
    is_peak[of_cell] = True
    number = np.cumsum(is_peak) - 1
    by_cell = np.zeros(found.smooth.size, np.int64)
    by_cell[found.order] = number[of_cell]
    return by_cell[found.cells], int(number[-1]) + 1
