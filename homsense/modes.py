"""Modes: the classes of 0-dimensional persistence of the smoothed position histogram.

Cells enter by falling density and join the heaviest neighbor that is there; where two hills meet,
the younger one becomes a part of the elder when its saddle is high (ToMATo: Chazal, Guibas, Oudot,
Skraba 2013).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.exact import cosine, sine
from homsense.histogram import Histogram, heaviest_first
from homsense.particles import Particles
from homsense.weights import Weights

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_MODES = 16
PROMINENCE = 0.5
NEIGHBORS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
RADIUS_BINS = 256
ACCURACY_SHARE = 0.68
FARTHEST = math.sqrt(1.0 / (1.0 - ACCURACY_SHARE))
"""Root mean square distances within which that share lies at the least (Chebyshev)."""


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
    """Sums over the particles of each mode, relative to one corner; the last row is the rest.

    Parameters
    ----------
    sums : ndarray, shape (n_modes + 1, 8), float64
        Of w, w x, w y, w x x, w x y, w y y, w cos, w sin.
    accuracy_m : ndarray, shape (n_modes + 1,), float64
        Radius around the mean that holds 68 % of the mass.
    """

    sums: FloatArray
    accuracy_m: FloatArray


def hills(smooth: IntArray, order: IntArray) -> IntArray:
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

    Examples
    --------
    >>> mass = np.array([[0, 0, 0, 0, 0, 0, 0], [0, 4, 1, 3, 2, 3, 0], [0, 0, 0, 0, 0, 0, 0]])
    >>> hills(mass, heaviest_first(mass.ravel())).tolist()
    [0, 1, 1, 1, 0]
    """
    columns, flat = smooth.shape[1], smooth.ravel()
    late = len(order)
    rank = np.full(flat.size, late)
    rank[order] = np.arange(late)
    around = np.stack([rank.take(order + (up * columns + right)) for up, right in NEIGHBORS])
    uphill = np.minimum(around.min(axis=0, initial=late), np.arange(late))
    while True:
        farther = uphill[uphill]
        if np.array_equal(farther, uphill):
            break
        uphill = farther
    return _joined(uphill, around, flat[order])


def _joined(uphill: IntArray, around: IntArray, mass: IntArray) -> IntArray:
    """Join hills at their saddles, the highest first.

    A saddle too low for the younger of its hills is too low for their elders, which are higher.
    """
    own = np.arange(len(mass))
    beyond = np.append(uphill, 0).take(around)
    saddles = np.flatnonzero((around < own) & (beyond != uphill))
    entering = saddles % len(mass)
    here, there = uphill[entering], beyond.ravel()[saddles]
    low, high = np.minimum(here, there), np.maximum(here, there)
    enough = np.flatnonzero(mass[entering] > PROMINENCE * mass[high])
    enough = enough[np.argsort(entering[enough], kind="stable")]
    entering, low, high = entering[enough], low[enough], high[enough]
    first = np.sort(np.unique(low * len(mass) + high, return_index=True)[1])
    peaks = np.flatnonzero(uphill == own).tolist()
    elder = dict(zip(peaks, peaks, strict=True))
    for saddle, one, other in zip(
        mass[entering[first]].tolist(), low[first].tolist(), high[first].tolist(), strict=True
    ):
        old, young = sorted((_root(elder, one), _root(elder, other)))
        if old != young and saddle > PROMINENCE * mass[young]:
            elder[young] = old
    own[peaks] = [_root(elder, peak) for peak in peaks]
    return own[uphill]


def _root(elder: dict[int, int], hill: int) -> int:
    while elder[hill] != hill:
        hill = elder[hill]
    return hill


def label(found: Histogram, weights: Weights, of_cell: IntArray) -> tuple[IntArray, int]:
    """Return the number of the mode of each particle.

    Parameters
    ----------
    found : Histogram
        Cells of the particles.
    weights : ndarray, shape (N,), uint32
        How heavy they are.
    of_cell : ndarray, int64
        What `hills` gives for the cells with mass.

    Returns
    -------
    of_mode : ndarray, shape (N,), int64
        Numbers from 0, the heaviest mode first; that of the rest is `n_modes`.
    n_modes : int
        How many modes there are, at most `MAX_MODES`.
    """
    nowhere = len(of_cell)
    by_cell = np.full(found.smooth.size, nowhere)
    by_cell[found.order] = of_cell
    peaks = by_cell[found.cells]
    mass = np.bincount(peaks, weights, nowhere + 1).astype(np.int64)
    heaviest = heaviest_first(mass[:-1])[:MAX_MODES]
    number = np.full(nowhere + 1, len(heaviest))
    number[heaviest] = np.arange(len(heaviest))
    return number[peaks], len(heaviest)


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
        Number of the mode of each particle; `n_modes` for the rest.
    n_modes : int
        How many there are.
    corner : ndarray, shape (2,), float64
        Where positions are counted from, metres.

    Returns
    -------
    Moments
        The sums.
    """
    groups = n_modes + 1
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
    sums: FloatArray = np.stack([np.bincount(of_mode, term, groups) for term in terms], axis=1)
    mass = sums[:, 0]
    mean_x, mean_y, mean_xx, _, mean_yy = (sums[:, 1:6] / np.maximum(mass, 1.0)[:, None]).T
    square = np.maximum((mean_xx - mean_x * mean_x) + (mean_yy - mean_y * mean_y), 0.0)
    reach = FARTHEST * np.sqrt(square)
    right, up = x - mean_x[of_mode], y - mean_y[of_mode]
    per_m = (RADIUS_BINS - 1) / np.maximum(reach, 1e-9)
    bins = np.minimum(np.sqrt(right * right + up * up) * per_m[of_mode], RADIUS_BINS - 1)
    places = bins.astype(np.int64) + of_mode * RADIUS_BINS
    near = np.bincount(places, w, groups * RADIUS_BINS).reshape(groups, RADIUS_BINS)
    short = near.cumsum(axis=1) < ACCURACY_SHARE * mass[:, None]
    needed = short.sum(axis=1) + 1
    return Moments(sums, reach * np.minimum(needed / (RADIUS_BINS - 1), 1.0))


def modes(found: Moments, corner: tuple[float, float]) -> tuple[Mode, ...]:
    """Return the modes by falling weight.

    Parameters
    ----------
    found : Moments
        Sums for each.
    corner : tuple of float
        Where positions were counted from, metres.

    Returns
    -------
    tuple of Mode
        All but the rest.
    """
    mass = found.sums[:-1, 0]
    x, y, xx, xy, yy, cos, sin = (found.sums[:-1, 1:] / mass[:, None]).T
    covariance = np.empty((len(mass), 2, 2))
    covariance[:, 0, 0] = np.maximum(xx - x * x, 0.0)
    covariance[:, 1, 1] = np.maximum(yy - y * y, 0.0)
    covariance[:, 0, 1] = covariance[:, 1, 0] = xy - x * y
    weight, (west_m, south_m) = mass / found.sums[:, 0].sum(), corner
    heading_rad = map(math.atan2, sin.tolist(), cos.tolist())
    resultant = np.minimum(np.sqrt(sin * sin + cos * cos), 1.0)
    middle = (x + west_m).tolist(), (y + south_m).tolist()
    spread = resultant.tolist(), found.accuracy_m[:-1].tolist()
    return tuple(map(Mode, weight.tolist(), *middle, covariance, heading_rad, *spread))
