"""What the homology of no stage needs is left out: dominated points, and rows inside other rows.

A point is dominated when another one lies in every row that holds it; without it the homotopy
type stays (strong collapse), at every stage at once. A row that lies in a row of the same stage
or an earlier one adds nothing; twins are the plainest case.
"""

import numpy as np

from homsense.compiled.bit_strings import (
    ONE,
    ZERO,
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
    n_points, n_rows = len(through.low), len(rows.low)
    common = np.empty(max(n_points, n_rows) // 64 + 1, np.uint64)
    dominated = np.zeros(n_points // 64 + 1, np.uint64)
    _find_dominated(rows, through, n_whole, common, dominated)
    _empty_needless(rows, through, stages, common, dominated)


@apart
def _find_dominated(
    rows: BitStrings, through: BitStrings, n_whole: int, common: Ints, dominated: Ints
) -> None:
    for point in range(n_whole, len(through.low)):
        low, high = _in_all(through, point, rows, common)
        size = through.size[point]
        for word in range(low, high):
            others = common[np.uint64(word)]
            while others:
                other = lowest_member(word, others)
                others = without_lowest(others)
                if through.size[other] > size or other < point:
                    dominated[point >> 6] |= ONE << np.uint64(point & 63)
                    others = ZERO


@apart
def _empty_needless(
    rows: BitStrings, through: BitStrings, stages: Ints, common: Ints, dominated: Ints
) -> None:
    for row in range(len(rows.low)):
        size = 0
        for word in range(rows.low[row], rows.high[row]):
            at = np.uint64(rows.at[row] + word)
            rows.words[at] &= ~dominated[np.uint64(word)]
            size += count_bits(rows.words[at])
        rows.size[row] = size
    stage = 0
    for row in range(len(rows.low)):
        while stage < len(stages) and stages[stage] <= row:
            stage += 1
        stop = row if stage == len(stages) else stages[stage]
        needless = not rows.size[row]
        low, high = _in_all(rows, row, through, common)
        for word in range(low, high):
            others = common[np.uint64(word)]
            while others:
                other = lowest_member(word, others)
                others = without_lowest(others)
                if other < row or (row < other < stop and rows.size[other] > rows.size[row]):
                    needless = True
        if needless:
            rows.size[row] = 0


@inlined
def _in_all(strings: BitStrings, index: int, duals: BitStrings, common: Ints) -> tuple[int, int]:
    """Find what lies in every dual string of a string's members; return the words to look at.

    One member of each word comes first, since neighbors are alike. The search stops as soon as
    nothing but the string itself is left.
    """
    own, own_word = ONE << np.uint64(index & 63), index >> 6
    low = high = 0
    first = True
    for sweep in range(2):
        for place in range(strings.low[index], strings.high[index]):
            members = word_of(strings, strings.at[index], place)
            rest = without_lowest(members)
            members = members ^ rest if sweep == 0 else rest
            while members:
                member = lowest_member(place, members)
                members = without_lowest(members)
                at = duals.at[member]
                if first:
                    first = False
                    low, high = duals.low[member], duals.high[member]
                    for word in range(low, high):
                        common[np.uint64(word)] = word_of(duals, at, word)
                    continue
                low, high = max(low, duals.low[member]), min(high, duals.high[member])
                for word in range(low, high):
                    common[np.uint64(word)] &= word_of(duals, at, word)
                while low < high and not common[np.uint64(low)]:
                    low += 1
                while low < high and not common[np.uint64(high - 1)]:
                    high -= 1
                if high == low + 1 and low == own_word and common[low] == own:
                    return low, low
    return low, high
