"""The error of the homological sensor.

It is a random field over space, not fresh noise at each scan: devices that stand close together
err alike. A measurement taken after a short way repeats the one before, so its likelihood is
raised to ``way / correlation_m``, at most 1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError
from homsense.exact import exp, log2

FloatArray = NDArray[np.float64]

LEAST_SPREAD = 0.5
_NO_MATCH, _LEAST = 1e3, 1e-300
_NOTHING_BITS = -1e3


class Noise(Protocol):
    """What the localizer asks of an error model."""

    @property
    def correlation_m(self) -> float:
        """Way after which the error is new, metres."""
        ...

    def n_levels(self, n_fields: int) -> int:
        """Return how many counts a measurement has when places are known by so many numbers."""
        ...

    def bits(self, counts: Sequence[float], expected: FloatArray) -> FloatArray:
        """Return the binary logarithm of the likelihood for each row of `expected`, at most 0."""
        ...


@dataclass(frozen=True, slots=True)
class CountNoise:
    """The same error everywhere: a floored Gaussian for each neighborhood, near times far.

    Parameters
    ----------
    sigma : float, default 1.5
        Standard deviation of a count, inflated, in holes.
    floor : float, default 0.02
        Share of measurements that say nothing, in [0, 1).
    correlation_m : float, default 150.0
        Way after which the error is new, metres.

    Raises
    ------
    InvalidConfigurationError
        If a parameter is out of range.
    """

    sigma: float = 1.5
    floor: float = 0.02
    correlation_m: float = 150.0

    def __post_init__(self) -> None:
        _check_positive("sigma", self.sigma)
        if not 0.0 <= self.floor < 1.0:
            message = f"floor must be in [0, 1), not {self.floor}"
            raise InvalidConfigurationError(message, "floor")
        _check_positive("correlation_m", self.correlation_m)

    def n_levels(self, n_fields: int) -> int:
        """Return how many counts a measurement has.

        Parameters
        ----------
        n_fields : int
            Numbers that a place is known by: expected counts.

        Returns
        -------
        int
            As many.
        """
        return n_fields

    def bits(self, counts: Sequence[float], expected: FloatArray) -> FloatArray:
        """Return how well each place explains a measurement.

        Parameters
        ----------
        counts : sequence of float
            Measured, one for each neighborhood.
        expected : ndarray, shape (N, n_levels), float64
            Expected counts; not a number where nobody can be.

        Returns
        -------
        ndarray, shape (N,), float64
            Binary logarithms, at most 0.
        """
        total = np.zeros(len(expected))
        for level, count in enumerate(counts):
            apart = (expected[:, level] - float(count)) / self.sigma
            match = exp(-0.5 * np.square(np.nan_to_num(apart, nan=_NO_MATCH)))
            total += log2(np.maximum(self.floor + (1.0 - self.floor) * match, _LEAST))
        return total


@dataclass(frozen=True, slots=True)
class FieldNoise:
    """An error whose spread is known for each place: Student's t over all neighborhoods.

    Parameters
    ----------
    correlation : tuple of tuple of float
        Between the errors of two neighborhoods at a place; positive definite.
    gains, offsets : tuple of float
        A count of a neighborhood is measured as ``offset + gain * count``.
    freedom : float
        Degrees of freedom, positive.
    correlation_m : float
        Way after which the error is new, metres.

    Raises
    ------
    InvalidConfigurationError
        If a parameter is out of range.

    Examples
    --------
    >>> noise = FieldNoise(((1.0, 0.5), (0.5, 1.0)), (1.0, 1.0), (0.0, 0.0), 20.0, 80.0)
    >>> expected_then_spread = np.array([[3.0, 7.0, 1.0, 2.0], [5.0, 9.0, 1.0, 2.0]])
    >>> noise.bits([3, 7], expected_then_spread).round(2).tolist()
    [-3.0, -5.89]
    """

    correlation: tuple[tuple[float, ...], ...]
    gains: tuple[float, ...]
    offsets: tuple[float, ...]
    freedom: float
    correlation_m: float

    def __post_init__(self) -> None:
        _check_positive("freedom", self.freedom)
        _check_positive("correlation_m", self.correlation_m)
        if not len(self.correlation) == len(self.gains) == len(self.offsets):
            message = "correlation, gains and offsets are of as many neighborhoods"
            raise InvalidConfigurationError(message, "correlation")
        _root(self.correlation)

    def n_levels(self, n_fields: int) -> int:
        """Return how many counts a measurement has.

        Parameters
        ----------
        n_fields : int
            Numbers that a place is known by: expected counts, then their spreads.

        Returns
        -------
        int
            Half as many.
        """
        return n_fields // 2

    def bits(self, counts: Sequence[float], expected: FloatArray) -> FloatArray:
        """Return how well each place explains a measurement.

        Parameters
        ----------
        counts : sequence of float
            Measured, one for each neighborhood.
        expected : ndarray, shape (N, 2 * n_levels), float64
            Expected counts, then their spreads, not below half a hole; not a number where nobody
            can be.

        Returns
        -------
        ndarray, shape (N,), float64
            Binary logarithms of the density, less that of the best match of the least spread.
        """
        levels = len(counts)
        root = _root(self.correlation)
        independent: list[FloatArray] = []
        squares, volume = np.zeros(len(expected)), np.ones(len(expected))
        for level, count in enumerate(counts):
            measured = self.offsets[level] + self.gains[level] * float(count)
            spread = np.maximum(expected[:, levels + level], LEAST_SPREAD)
            error = (measured - expected[:, level]) / spread
            for before, part in enumerate(independent):
                error -= root[level][before] * part
            error /= root[level][level]
            independent.append(error)
            squares += error * error
            volume *= spread * (1.0 / LEAST_SPREAD)
        nowhere = np.isnan(squares)
        match = log2(1.0 + np.where(nowhere, 0.0, squares) / self.freedom)
        found = -0.5 * (self.freedom + levels) * match - log2(np.where(nowhere, 1.0, volume))
        return np.where(nowhere, _NOTHING_BITS, found)


def _check_positive(name: str, number: float) -> None:
    if not (math.isfinite(number) and number > 0.0):
        message = f"{name} must be positive, not {number}"
        raise InvalidConfigurationError(message, name)


@lru_cache
def _root(correlation: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Return the lower Cholesky root, the same on every machine."""
    root: list[tuple[float, ...]] = []
    for i, row in enumerate(correlation):
        found: list[float] = []
        for j in range(i):
            dot = sum(a * b for a, b in zip(found, root[j], strict=False))
            found.append((row[j] - dot) / root[j][j])
        rest = row[i] - sum(a * a for a in found)
        if rest <= 0.0:
            message = "a correlation must be positive definite"
            raise InvalidConfigurationError(message, "correlation")
        root.append((*found, math.sqrt(rest)))
    return tuple(root)
