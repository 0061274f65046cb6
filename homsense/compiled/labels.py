"""The potentials of the live classes: for each generator, the points of a simplex where it is 1.

Such a set of points is a *plane*. Planes hang in two chains: those of a simplex, and those of a
generator. Constant planes are left out.
"""

from typing import Any, NamedTuple

import numpy as np

from homsense.compiled.bit_strings import NONE, ONE, ZERO, BitStrings, Ints
from homsense.compiled.jit import allocating, apart, inlined

FOREVER = np.iinfo(np.int64).max

N_PLANES, N_WORDS, N_GENERATORS, FULL = 0, 1, 2, 3


class Labels(NamedTuple):
    """All planes, and the generators that they belong to.

    Parameters
    ----------
    first : ndarray, shape (n_rows,), int64
        The first plane of a simplex, or `NONE`.
    row, generator, at, next_of_row, next_of_generator : ndarray, int64
        For each plane: where it hangs; word w of it is ``words[at + w]``. A plane that was taken
        away has no generator.
    words : ndarray, uint64
        All planes.
    carriers : ndarray, int64
        The first plane of a generator, or `NONE`.
    births, deaths : ndarray, int64
        The rows at which a generator was born and killed.
    labelled : ndarray, uint64
        Which simplices have planes, as one bit string.
    counts : ndarray, int64
        Planes, words and generators in use; whether a table was too small.
    """

    first: Ints
    row: Ints
    generator: Ints
    at: Ints
    next_of_row: Ints
    next_of_generator: Ints
    words: Ints
    carriers: Ints
    births: Ints
    deaths: Ints
    labelled: Ints
    counts: Ints


@allocating
def no_labels(n_rows: int, widest: int, room: int) -> Labels:
    """Return empty tables.

    Parameters
    ----------
    n_rows : int
        How many simplices there will be.
    widest : int
        Words of the widest one.
    room : int
        How many generators there may be.

    Returns
    -------
    Labels
        Room for some planes more than that.
    """
    planes = 2 * room + n_rows
    table = np.empty((5, planes), np.int64)
    births = np.empty((3, room), np.int64)
    return Labels(
        np.full(n_rows, NONE, np.int64),
        table[0],
        table[1],
        table[2],
        table[3],
        table[4],
        np.empty(planes * widest, np.uint64),
        births[0],
        births[1],
        births[2],
        np.zeros((n_rows >> 6) + 1, np.uint64),
        np.zeros(4, np.int64),
    )


@inlined
def plane_of(labels: Labels, row: int, generator: int) -> int:
    """Return the plane of a generator on a simplex, or `NONE` when it is constant there."""
    plane = labels.first[row]
    while plane != NONE and labels.generator[np.uint64(plane)] != generator:
        plane = labels.next_of_row[np.uint64(plane)]
    return plane


@inlined
def plane_word(labels: Labels, plane: int, word: int) -> Any:
    """Return one word of a plane that has it."""
    return labels.words[np.uint64(labels.at[np.uint64(plane)] + word)]


@inlined
def new_plane(labels: Labels, row: int, generator: int, low: int, high: int) -> int:
    """Hang a plane of undefined words ``low`` to ``high`` into both chains.

    Parameters
    ----------
    labels : Labels
        Gets the plane.
    row, generator : int
        Where it hangs.
    low, high : int
        The words that it has.

    Returns
    -------
    int
        Its number, or `NONE` when there is no room; then the flag is set.
    """
    counts = labels.counts
    plane, place = counts[N_PLANES], counts[N_WORDS]
    if plane == len(labels.row) or place + high - low > len(labels.words):
        counts[FULL] = 1
        return NONE
    labels.row[plane], labels.generator[plane] = row, generator
    labels.at[plane] = place - low
    labels.next_of_row[plane] = labels.first[row]
    labels.first[row] = plane
    labels.next_of_generator[plane] = labels.carriers[generator]
    labels.carriers[generator] = plane
    labels.labelled[row >> 6] |= ONE << np.uint64(row & 63)
    counts[N_PLANES] += 1
    counts[N_WORDS] += high - low
    return plane


@apart
def take_away(labels: Labels, plane: int) -> None:
    """Take a plane out of its simplex; the chain of its generator skips it from now on."""
    row = labels.row[plane]
    if labels.first[row] == plane:
        labels.first[row] = labels.next_of_row[plane]
    else:
        before = labels.first[row]
        while labels.next_of_row[before] != plane:
            before = labels.next_of_row[before]
        labels.next_of_row[before] = labels.next_of_row[plane]
    labels.generator[plane] = NONE
    if labels.first[row] == NONE:
        labels.labelled[row >> 6] &= ~(ONE << np.uint64(row & 63))


@apart
def substitute(
    labels: Labels, rows: BitStrings, relation: Ints, n_relation: int, youngest: int
) -> None:
    """Replace a generator by the sum of the others in a relation, wherever it labels a simplex."""
    plane = labels.carriers[youngest]
    while plane != NONE:
        if labels.generator[plane] == youngest:
            row, at = labels.row[plane], labels.at[plane]
            take_away(labels, plane)
            for place in range(n_relation):
                if relation[place] == youngest:
                    continue
                mixed = plane_of(labels, row, relation[place])
                if mixed == NONE:
                    copy = new_plane(labels, row, relation[place], rows.low[row], rows.high[row])
                    if copy == NONE:
                        return
                    for word in range(rows.low[row], rows.high[row]):
                        labels.words[labels.at[copy] + word] = labels.words[at + word]
                    continue
                some = rest = ZERO
                for word in range(rows.low[row], rows.high[row]):
                    labels.words[labels.at[mixed] + word] ^= labels.words[at + word]
                    some |= labels.words[labels.at[mixed] + word]
                    rest |= (
                        rows.words[rows.at[row] + word] & ~labels.words[labels.at[mixed] + word]
                    )
                if not (some and rest):
                    take_away(labels, mixed)
        plane = labels.next_of_generator[plane]
