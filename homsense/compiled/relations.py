"""Births and deaths of generators at a row, and the planes that it keeps."""

from typing import Any

import numpy as np

from homsense.compiled.bit_strings import (
    NONE,
    ZERO,
    BitStrings,
    count_bits,
    lowest_bit,
    lowest_member,
    without_lowest,
    word_of,
)
from homsense.compiled.glue import (
    FIRST,
    N_ACTIVE,
    N_MET,
    N_SLOTS,
    Glue,
    adopt,
    difference,
    meet,
    new_slot,
    slot_of,
)
from homsense.compiled.jit import apart, inlined
from homsense.compiled.labels import (
    FOREVER,
    FULL,
    N_GENERATORS,
    Labels,
    new_plane,
    plane_of,
    plane_word,
    substitute,
)


@inlined
def check(glue: Glue, labels: Labels, rows: BitStrings, through: BitStrings, row: int) -> None:
    """Compare with every row that meets this one outside its first overlap; kill what differs.

    Parameters
    ----------
    glue : Glue
        Holds the planes of the row.
    labels : Labels
        Of the rows before.
    rows, through : BitStrings
        The relation both ways.
    row : int
        The row.
    """
    plain = True
    for slot in range(glue.counts[N_SLOTS]):
        for place in range(slot * glue.widest, slot * glue.widest + glue.counts[N_ACTIVE]):
            if glue.planes[place]:
                plain = False
                break
    first, n_outside = glue.counts[FIRST], 0
    low, high = row, 0
    for place in range(glue.counts[N_ACTIVE]):
        left, word = glue.shared[place], glue.active[place]
        if rows.low[first] <= word < rows.high[first]:
            left &= ~word_of(rows, rows.at[first], word)
        while left:
            point = lowest_member(word, left)
            left = without_lowest(left)
            glue.outside[n_outside] = point
            n_outside += 1
            low, high = min(low, through.low[point]), max(high, through.high[point])
    for place in range(low, min(high, (row >> 6) + 1)):
        word = np.uint32(place)
        others: Any = ZERO
        for index in range(n_outside):
            point = glue.outside[index]
            if through.low[point] <= word < through.high[point]:
                others |= word_of(through, through.at[point], word)
        others &= labels.labelled[word] if plain else glue.added[word]
        while others:
            other = lowest_member(word, others)
            others = without_lowest(others)
            while not _agree(glue, labels, rows, other) and not labels.counts[FULL]:
                _kill(glue, labels, rows, row, other)


@inlined
def _agree(glue: Glue, labels: Labels, rows: BitStrings, other: int) -> bool:
    """Tell whether the planes of two rows differ by constants on what the rows share."""
    for slot in range(glue.counts[N_SLOTS]):
        plane = plane_of(labels, other, glue.generator[slot])
        if not _constant(glue, labels, rows, other, slot, plane):
            return False
    plane = labels.first[other]
    while plane != NONE:
        if slot_of(glue, labels.generator[np.uint64(plane)]) == NONE and not _constant(
            glue, labels, rows, other, NONE, plane
        ):
            return False
        plane = labels.next_of_row[np.uint64(plane)]
    return True


@inlined
def _constant(
    glue: Glue, labels: Labels, rows: BitStrings, other: int, slot: int, plane: int
) -> bool:
    """Tell whether two planes, either of which may be `NONE`, differ by a constant."""
    at, low, high = rows.at[other], rows.low[other], rows.high[other]
    some = rest = ZERO
    for place in range(glue.counts[N_ACTIVE]):
        word = glue.active[place]
        if low <= word < high:
            apart = ZERO
            if slot != NONE:
                apart = glue.planes[np.uint64(slot * glue.widest + place)]
            if plane != NONE:
                apart ^= plane_word(labels, plane, word)
            meeting = glue.shared[place] & word_of(rows, at, word)
            some |= apart & meeting
            rest |= ~apart & meeting
    return not (some and rest)


