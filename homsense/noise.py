"""The error of the homological sensor.

It is a random field over space, not fresh noise at each scan: devices that stand close together
err alike. A measurement taken after a short way repeats the one before, so its likelihood is
raised to ``way / correlation_m``, at most 1.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from operator import add, mul
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError, check_positive
from homsense.exact import exp, log2

FloatArray = NDArray[np.float64]
Weigher = Callable[[Sequence[float]], FloatArray]

LEAST_SPREAD = 0.25
_NO_MATCH, _LEAST = 1e3, 1e-300
_NOTHING_BITS = -1e3
_REMEMBERED = 64


class Noise(Protocol):
    """What the localizer asks of an error model."""

    @property
    def correlation_m(self) -> float:
        """Way after which the error is new, metres."""
        ...

    def n_levels(self, n_fields: int) -> int:
        """Return how many counts a measurement has when places are known by so many numbers."""
        ...

    def weigher(self, expected: FloatArray) -> Weigher:
        """Return what gives the binary logarithms of a measurement's likelihood, at most 0.

        One for each row of `expected`.
        """
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
        check_positive("sigma", self.sigma)
        if not 0.0 <= self.floor < 1.0:
            message = f"floor must be in [0, 1), not {self.floor}"
            raise InvalidConfigurationError(message, "floor")
        check_positive("correlation_m", self.correlation_m)

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

    def weigher(self, expected: FloatArray) -> Weigher:
        """Return what tells how well each place explains measured counts.

        Parameters
        ----------
        expected : ndarray, shape (N, n_levels), float64
            Expected counts; not a number where nobody can be.

        Returns
        -------
        callable
            Takes a count for each neighborhood; returns binary logarithms, shape (N,), at most 0.
        """

        @lru_cache(_REMEMBERED)
        def of_level(level: int, count: float) -> FloatArray:
            apart = (expected[:, level] - float(count)) / self.sigma
            match = exp(-0.5 * np.square(np.nan_to_num(apart, nan=_NO_MATCH)))
            return log2(np.maximum(self.floor + (1.0 - self.floor) * match, _LEAST))

        def weigh(counts: Sequence[float]) -> FloatArray:
            total = np.zeros(len(expected))
            for level, count in enumerate(counts):
                total += of_level(level, count)
            return total

        return weigh


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
    >>> noise.weigher(expected_then_spread)([3, 7]).round(2).tolist()
    [-5.0, -7.89]
    """

    correlation: tuple[tuple[float, ...], ...]
    gains: tuple[float, ...]
    offsets: tuple[float, ...]
    freedom: float
    correlation_m: float

    def __post_init__(self) -> None:
        check_positive("freedom", self.freedom)
        check_positive("correlation_m", self.correlation_m)
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

    def weigher(self, expected: FloatArray) -> Weigher:
        """Return what tells how well each place explains measured counts.

        Parameters
        ----------
        expected : ndarray, shape (N, 2 * n_levels), float64
            Expected counts, then their spreads, not below a quarter of a hole; not a
            number where nobody
            can be.

        Returns
        -------
        callable
            Takes a count for each neighborhood; returns binary logarithms, shape (N,), of the
            density, less that of the best match of the least spread.
        """
        levels = expected.shape[1] // 2
        root = _root(self.correlation)
        nowhere = np.isnan(expected).any(axis=1)
        mean = np.where(nowhere, 0.0, expected[:, :levels].T)
        spread = np.where(nowhere, np.inf, np.maximum(expected[:, levels:].T, LEAST_SPREAD))
        volume = np.ones(len(expected))
        for of_level in spread:
            volume *= np.where(nowhere, 1.0, of_level * (1.0 / LEAST_SPREAD))
        volume_bits = np.where(nowhere, -_NOTHING_BITS, log2(volume))

        def weigh(counts: Sequence[float]) -> FloatArray:
            independent: list[FloatArray] = []
            squares = np.zeros(len(expected))
            for level, count in enumerate(counts):
                measured = self.offsets[level] + self.gains[level] * float(count)
                error = (measured - mean[level]) / spread[level]
                for before, part in enumerate(independent):
                    error -= root[level][before] * part
                error /= root[level][level]
                independent.append(error)
                squares += error * error
            squares /= self.freedom
            match_bits: FloatArray = -0.5 * (self.freedom + levels) * log2(1.0 + squares)
            return match_bits - volume_bits

        return weigh


def advantage_bits(
    weigher: Weigher, measured: Iterable[Sequence[float]], rows: Iterable[int]
) -> Iterator[float]:
    """Tell how much better measurements are explained where they were made than elsewhere.

    Parameters
    ----------
    weigher : callable
        Of an error model, for some places.
    measured : iterable of sequence of float
        Counts.
    rows : iterable of int
        At which of the places each was made.

    Yields
    ------
    float
        Bits above the mean of the likelihood over the places.
    """
    for counts, row in zip(measured, rows, strict=True):
        bits = weigher(counts)
        best = bits.max()
        yield float(bits[row] - best - np.log2(np.exp2(bits - best).mean()))


@lru_cache
def _root(correlation: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    """Return the lower Cholesky root, the same on every machine."""
    root: list[tuple[float, ...]] = []
    for i, row in enumerate(correlation):
        found: list[float] = []
        for j in range(i):
            found.append((row[j] - _dot(found, root[j])) / root[j][j])
        rest = row[i] - _dot(found, found)
        if rest <= 0.0:
            message = "a correlation must be positive definite"
            raise InvalidConfigurationError(message, "correlation")
        root.append((*found, math.sqrt(rest)))
    return tuple(root)


def _dot(some: Sequence[float], others: Sequence[float]) -> float:
    """Add up in order; `sum` rounds as the version of Python wants."""
    return reduce(add, map(mul, some, others), 0.0)
