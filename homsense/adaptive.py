"""As many particles as the spread of the posterior asks for (Fox: KLD sampling, 2003)."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError, check_positive
from homsense.particles import Particles
from homsense.weights import Weights

MAX_PARTICLES = 1_000_000


@dataclass(frozen=True, slots=True)
class KldSampling:
    """Bound the Kullback-Leibler distance between the particles and what they sample.

    Parameters
    ----------
    least, most : int, default 1000 and 16000
        Bounds of the number of particles.
    error : float, default 0.05
        Largest distance, nats.
    quantile : float, default 0.99
        With which probability the distance stays below it; a probability, not a z-score.
    cell_m : float, default 8.0
        Side of a bin, metres.
    cell_rad : float, default pi / 12
        Width of a bin, radians.

    Raises
    ------
    InvalidConfigurationError
        If a parameter is out of range.
    """

    least: int = 1000
    most: int = 16_000
    error: float = 0.05
    quantile: float = 0.99
    cell_m: float = 8.0
    cell_rad: float = math.pi / 12.0

    def __post_init__(self) -> None:
        if not 1 <= self.least <= self.most <= MAX_PARTICLES:
            message = f"1 <= least <= most <= {MAX_PARTICLES} must hold"
            raise InvalidConfigurationError(message, "adaptive.least")
        for name in ("error", "cell_m", "cell_rad"):
            check_positive(f"adaptive.{name}", getattr(self, name))
        if not 0.5 <= self.quantile < 1.0:  # noqa: PLR2004 - a probability
            message = f"quantile must be in [0.5, 1), not {self.quantile}"
            raise InvalidConfigurationError(message, "adaptive.quantile")

    def count(self, particles: Particles, weights: Weights) -> int:
        """Return how many particles to draw next.

        Parameters
        ----------
        particles : Particles
            Now.
        weights : ndarray, shape (N,), uint32
            Those without weight do not count.

        Returns
        -------
        int
            In [least, most].
        """
        alive = weights > 0
        bins = [
            np.floor(array[alive] * np.float32(per)).astype(np.int64)
            for array, per in (
                (particles.x_m, 1.0 / self.cell_m),
                (particles.y_m, 1.0 / self.cell_m),
                (particles.turns, 2.0 * math.pi / self.cell_rad),
            )
        ]
        occupied = _distinct(bins)
        return min(max(self.needed(occupied), self.least), self.most)

    def needed(self, occupied: int) -> int:
        """Return the particles that some occupied bins ask for.

        Parameters
        ----------
        occupied : int
            Bins.

        Returns
        -------
        int
            By the chi-square approximation of Wilson and Hilferty.

        Examples
        --------
        >>> KldSampling(quantile=0.99).needed(50)
        750
        """
        if occupied < 2:  # noqa: PLR2004 - one bin has nothing to compare
            return 1
        free = occupied - 1
        spread = 2.0 / (9.0 * free)
        root = 1.0 - spread + math.sqrt(spread) * NormalDist().inv_cdf(self.quantile)
        return math.ceil(free / (2.0 * self.error) * root**3)


def _distinct(bins: list[NDArray[np.int64]]) -> int:
    combined = np.zeros(len(bins[0]), np.int64)
    for axis in bins:
        low = axis.min()
        combined = combined * (axis.max() - low + 1) + (axis - low)
    return len(np.unique(combined))
