"""Joining scans into the facet table, compiled; `homsense.insertion` is the reference."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.jit import allocating
from homsense.facet_table import NEVER

Ints = NDArray[Any]


@allocating
def insert(
    ends: Ints,
    scans: Ints,
    first: int,
    row_start: Ints,
    points: Ints,
    swallowed_by: Ints,
    posting_start: Ints,
    postings: Ints,
    used: Ints,
    tally: Ints,
    counts: Ints,
) -> int:
    """Insert scans until all are in or an array is full.

    Parameters
    ----------
    ends, scans : ndarray, int64 and int32
        Scans in the form of `Ragged`.
    first : int
        How many are done already.
    row_start, points, swallowed_by, posting_start, postings, used, tally : ndarray
        The arrays of `FacetTable`.
    counts : ndarray, shape (3,), int64
        Facets, words of postings, points of swallowed facets.

    Returns
    -------
    int
        How many scans are done.
    """
    touched = np.empty(len(tally), np.int32)
    for number in range(first, len(ends) - 1):
        scan = scans[ends[number] : ends[number + 1]]
        if _lies_in_a_facet(scan, row_start, points, swallowed_by, posting_start, postings, used):
            continue
        facet, n_postings = counts[0], counts[1]
        start = row_start[facet]
        room = n_postings
        for landmark in scan:
            if used[landmark] == postings[posting_start[landmark]]:
                room += max(2, 2 * used[landmark]) + 2
        if facet >= len(swallowed_by) or start + len(scan) > len(points) or room > len(postings):
            return number
        n_touched = 0
        for landmark in scan:
            at = posting_start[landmark] + 1
            while postings[at] != NEVER:
                other = postings[at]
                at += 1
                if swallowed_by[other] != NEVER:
                    continue
                if tally[other] == 0:
                    touched[n_touched] = other
                    n_touched += 1
                tally[other] += 1
        for other in touched[:n_touched]:
            size = row_start[other + 1] - row_start[other]
            if tally[other] == size:
                swallowed_by[other] = facet
                counts[2] += size
            tally[other] = 0
        points[start : start + len(scan)] = scan
        row_start[facet + 1] = start + len(scan)
        for landmark in scan:
            here, count = posting_start[landmark], used[landmark]
            if count == postings[here]:
                moved = counts[1]
                capacity = max(2, 2 * count)
                postings[moved] = capacity
                for entry in range(1, count + 1):
                    postings[moved + entry] = postings[here + entry]
                counts[1] += capacity + 2
                posting_start[landmark] = here = moved
            postings[here + 1 + count] = facet
            used[landmark] = count + 1
        counts[0] += 1
    return len(ends) - 1


@allocating
def _lies_in_a_facet(
    scan: Ints,
    row_start: Ints,
    points: Ints,
    swallowed_by: Ints,
    posting_start: Ints,
    postings: Ints,
    used: Ints,
) -> bool:
    rarest = scan[0]
    for landmark in scan:
        if used[landmark] < used[rarest]:
            rarest = landmark
    at = posting_start[rarest] + 1
    while postings[at] != NEVER:
        facet = postings[at]
        at += 1
        here, end = row_start[facet], row_start[facet + 1]
        if swallowed_by[facet] != NEVER or end - here < len(scan):
            continue
        found = 0
        while here < end and found < len(scan):
            if points[here] == scan[found]:
                found += 1
            elif points[here] > scan[found]:
                break
            here += 1
        if found == len(scan):
            return True
    return False
