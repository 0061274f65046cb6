"""The pose distribution: modes, regions and density of a weighted set of particles."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from homsense.backend import Backend, fastest
from homsense.exact import wrap_turns
from homsense.histogram import Histogram, fitting_cell_m
from homsense.modes import Mode, modes
from homsense.particles import Particles
from homsense.recovery import Doubt
from homsense.weights import Weights, WeightSums, units

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TRACKING_WEIGHT = 0.5
TRACKING_ACCURACY_M = 50.0
AMBIGUOUS_MODES = 4
AMBIGUOUS_WEIGHT = 0.8
SUSPECT_P = 0.5


@dataclass(frozen=True)
class PoseDistribution:
    """What is known about the pose: a weighted set of particles and what can be said of it.

    Parameters
    ----------
    particles : Particles
        Pose hypotheses; the best log-weight is 0.
    cell_m : float, default 5.0
        Side of a histogram cell, and standard deviation of the kernel that smooths it, metres;
        doubled where there would be too many cells.
    backend : Backend, optional
        What runs the sums.
    doubt : Doubt, optional
        What the measurements say about the particles as a whole.
    """

    particles: Particles
    cell_m: float = 5.0
    backend: Backend = field(default_factory=fastest)
    doubt: Doubt = field(default_factory=Doubt)

    @classmethod
    def of(cls, poses: FloatArray, weights: FloatArray, cell_m: float = 5.0) -> Self:
        """Return the distribution of some weighted poses.

        Parameters
        ----------
        poses : ndarray, shape (N, 3), float64
            x m, y m, heading rad.
        weights : ndarray, shape (N,), float64
            Not negative, one of them positive.
        cell_m : float, default 5.0
            Side of a histogram cell, metres.

        Returns
        -------
        PoseDistribution
            Weights are kept to a millionth of the largest.
        """
        share = np.maximum(weights / weights.max(), 2.0**-100)
        x, y, heading = np.asarray(poses, np.float32).T
        turns = heading / np.float32(2.0 * np.pi)
        particles = Particles(
            np.ascontiguousarray(x),
            np.ascontiguousarray(y),
            wrap_turns(turns),
            units(np.log2(share)),
        )
        return cls(particles, cell_m)

    @property
    def poses(self) -> FloatArray:
        """Particles, shape (N, 3): x m, y m, heading rad."""
        return self.particles.poses

    @cached_property
    def weights(self) -> FloatArray:
        """Their weights, shape (N,), which sum to 1."""
        weights, sums = self._weighed
        return weights / sums.total

    @property
    def ess(self) -> float:
        """Effective sample size, in [1, N]."""
        return self._weighed[1].ess

    @property
    def mean(self) -> FloatArray:
        """Mean position of all particles, shape (2,), metres; between modes when there are two."""
        mean: FloatArray = self.weights @ self.poses[:, :2]
        return mean

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the position over all particles, shape (2, 2), square metres."""
        apart = self.poses[:, :2] - self.mean
        covariance: FloatArray = (apart * self.weights[:, None]).T @ apart
        return covariance

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Hypotheses by falling weight: at least one, at most `homsense.modes.MAX_MODES`."""
        found, weights = self.histogram, self._weighed[0]
        of_cell = self.backend.hills(found.smooth, found.order)
        of_mode, n_modes = self.backend.label(found, weights, of_cell)
        corner = np.array(found.corner)
        sums = self.backend.moments(self.particles, weights, of_mode, n_modes, corner)
        return modes(sums, found.corner)

    @property
    def status(self) -> Literal["diffuse", "ambiguous", "tracking", "suspect"]:
        """Whether one mode holds most of the mass, a few do, nothing is known, or it is lost."""
        if self.doubt.relocation_p >= SUSPECT_P:
            return "suspect"
        if self.modes[0].weight >= TRACKING_WEIGHT:
            return "tracking" if self.modes[0].accuracy_m <= TRACKING_ACCURACY_M else "diffuse"
        few = sum(mode.weight for mode in self.modes[:AMBIGUOUS_MODES])
        return "ambiguous" if few >= AMBIGUOUS_WEIGHT else "diffuse"

    @cached_property
    def histogram(self) -> Histogram:
        """Mass by cell."""
        cell_m = fitting_cell_m(self.particles, self.cell_m)
        return self.backend.histogram(self.particles, self._weighed[0], cell_m)

    @property
    def density(self) -> FloatArray:
        """Smoothed probability mass of each cell, shape (rows, columns)."""
        return self.histogram.density

    @property
    def corner(self) -> tuple[float, float]:
        """South-west corner of the density's first cell, metres."""
        return self.histogram.corner

    def region(self, level: float) -> BoolArray:
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
        return self.histogram.region(level)

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
        return self.histogram.needed(level) * self.histogram.cell_m**2

    def holds(self, x_m: float, y_m: float, level: float) -> bool:
        """Tell whether a place lies in a highest-density region.

        Parameters
        ----------
        x_m, y_m : float
            The place, metres.
        level : float
            Share of the mass, in (0, 1).

        Returns
        -------
        bool
            True within the region.
        """
        found = self.histogram
        column = int(np.floor(x_m / found.cell_m)) - found.column
        row = int(np.floor(y_m / found.cell_m)) - found.row
        rows, columns = found.smooth.shape
        if not (0 <= row < rows and 0 <= column < columns):
            return False
        return bool(self.region(level)[row, column])

    def thinned(self, count: int) -> IntArray:
        """Return indices of particles that represent all of them with equal weight.

        Parameters
        ----------
        count : int
            How many, at least 1.

        Returns
        -------
        ndarray, shape (count,), int64
            Systematic sample; a heavy particle may occur more than once.
        """
        weights, sums = self._weighed
        places = np.arange(count) * sums.total + sums.total // 2
        reached = np.cumsum(weights, dtype=np.int64) * count
        return np.searchsorted(reached, places, side="right")

    @cached_property
    def _weighed(self) -> tuple[Weights, WeightSums]:
        return self.backend.weigh(self.particles)
