"""Sets of small numbers as bit strings, each over the range of 64-bit words that it touches."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.jit import allocating, inlined

Ints = NDArray[Any]

NONE = -1
ONE = np.uint64(1)
ZERO = np.uint64(0)
_NARROW = 4


class BitStrings(NamedTuple):
    """Word w of string i is ``words[at[i] + w]`` for ``low[i] <= w < high[i]``, else zero.

    Parameters
    ----------
    words : ndarray, uint64
        All strings.
    at, low, high : ndarray, int64
        One of each for every string.
    size : ndarray, int64
        How many bits are set.
    """

    words: Ints
    at: Ints
    low: Ints
    high: Ints
    size: Ints


@inlined
def count_bits(word: Any) -> int:
    """Return the number of set bits."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + (
        (word >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inlined
def lowest_bit(word: Any) -> int:
    """Return the position of the lowest set bit of a word that is not zero."""
    return count_bits((word & (~word + ONE)) - ONE)


@inlined
def without_lowest(word: Any) -> Any:
    """Return a word without its lowest set bit."""
    return word & (word - ONE)


@allocating
def bit_strings(ends: Ints, points: Ints, n_points: int) -> BitStrings:
    """Return lists of points as bit strings.

    Parameters
    ----------
    ends, points : ndarray, int64 and int32
        Lists in the form of `Ragged`.
    n_points : int
        All points lie below.

    Returns
    -------
    BitStrings
        One string for each list.
    """
    total, width = len(ends) - 1, (n_points >> 6) + 1
    at, low = np.empty(total, np.int64), np.zeros(total, np.int64)
    high = np.full(total, width)
    size = 0
    for row in range(total):
        if width > _NARROW:
            least, most = n_points, NONE
            for entry in range(ends[row], ends[row + 1]):
                least, most = min(least, points[entry]), max(most, points[entry])
            low[row], high[row] = least >> 6, (most >> 6) + 1
        at[row] = size - low[row]
        size += max(0, high[row] - low[row])
    words = np.zeros(size, np.uint64)
    for row in range(total):
        for entry in range(ends[row], ends[row + 1]):
            words[at[row] + (points[entry] >> 6)] |= ONE << np.uint64(points[entry] & 63)
    return BitStrings(words, at, low, high, np.diff(ends))


@allocating
def transposed(ends: Ints, points: Ints, n_points: int) -> BitStrings:
    """Return, for each point, the lists that hold it.

    Parameters
    ----------
    ends, points : ndarray, int64 and int32
        Lists in the form of `Ragged`.
    n_points : int
        All points lie below.

    Returns
    -------
    BitStrings
        One string for each point.
    """
    width = (len(ends) >> 6) + 1
    at, low = np.empty(n_points, np.int64), np.zeros(n_points, np.int64)
    high, count = np.full(n_points, width), np.zeros(n_points, np.int64)
    if width > _NARROW:
        high[:] = 0
        for row in range(len(ends) - 1):
            for entry in range(ends[row], ends[row + 1]):
                point = points[entry]
                if not count[point]:
                    low[point] = row >> 6
                high[point] = (row >> 6) + 1
                count[point] += 1
    size = 0
    for point in range(n_points):
        at[point] = size - low[point]
        size += high[point] - low[point]
    words = np.zeros(size, np.uint64)
    for row in range(len(ends) - 1):
        bit = ONE << np.uint64(row & 63)
        for entry in range(ends[row], ends[row + 1]):
            words[at[points[entry]] + (row >> 6)] |= bit
    return BitStrings(words, at, low, high, count)
