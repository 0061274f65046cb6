"""Row-by-row Mayer-Vietoris, compiled; `homsense.homology` is the reference and explains it.

There is no limit to the generators: when a table is full, `history` starts again with larger
ones.
"""

import numpy as np

from homsense.compiled.bit_strings import ONE, ZERO, BitStrings, Ints, both_ways, word_of
from homsense.compiled.collapse import collapse
from homsense.compiled.cover import cover, lies_in_one
from homsense.compiled.glue import N_ACTIVE, N_PIECES, N_SLOTS, Glue, no_glue
from homsense.compiled.jit import allocating, apart, inlined
from homsense.compiled.labels import FULL, N_GENERATORS, Labels, no_labels
from homsense.compiled.relations import bear, check, keep

_RECENT = 8
_WORTH_A_COLLAPSE = 512


@allocating
def history(
    ends: Ints, points: Ints, n_points: int, n_whole: int, stages: Ints, found: Ints
) -> None:
    """Find b0 of each stage, and the classes born in stage i that live in stage j.

    Parameters
    ----------
    ends, points : ndarray, int64 and int32
        Rows in the form of `Ragged`.
    n_points, n_whole : int
        All points lie below the first; those below the second are known not to be dominated.
    stages : ndarray, int64
        How many rows each stage has, not falling.
    found : ndarray, shape (1 + n_stages, n_stages), int64
        All 0; gets b0, and below it the bars as in `homsense.history.History`.
    """
    rows, through = both_ways(ends, points, n_points)
    if len(ends) > _WORTH_A_COLLAPSE:
        collapse(rows, through, n_whole, stages)
    widest = 1
    for row in range(len(ends) - 1):
        widest = max(widest, rows.high[row] - rows.low[row])
    room = 32
    while True:
        labels = no_labels(len(ends) - 1, widest, room)
        glue = no_glue(len(ends) - 1, widest, room)
        seen = np.zeros((n_points >> 6) + 1, np.uint64)
        parent = np.arange(len(ends) - 1)
        last = np.empty(_RECENT, np.uint32)
        _add_rows(rows, through, labels, glue, seen, parent, last, stages, found[0])
        if not labels.counts[FULL]:
            _count_bars(labels, stages, found[1:])
            return
        room *= 4


@apart
def _count_bars(labels: Labels, stages: Ints, bars: Ints) -> None:
    for generator in range(labels.counts[N_GENERATORS]):
        born = 0
        while stages[born] <= labels.births[generator]:
            born += 1
        for stage in range(born, len(stages)):
            if labels.deaths[generator] >= stages[stage]:
                bars[born, stage] += 1


@apart
def _add_rows(
    rows: BitStrings,
    through: BitStrings,
    labels: Labels,
    glue: Glue,
    seen: Ints,
    parent: Ints,
    last: Ints,
    stages: Ints,
    components: Ints,
) -> None:
    """Add row by row until the last stage is reached or a table is full.

    A row that is a face of one of the last adds nothing.
    """
    total = len(rows.low)
    added = n_components = stage = 0
    for row in range(total + 1):
        while stage < len(stages) and stages[stage] == row:
            components[stage] = n_components
            stage += 1
        if stage == len(stages):
            return
        if not rows.size[row]:
            continue
        n_active, fresh = 0, ZERO
        for place in range(rows.low[row], rows.high[row]):
            word = np.uint32(place)
            here = word_of(rows, rows.at[row], word)
            if here & seen[word]:
                glue.active[n_active] = word
                glue.shared[n_active] = here & seen[word]
                n_active += 1
            fresh |= here & ~seen[word]
            seen[word] |= here
        glue.counts[N_ACTIVE] = n_active
        if n_active and lies_in_one(glue, rows, last, added) and not fresh:
            continue
        n_components += 1
        if n_active:
            cover(glue, labels, rows, through)
            check(glue, labels, rows, through, row)
            for piece in range(glue.counts[N_PIECES]):
                root = _root(parent, glue.roots[piece])
                if root == row:
                    bear(glue, labels, row, piece)
                else:
                    parent[root] = row
                    n_components -= 1
            if glue.counts[N_SLOTS]:
                keep(glue, labels, rows, row)
            if labels.counts[FULL]:
                return
        last[added % _RECENT] = row
        added += 1
        glue.added[row >> 6] |= ONE << np.uint64(row & 63)


@inlined
def _root(parent: Ints, row: int) -> int:
    while parent[row] != row:
        parent[row] = parent[parent[row]]
        row = parent[row]
    return row
