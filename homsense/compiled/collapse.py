"""What the homology of no stage needs is left out: dominated points, and rows inside other rows.

A point is dominated when another one lies in every row that holds it; without it the homotopy
type stays (strong collapse), at every stage at once. A row that lies in a row of the same stage
or an earlier one adds nothing; twins are the plainest case.
"""

from typing import Any

import numpy as np

from homsense.compiled.bit_strings import (
    ONE,
    BitStrings,
    Ints,
    count_bits,
    lowest_member,
    without_lowest,
    word_of,
)
from homsense.compiled.jit import allocating, apart, inlined


@allocating
def collapse(rows: BitStrings, through: BitStrings, n_whole: int, stages: Ints) -> None:
    """Take the dominated points out of the rows, and empty the rows that are needless.

    Parameters
    ----------
    rows, through : BitStrings
        The relation both ways; `rows` is changed.
    n_whole : int
        Points below are known not to be dominated.
    stages : ndarray, int64
        How many rows each stage has, not falling.
    """
    dominated = np.zeros(len(through.low) // 64 + 1, np.uint64)
    _find_dominated(rows, through, n_whole, dominated)
    _take_out(rows, dominated)
    _empty_needless(rows, through, stages)


@apart
def _find_dominated(rows: BitStrings, through: BitStrings, n_whole: int, dominated: Ints) -> None:
    n_points = len(through.low)
    for point in range(n_whole, n_points):
        if _lies_in_another(through, point, rows, n_points):
            dominated[point >> 6] |= ONE << np.uint64(point & 63)


@apart
def _take_out(rows: BitStrings, dominated: Ints) -> None:
    for row in range(len(rows.low)):
        size = 0
        for word in range(rows.low[row], rows.high[row]):
            at = np.uint64(rows.at[row] + word)
            rows.words[at] &= ~dominated[np.uint64(word)]
            size += count_bits(rows.words[at])
        rows.size[row] = size


@apart
def _empty_needless(rows: BitStrings, through: BitStrings, stages: Ints) -> None:
    stage = 0
    for row in range(len(rows.low)):
        while stage < len(stages) and stages[stage] <= row:
            stage += 1
        stop = row if stage == len(stages) else stages[stage]
        if rows.size[row] and _lies_in_another(rows, row, through, stop):
            rows.size[row] = 0


@inlined
def _lies_in_another(strings: BitStrings, index: int, duals: BitStrings, stop: int) -> bool:
    """Tell whether a string lies in an earlier one, or in a larger one below `stop`.

    That one has each of its members; a member that few strings have tells of most that they do
    not contain it.
    """
    size, at = strings.size[index], strings.at[index]
    rarest, fewest = np.uint32(0), len(strings.low) + 1
    for place in range(strings.low[index], strings.high[index]):
        members = word_of(strings, at, place)
        if members:
            member = lowest_member(place, members)
            if duals.size[member] < fewest:
                rarest, fewest = member, duals.size[member]
    for place in range(duals.low[rarest], duals.high[rarest]):
        others = word_of(duals, duals.at[rarest], place)
        while others:
            other = lowest_member(place, others)
            others = without_lowest(others)
            is_larger = other < stop and strings.size[other] > size
            if (other < index or is_larger) and _lies_in(strings, index, other):
                return True
    return False


@inlined
def _lies_in(strings: BitStrings, one: int, other: Any) -> bool:
    low, high = strings.low[one], strings.high[one]
    if (
        strings.size[other] < strings.size[one]
        or strings.low[other] > low
        or strings.high[other] < high
    ):
        return False
    for place in range(low, high):
        if word_of(strings, strings.at[one], place) & ~word_of(strings, strings.at[other], place):
            return False
    return True
