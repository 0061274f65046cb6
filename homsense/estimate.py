"""The pose distribution: modes, regions and density of a weighted set of particles.

Modes are the classes of 0-dimensional persistence of the smoothed position histogram: cells enter
by falling density, components merge at saddles, and a component that dies with too little
prominence joins the elder one.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from homsense.resample import effective_sample_size

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

PROMINENCE = 0.5
TRACKING_WEIGHT = 0.5
TRACKING_ACCURACY_M = 50.0
AMBIGUOUS_MODES = 4
AMBIGUOUS_WEIGHT = 0.8
_KERNEL = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
_NEIGHBORS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, slots=True)
class Mode:
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


@dataclass(frozen=True)
class PoseDistribution:
    """What is known about the pose: a weighted set of particles and what can be said of it.

    Parameters
    ----------
    poses : ndarray, shape (N, 3), float64
        Particles: x m, y m, heading rad.
    weights : ndarray, shape (N,), float64
        Normalized.
    cell_m : float, default 5.0
        Side of a histogram cell, metres.
    """

    poses: FloatArray
    weights: FloatArray
    cell_m: float = 5.0

    @property
    def ess(self) -> float:
        """Effective sample size, in [1, N]."""
        return effective_sample_size(self.weights)

    @property
    def mean(self) -> FloatArray:
        """Mean position of all particles, shape (2,), metres; between modes when there are two."""
        mean: FloatArray = self.weights @ self.poses[:, :2]
        return mean

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the position over all particles, shape (2, 2), square metres."""
        return _covariance(self.poses[:, :2], self.weights)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Hypotheses by falling weight; at least one."""
        labels = self._labels[self._cells]
        masses = np.bincount(labels, weights=self.weights)
        order = np.argsort(-masses, kind="stable")
        return tuple(
            _mode(self.poses[labels == label], self.weights[labels == label])
            for label in order
            if masses[label] > 0.0
        )

    @property
    def status(self) -> Literal["diffuse", "ambiguous", "tracking"]:
        """Whether one mode holds most of the mass, a few hold it, or nothing is known yet."""
        if self.modes[0].weight >= TRACKING_WEIGHT:
            return "tracking" if self.modes[0].accuracy_m <= TRACKING_ACCURACY_M else "diffuse"
        few = sum(mode.weight for mode in self.modes[:AMBIGUOUS_MODES])
        return "ambiguous" if few >= AMBIGUOUS_WEIGHT else "diffuse"

    @cached_property
    def density(self) -> FloatArray:
        """Smoothed probability mass of each cell, shape (rows, columns)."""
        rows, columns = self._shape
        mass = np.bincount(self._cells, weights=self.weights, minlength=rows * columns)
        smooth = mass.reshape(rows, columns)
        for axis in (0, 1):
            smooth = ndimage.convolve1d(smooth, _KERNEL, axis=axis, mode="constant")
        return np.asarray(smooth / smooth.sum())

    @property
    def corner(self) -> tuple[float, float]:
        """South-west corner of the density's first cell, metres."""
        west, south = (np.floor(self.poses[:, :2].min(axis=0) / self.cell_m) - 2.0) * self.cell_m
        return float(west), float(south)

    def region(self, level: float) -> NDArray[np.bool_]:
        """Return the highest-density region: the fewest cells that hold a share of the mass.

        Parameters
        ----------
        level : float
            Share, in (0, 1).

        Returns
        -------
        ndarray, shape (rows, columns), bool
            Cells of the region.
        """
        flat = self.density.ravel()
        order = np.argsort(-flat, kind="stable")
        needed = int(np.searchsorted(np.cumsum(flat[order]), level)) + 1
        inside = np.zeros(flat.size, dtype=bool)
        inside[order[:needed]] = True
        return inside.reshape(self.density.shape)

    def region_area_m2(self, level: float) -> float:
        """Return the area of a highest-density region.

        Parameters
        ----------
        level : float
            Share of the mass, in (0, 1).

        Returns
        -------
        float
            Square metres.
        """
        return float(self.region(level).sum()) * self.cell_m**2

    def thinned(self, count: int) -> IntArray:
        """Return indices of particles that represent all of them with equal weight.

        Parameters
        ----------
        count : int
            How many, at least 1.

        Returns
        -------
        ndarray, shape (count,), intp
            Systematic sample; a heavy particle may occur more than once.
        """
        strides = (np.arange(count) + 0.5) / count
        reached = np.searchsorted(np.cumsum(self.weights), strides)
        return np.minimum(reached, len(self.weights) - 1)

    @cached_property
    def _shape(self) -> tuple[int, int]:
        west, south = self.corner
        east, north = self.poses[:, :2].max(axis=0)
        columns, rows = (
            int((east - west) / self.cell_m) + 3,
            int((north - south) / self.cell_m) + 3,
        )
        return rows, columns

    @cached_property
    def _cells(self) -> IntArray:
        column, row = np.floor((self.poses[:, :2] - self.corner) / self.cell_m).astype(np.intp).T
        return np.asarray(row * self._shape[1] + column)

    @cached_property
    def _labels(self) -> IntArray:
        return persistent_labels(self.density).ravel()


