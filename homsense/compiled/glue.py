"""What is known of the row that is being glued to the rows before it."""

from typing import NamedTuple

import numpy as np

from homsense.compiled.bit_strings import NONE, ONE, ZERO, BitStrings, Ints, word_of
from homsense.compiled.jit import allocating, inlined
from homsense.compiled.labels import FULL, Labels, plane_word

N_SLOTS, N_PIECES, N_ACTIVE, N_MET, FIRST = 0, 1, 2, 3, 4


class Glue(NamedTuple):
    """What is known of the row that is being glued.

    Only *active* words matter: those in which the row shares a point with the rows before. Strings
    of this file have one word for each of them.

    Parameters
    ----------
    active : ndarray, shape (widest,), uint32
        Numbers of the active words, rising.
    shared, uncovered : ndarray, shape (widest,), uint64
        Points met before; those in no piece yet.
    generator : ndarray, shape (room,), int64
        The generators that have a plane on the row.
    planes, pieces : ndarray, shape (room * widest,), uint64
        Their planes; connected pieces of the overlap with the rows before.
    roots : ndarray, shape (room,), int64
        A row of the component of each piece.
    relation : ndarray, shape (room,), int64
        Generators that sum to zero.
    met, meeting : ndarray, shape (widest,), uint32 and uint64
        Where one other row shares points, as places in `active`, and those points.
    outside : ndarray, shape (64 * widest,), uint32
        Points beyond the row that covers most.
    added : ndarray, uint64
        The rows before, as one bit string.
    counts : ndarray, shape (5,), int64
        How many planes, pieces, active words, words met; the row that covers most.
    room, widest : int
        Sizes.
    """

    active: Ints
    shared: Ints
    uncovered: Ints
    generator: Ints
    planes: Ints
    pieces: Ints
    roots: Ints
    relation: Ints
    met: Ints
    meeting: Ints
    outside: Ints
    added: Ints
    counts: Ints
    room: int
    widest: int


@allocating
def no_glue(n_rows: int, widest: int, room: int) -> Glue:
    """Return empty tables.

    Parameters
    ----------
    n_rows : int
        How many simplices there will be.
    widest : int
        Words of the widest one.
    room : int
        Most generators, or pieces, of one row.

    Returns
    -------
    Glue
        Empty.
    """
    return Glue(
        np.empty(widest, np.uint32),
        np.empty(widest, np.uint64),
        np.empty(widest, np.uint64),
        np.empty(room, np.int64),
        np.empty(room * widest, np.uint64),
        np.empty(room * widest, np.uint64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(widest, np.uint32),
        np.empty(widest, np.uint64),
        np.empty(64 * widest, np.uint32),
        np.zeros((n_rows >> 6) + 1, np.uint64),
        np.zeros(5, np.int64),
        room,
        widest,
    )


@inlined
def slot_of(glue: Glue, generator: int) -> int:
    """Return the plane of a generator, or `NONE`."""
    for slot in range(glue.counts[N_SLOTS]):
        if glue.generator[np.uint64(slot)] == generator:
            return slot
    return NONE


@inlined
def new_slot(glue: Glue, labels: Labels, generator: int) -> int:
    """Return an empty plane; without room the flag is set, and it is the last one."""
    slot = glue.counts[N_SLOTS]
    if slot == glue.room:
        labels.counts[FULL] = 1
        return slot - 1
    glue.counts[N_SLOTS] += 1
    glue.generator[slot] = generator
    for place in range(slot * glue.widest, slot * glue.widest + glue.counts[N_ACTIVE]):
        glue.planes[np.uint64(place)] = ZERO
    return slot


@inlined
def adopt(glue: Glue, labels: Labels, other: int) -> None:
    """Make sure that every generator with a plane on another row has one here."""
    plane = labels.first[other]
    while plane != NONE:
        generator = labels.generator[np.uint64(plane)]
        if slot_of(glue, generator) == NONE:
            new_slot(glue, labels, generator)
        plane = labels.next_of_row[np.uint64(plane)]


@inlined
def meet(glue: Glue, rows: BitStrings, other: int) -> None:
    """Find the points that another row shares."""
    n_met, at = 0, rows.at[other]
    for place in range(glue.counts[N_ACTIVE]):
        word = glue.active[place]
        if word >= rows.high[other]:
            break
        if word >= rows.low[other]:
            meeting = glue.shared[place] & word_of(rows, at, word)
            if meeting:
                glue.met[n_met] = place
                glue.meeting[n_met] = meeting
                n_met += 1
    glue.counts[N_MET] = n_met


@inlined
def difference(glue: Glue, labels: Labels, slot: int, plane: int, point: int) -> int:
    """Return the difference of two potentials at a shared point; that of `NONE` is zero."""
    place = 0
    while glue.active[place] < point >> 6:
        place += 1
    bit = np.uint64(point & 63)
    apart = glue.planes[slot * glue.widest + place] >> bit
    if plane != NONE:
        apart ^= plane_word(labels, plane, point >> 6) >> bit
    return apart & ONE
