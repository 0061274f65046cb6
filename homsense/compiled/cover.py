"""The overlap of a row with the rows before it, covered by connected pieces."""

import numpy as np

from homsense.compiled.bit_strings import (
    NONE,
    ZERO,
    BitStrings,
    Ints,
    count_bits,
    highest_bit,
    lowest_bit,
    lowest_member,
    without_lowest,
    word_of,
)
from homsense.compiled.glue import (
    FIRST,
    N_ACTIVE,
    N_MET,
    N_PIECES,
    N_SLOTS,
    Glue,
    adopt,
    difference,
    meet,
    slot_of,
)
from homsense.compiled.jit import inlined
from homsense.compiled.labels import FULL, Labels, plane_of, plane_word


@inlined
def lies_in_one(glue: Glue, rows: BitStrings, last: Ints, n_last: int) -> bool:
    """Find the row added lately that covers most of the overlap; tell whether it covers all.

    Parameters
    ----------
    glue : Glue
        Holds the overlap; gets the row, or `NONE`.
    rows : BitStrings
        All rows.
    last : ndarray, uint32
        Rows added last, in turn.
    n_last : int
        How many have been added.

    Returns
    -------
    bool
        True when the overlap is a face of that row.
    """
    best = total = 0
    glue.counts[FIRST] = NONE
    for place in range(glue.counts[N_ACTIVE]):
        total += count_bits(glue.shared[place])
    for back in range(1, min(n_last, len(last)) + 1):
        other = last[np.uint64(n_last - back) % np.uint64(len(last))]
        overlap, at = 0, rows.at[other]
        for place in range(glue.counts[N_ACTIVE]):
            word = glue.active[place]
            if rows.low[other] <= word < rows.high[other]:
                overlap += count_bits(glue.shared[place] & word_of(rows, at, word))
        if overlap > best:
            best = overlap
            glue.counts[FIRST] = other
            if best == total:
                return True
    return False


@inlined
def cover(glue: Glue, labels: Labels, rows: BitStrings, through: BitStrings) -> None:
    """Cover the overlap by connected pieces, and carry the labels over each of them.

    Parameters
    ----------
    glue : Glue
        Holds the overlap and a row to begin with, if any; gets planes and pieces.
    labels : Labels
        Of the rows before.
    rows, through : BitStrings
        The relation both ways.
    """
    n_active = glue.counts[N_ACTIVE]
    for place in range(n_active):
        glue.uncovered[place] = glue.shared[place]
    glue.counts[N_SLOTS] = glue.counts[N_PIECES] = 0
    begin = glue.counts[FIRST]
    while True:
        if begin == NONE:
            place = 0
            while not glue.uncovered[place]:
                place += 1
            point = lowest_member(glue.active[place], glue.uncovered[place])
            word = through.low[point]
            while not through.words[through.at[point] + word] & glue.added[word]:
                word += 1
            begin = (word << 6) + lowest_bit(
                through.words[through.at[point] + word] & glue.added[word]
            )
            if glue.counts[FIRST] == NONE:
                glue.counts[FIRST] = begin
        if glue.counts[N_PIECES] == glue.room:
            labels.counts[FULL] = 1
            return
        _start_piece(glue, labels, rows, begin)
        _grow_piece(glue, labels, rows, through)
        glue.roots[glue.counts[N_PIECES]] = begin
        glue.counts[N_PIECES] += 1
        begin, some = NONE, ZERO
        for place in range(n_active):
            some |= glue.uncovered[place]
        if not some or labels.counts[FULL]:
            return


@inlined
def _start_piece(glue: Glue, labels: Labels, rows: BitStrings, other: int) -> None:
    """Let a piece begin with what another row shares."""
    piece = glue.counts[N_PIECES] * glue.widest
    for place in range(glue.counts[N_ACTIVE]):
        glue.pieces[piece + place] = ZERO
    meet(glue, rows, other)
    for index in range(glue.counts[N_MET]):
        glue.pieces[piece + glue.met[index]] = glue.meeting[index]
        glue.uncovered[glue.met[index]] &= ~glue.meeting[index]
    adopt(glue, labels, other)
    plane = labels.first[other]
    while plane != NONE and not labels.counts[FULL]:
        at = slot_of(glue, labels.generator[plane]) * glue.widest
        for index in range(glue.counts[N_MET]):
            place = glue.met[index]
            glue.planes[at + place] |= glue.meeting[index] & plane_word(
                labels, plane, glue.active[place]
            )
        plane = labels.next_of_row[plane]


@inlined
def _grow_piece(glue: Glue, labels: Labels, rows: BitStrings, through: BitStrings) -> None:
    """Add to a piece what rows share that meet it, until there are no more."""
    growing = True
    while growing:
        growing = False
        for place in range(glue.counts[N_ACTIVE]):
            left = glue.uncovered[place]
            while left:
                point = lowest_member(glue.active[place], left)
                left = without_lowest(left)
                at = through.at[point]
                met = NONE
                for word in range(through.high[point] - 1, through.low[point] - 1, -1):
                    others = word_of(through, at, word) & glue.added[np.uint64(word)]
                    while others and met == NONE:
                        latest = highest_bit(others)
                        other = lowest_member(word, latest)
                        others ^= latest
                        met = _touching_point(glue, rows, other)
                    if met != NONE:
                        break
                if met != NONE:
                    _carry(glue, labels, rows, other, met)
                    left &= glue.uncovered[place]
                    growing = True


@inlined
def _touching_point(glue: Glue, rows: BitStrings, other: int) -> int:
    """Return a point of the growing piece that another row holds, or `NONE`."""
    piece, at = glue.counts[N_PIECES] * glue.widest, rows.at[other]
    for place in range(glue.counts[N_ACTIVE]):
        word = glue.active[place]
        if rows.low[other] <= word < rows.high[other]:
            meeting = word_of(rows, at, word) & glue.pieces[np.uint64(piece + place)]
            if meeting:
                return int(lowest_member(word, meeting))
    return NONE


@inlined
def _carry(glue: Glue, labels: Labels, rows: BitStrings, other: int, point: int) -> None:
    """Extend piece and planes to another row so that the planes agree with its at one point."""
    piece, widest = glue.counts[N_PIECES] * glue.widest, glue.widest
    meet(glue, rows, other)
    for index in range(glue.counts[N_MET]):
        place = glue.met[index]
        at = np.uint64(piece + place)
        fresh = glue.meeting[index] & ~glue.pieces[at]
        glue.meeting[index] = fresh
        glue.pieces[at] |= fresh
        glue.uncovered[place] &= ~fresh
    adopt(glue, labels, other)
    for slot in range(glue.counts[N_SLOTS]):
        plane = plane_of(labels, other, glue.generator[slot])
        flips = ZERO - difference(glue, labels, slot, plane, point)
        for index in range(glue.counts[N_MET]):
            place = glue.met[index]
            carried = flips
            if plane != NONE:
                carried ^= plane_word(labels, plane, glue.active[place])
            glue.planes[np.uint64(slot * widest + place)] |= glue.meeting[index] & carried
