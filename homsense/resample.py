"""Resampling: which particle lives on, by weight (Algorithm 1, resampleParticlesByWeight).

Every scheme compares whole numbers, so no rounding can drop or repeat a particle. A scheme takes
the weights, as many random bits as it may need, and how many particles to draw, and returns the
drawn ones in order.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from homsense.weights import Weights

IntArray = NDArray[np.int64]
Words = NDArray[np.uint32]
Scheme = Callable[[Weights, Words, int], IntArray]

_EIGHT, _WORD = np.uint32(8), np.uint64(24)


def scaled(high: int, low: int, bound: int) -> int:
    """Return 64 random bits as a number below a bound.

    Parameters
    ----------
    high, low : int
        Random words of 32 bits.
    bound : int
        Positive.

    Returns
    -------
    int
        In [0, bound).

    Examples
    --------
    >>> scaled(2**31, 0, 10)
    5
    """
    return ((int(high) << 32 | int(low)) * bound) >> 64


def systematic(weights: Weights, words: Words, count: int) -> IntArray:
    """Draw with one random offset and equal strides.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each.
    words : ndarray, shape (4, count), uint32
        Random bits.
    count : int
        How many to draw.

    Returns
    -------
    ndarray, shape (count,), int64
        Rising indices; each occurs as often as its share says, rounded down or up.
    """
    total = int(weights.sum(dtype=np.int64))
    return strides(weights, total, scaled(words[0, 0], words[1, 0], total), count)


def strides(weights: Weights, total: int, offset: int, count: int) -> IntArray:
    """Draw at equal strides.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each.
    total : int
        Their sum, positive.
    offset : int
        Of the first stride, in [0, total).
    count : int
        How many to draw.

    Returns
    -------
    ndarray, shape (count,), int64
        Rising indices.

    Examples
    --------
    >>> strides(np.array([1, 3], np.uint32), 4, 0, 4).tolist()
    [0, 1, 1, 1]
    """
    reached = np.cumsum(weights, dtype=np.int64) * count - offset
    until = (reached + (total - 1)) // total
    return np.repeat(np.arange(len(weights)), np.diff(until, prepend=0))


def stratified(weights: Weights, words: Words, count: int) -> IntArray:
    """Draw once from each of `count` equal strata.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each.
    words : ndarray, shape (4, count), uint32
        Random bits.
    count : int
        How many to draw.

    Returns
    -------
    ndarray, shape (count,), int64
        Rising indices.
    """
    reached = np.cumsum(weights, dtype=np.int64)
    total = reached[-1]
    places = np.arange(count) * total + _below(words[0, :count], total)
    drawn: IntArray = np.searchsorted(reached * count, places, side="right")
    return drawn


def multinomial(weights: Weights, words: Words, count: int) -> IntArray:
    """Draw independently.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each.
    words : ndarray, shape (4, count), uint32
        Random bits.
    count : int
        How many to draw.

    Returns
    -------
    ndarray, shape (count,), int64
        Rising indices.
    """
    reached = np.cumsum(weights, dtype=np.int64)
    drawn: IntArray = np.searchsorted(
        reached, np.sort(_below(words[0, :count], reached[-1])), side="right"
    )
    return drawn


def residual(weights: Weights, words: Words, count: int) -> IntArray:
    """Draw the whole part of each share, and the rest independently.

    Parameters
    ----------
    weights : ndarray, shape (N,), uint32
        At most 2**20 each.
    words : ndarray, shape (4, count), uint32
        Random bits.
    count : int
        How many to draw.

    Returns
    -------
    ndarray, shape (count,), int64
        Rising indices; each occurs at least as often as its share says, rounded down.
    """
    total = int(weights.sum(dtype=np.int64))
    whole, rest = np.divmod(weights.astype(np.int64) * count, total)
    missing = count - int(whole.sum())
    certain = np.repeat(np.arange(len(weights)), whole)
    if not missing:
        return certain
    reached = np.cumsum(rest // missing)
    drawn = np.searchsorted(reached, _below(words[0, :missing], reached[-1]), side="right")
    return np.sort(np.concatenate([certain, drawn]))


def _below(words: Words, bound: np.int64) -> IntArray:
    return ((words >> _EIGHT) * np.uint64(bound) >> _WORD).astype(np.int64)


SCHEMES: dict[str, Scheme] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}
