"""Weights as whole numbers: no rounding, no NaN, and sums that no order can change.

A log-weight is an integer in units of 1/2048 bit, 0 for the best particle. Its weight is an
integer of at most 2**20.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.exact import exp
from homsense.scalar import LN_2, log2

Integers = NDArray[np.int32]
Weights = NDArray[np.uint32]

UNITS_PER_BIT = 2048
FULL = 2**20
LOWEST = np.int32(-(2**30))
BLOCKED = np.int32(-60_000)
"""What a move into a wall costs: a factor of 2e-9."""

UNIT_BITS, FRACTION_BITS = np.int32(11), np.int32(2047)
MOST_HALVINGS = np.int32(31)
FRACTIONS = (
    FULL * exp(np.arange(UNITS_PER_BIT, dtype=np.float64) * (LN_2 / UNITS_PER_BIT)) + 0.5
).astype(np.uint32)


class WeightSums(NamedTuple):
    """What policies ask about weights.

    Parameters
    ----------
    size : int
        Number of particles.
    total, squares : int
        Sum of the weights and of their squares.
    """

    size: int
    total: int
    squares: int

    @property
    def ess(self) -> float:
        """Effective sample size, in [1, size]: how many equal weights would be as good."""
        return self.total**2 / self.squares if self.squares else float(self.size)


def linear(log_weight: Integers) -> Weights:
    """Return the weights.

    Parameters
    ----------
    log_weight : ndarray, shape (N,), int32
        At most 0.

    Returns
    -------
    ndarray, shape (N,), uint32
        At most 2**20; 0 below a millionth of that.

    Examples
    --------
    >>> linear(np.array([0, -2048, -4096 * 11], np.int32)).tolist()
    [1048576, 524288, 0]
    """
    halvings = np.minimum(-(log_weight >> UNIT_BITS), MOST_HALVINGS)
    weights: Weights = FRACTIONS.take(log_weight & FRACTION_BITS) >> halvings.view(np.uint32)
    return weights


def sums(weights: Weights) -> WeightSums:
    """Return the sums of some weights.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each, no more than 2**20 of them.

    Returns
    -------
    WeightSums
        Exact.
    """
    wide = weights.astype(np.uint64)
    return WeightSums(len(weights), int(wide.sum()), int((wide * wide).sum()))


def units(probability_bits: NDArray[np.float64]) -> Integers:
    """Return binary logarithms as log-weights.

    Parameters
    ----------
    probability_bits : ndarray, float64
        Binary logarithms.

    Returns
    -------
    ndarray, int32
        In units of 1/2048, not below -2**24.
    """
    scaled = np.floor(probability_bits * UNITS_PER_BIT + 0.5)
    return np.maximum(scaled, -(2.0**24)).astype(np.int32)


def bits(total: float) -> float:
    """Return the binary logarithm of a sum of weights.

    Parameters
    ----------
    total : float
        Positive.

    Returns
    -------
    float
        0 for the weight of one best particle.
    """
    return log2(total / FULL)