@apart
def _kill(glue: Glue, labels: Labels, rows: BitStrings, row: int, other: int) -> None:
    """Kill the youngest generator of a relation that two rows reveal."""
    meet(glue, rows, other)
    adopt(glue, labels, other)
    origin, witness = _differing_points(glue, labels, other)
    found, youngest = 0, NONE
    for slot in range(glue.counts[N_SLOTS]):
        plane = plane_of(labels, other, glue.generator[slot])
        if difference(glue, labels, slot, plane, origin) != difference(
            glue, labels, slot, plane, witness
        ):
            glue.relation[found] = glue.generator[slot]
            youngest = max(youngest, glue.generator[slot])
            found += 1
    if labels.counts[FULL]:
        return
    labels.deaths[youngest] = row
    substitute(labels, rows, glue.relation, found, youngest)
    gone = slot_of(glue, youngest)
    last, n_active, widest = glue.counts[N_SLOTS] - 1, glue.counts[N_ACTIVE], glue.widest
    for index in range(found):
        slot = slot_of(glue, glue.relation[index])
        if slot != gone:
            for place in range(n_active):
                glue.planes[slot * widest + place] ^= glue.planes[gone * widest + place]
    glue.counts[N_SLOTS] = last
    glue.generator[gone] = glue.generator[last]
    for place in range(n_active):
        glue.planes[gone * widest + place] = glue.planes[last * widest + place]


@apart
def _differing_points(glue: Glue, labels: Labels, other: int) -> tuple[int, int]:
    """Return two points, met by `_meet`, between which planes of two rows change differently."""
    origin = (glue.active[glue.met[0]] << 6) + lowest_bit(glue.meeting[0])
    for slot in range(glue.counts[N_SLOTS]):
        plane = plane_of(labels, other, glue.generator[slot])
        for index in range(glue.counts[N_MET]):
            left = glue.meeting[index]
            while left:
                point = (glue.active[glue.met[index]] << 6) + lowest_bit(left)
                left = without_lowest(left)
                if difference(glue, labels, slot, plane, point) != difference(
                    glue, labels, slot, plane, origin
                ):
                    return origin, point
    return origin, origin


@apart
def bear(glue: Glue, labels: Labels, row: int, piece: int) -> None:
    """Let a piece of a component that the row touches already bear a generator.

    Parameters
    ----------
    glue : Glue
        Holds the piece; gets a plane.
    labels : Labels
        Gets a generator.
    row, piece : int
        Where it is born.
    """
    generator = labels.counts[N_GENERATORS]
    if generator == len(labels.carriers):
        labels.counts[FULL] = 1
        return
    labels.counts[N_GENERATORS] += 1
    labels.carriers[generator] = NONE
    labels.births[generator], labels.deaths[generator] = row, FOREVER
    slot = new_slot(glue, labels, generator)
    for place in range(glue.counts[N_ACTIVE]):
        glue.planes[slot * glue.widest + place] = glue.pieces[piece * glue.widest + place]


@inlined
def keep(glue: Glue, labels: Labels, rows: BitStrings, row: int) -> None:
    """Keep the planes that vary over the row; its new points get the potential of most old ones.

    Any potential would do; with this one fewer planes vary farther on.

    Parameters
    ----------
    glue : Glue
        Holds the planes.
    labels : Labels
        Gets them.
    rows : BitStrings
        All rows.
    row : int
        The row.
    """
    low, high = rows.low[row], rows.high[row]
    for slot in range(glue.counts[N_SLOTS]):
        at = slot * glue.widest
        ones = zeros = 0
        for place in range(glue.counts[N_ACTIVE]):
            ones += count_bits(glue.planes[at + place])
            zeros += count_bits(glue.shared[place] & ~glue.planes[at + place])
        if ones and zeros:
            plane = new_plane(labels, row, glue.generator[slot], low, high)
            if plane == NONE:
                return
            fresh = ~ZERO if ones > zeros else ZERO
            for word in range(low, high):
                labels.words[labels.at[plane] + word] = fresh & rows.words[rows.at[row] + word]
            for place in range(glue.counts[N_ACTIVE]):
                word = labels.at[plane] + glue.active[place]
                labels.words[word] &= ~glue.shared[place]
                labels.words[word] |= glue.planes[at + place]