def persistent_labels(density: FloatArray, prominence: float = PROMINENCE) -> IntArray:
    """Assign each cell to a mode by 0-dimensional persistence of the superlevel sets.

    Parameters
    ----------
    density : ndarray, shape (rows, columns), float64
        Non-negative.
    prominence : float, default 0.5
        A peak is a mode of its own when its saddle is below this share of its height.

    Returns
    -------
    ndarray, shape (rows, columns), intp
        The flat index of the peak of each cell's mode; 0 where the density is zero.

    Examples
    --------
    >>> persistent_labels(np.array([[4.0, 1.0, 3.0, 2.9, 3.1]])).tolist()
    [[0, 0, 4, 4, 4]]
    """
    rows, columns = density.shape
    flat = density.ravel()
    order = np.argsort(-flat, kind="stable")
    parent: dict[int, int] = {}

    def root(cell: int) -> int:
        while parent[cell] != cell:
            parent[cell] = parent[parent[cell]]
            cell = parent[cell]
        return cell

    for cell in order[: np.count_nonzero(flat)].tolist():
        row, column = divmod(cell, columns)
        around = {
            root(near)
            for up, right in _NEIGHBORS
            if 0 <= row + up < rows and 0 <= column + right < columns
            if (near := cell + up * columns + right) in parent
        }
        peaks = sorted(around, key=lambda peak: (-flat[peak], peak))
        parent[cell] = peaks[0] if peaks else cell
        for peak in peaks[1:]:
            if flat[cell] > prominence * flat[peak]:
                parent[peak] = peaks[0]
    labels = np.zeros(flat.size, dtype=np.intp)
    for cell in parent:
        labels[cell] = root(cell)
    return labels.reshape(rows, columns)


def _covariance(places: FloatArray, weights: FloatArray) -> FloatArray:
    share = weights / weights.sum()
    apart = places - share @ places
    covariance: FloatArray = (apart * share[:, None]).T @ apart
    return covariance


def _mode(poses: FloatArray, weights: FloatArray) -> Mode:
    share = weights / weights.sum()
    x, y = share @ poses[:, :2]
    direction = complex(share @ np.exp(1j * poses[:, 2]))
    distance = np.hypot(poses[:, 0] - x, poses[:, 1] - y)
    order = np.argsort(distance)
    reached = int(np.searchsorted(np.cumsum(share[order]), 0.68))
    return Mode(
        weight=float(weights.sum()),
        x_m=float(x),
        y_m=float(y),
        covariance=_covariance(poses[:, :2], weights),
        heading_rad=float(np.angle(direction)),
        resultant=min(1.0, abs(direction)),
        accuracy_m=float(distance[order[min(reached, len(order) - 1)]]),
    )
