"""Sets of small numbers as bit strings, each over the range of 64-bit words that it touches."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.jit import allocating, apart, inlined

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


@inlined
def lowest_member(place: Any, word: Any) -> Any:
    """Return the lowest member of a string in one word that is not zero.

    It is unsigned: numba asks of every signed index whether it counts from the end.
    """
    return np.uint32((place << 6) + lowest_bit(word))


@inlined
def highest_bit(word: Any) -> Any:
    """Return a word that is not zero with its highest set bit only."""
    for shift in (1, 2, 4, 8, 16, 32):
        word |= word >> np.uint64(shift)
    return word ^ (word >> ONE)


@inlined
def word_of(strings: BitStrings, at: int, place: Any) -> Any:
    """Return one word of a string that begins at ``at`` and has it."""
    return strings.words[np.uint64(at + place)]


@allocating
def both_ways(ends: Ints, points: Ints, n_points: int) -> tuple[BitStrings, BitStrings]:
    """Return lists of points as bit strings, and for each point the lists that hold it.

    Parameters
    ----------
    ends, points : ndarray, int64 and int32
        Lists in the form of `Ragged`.
    n_points : int
        All points lie below.

    Returns
    -------
    rows : BitStrings
        One string for each list.
    through : BitStrings
        One string for each point. Where all strings are narrow, nobody counts its bits.
    """
    n_rows = len(ends) - 1
    of_row, of_point = np.empty((4, n_rows), np.int64), np.empty((4, n_points), np.int64)
    row_words, point_words = _lay_out(ends, points, of_row, of_point)
    rows = BitStrings(np.zeros(row_words, np.uint64), of_row[0], of_row[1], of_row[2], of_row[3])
    through = BitStrings(
        np.zeros(point_words, np.uint64), of_point[0], of_point[1], of_point[2], of_point[3]
    )
    _fill(ends, points, rows, through)
    return rows, through


@apart
def _lay_out(ends: Ints, points: Ints, of_row: Ints, of_point: Ints) -> tuple[int, int]:
    """Write place, range and size of every string; return how many words there are both ways.

    All narrow strings have the same range.
    """
    n_rows, n_points = of_row.shape[1], of_point.shape[1]
    wide_rows, wide_points = n_points >> 6 >= _NARROW, n_rows >> 6 >= _NARROW
    of_row[1], of_row[2] = 0, (n_points >> 6) + 1
    of_point[1], of_point[2] = 0, 0 if wide_points else (n_rows >> 6) + 1
    of_point[3] = 0
    row_words = point_words = 0
    for row in range(n_rows):
        if wide_rows or wide_points:
            least, most = n_points, NONE
            for entry in range(ends[row], ends[row + 1]):
                point = np.uint32(points[np.uint64(entry)])
                least, most = min(least, int(point)), max(most, int(point))
                if wide_points:
                    if not of_point[3, point]:
                        of_point[1, point] = row >> 6
                    of_point[2, point] = (row >> 6) + 1
                of_point[3, point] += 1
            if wide_rows:
                of_row[1, row], of_row[2, row] = least >> 6, (most >> 6) + 1
        of_row[0, row] = row_words - of_row[1, row]
        of_row[3, row] = ends[row + 1] - ends[row]
        row_words += max(0, of_row[2, row] - of_row[1, row])
    for index in range(n_points):
        of_point[0, index] = point_words - of_point[1, index]
        point_words += of_point[2, index] - of_point[1, index]
    return row_words, point_words


@apart
def _fill(ends: Ints, points: Ints, rows: BitStrings, through: BitStrings) -> None:
    for row in range(len(ends) - 1):
        bit, word, at = ONE << np.uint64(row & 63), row >> 6, rows.at[row]
        for entry in range(ends[row], ends[row + 1]):
            point = np.uint32(points[np.uint64(entry)])
            rows.words[np.uint64(at + (point >> 6))] |= ONE << np.uint64(point & 63)
            through.words[np.uint64(through.at[point] + word)] |= bit
