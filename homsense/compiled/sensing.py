"""From a visible set to the homology of its neighborhoods, compiled.

What was met is marked with the number of the query, so nothing is ever cleared and the cost
follows the neighborhood, not the site.
"""

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.bit_strings import ONE
from homsense.compiled.jit import allocating, apart
from homsense.compiled.mayer_vietoris import history
from homsense.facet_table import Version

Ints = NDArray[Any]

_MOST_QUERIES = np.iinfo(np.int32).max


class Workspace(NamedTuple):
    """Marks for one query at a time.

    Parameters
    ----------
    landmark_mark : ndarray, int32
        The query that met a landmark.
    facet_mark, facet_point : ndarray, int32
        The query that met a facet, and the number that it got there.
    order, row_ends : ndarray, int32 and int64
        Landmarks as they are met; where their rows end.
    counts : ndarray, shape (2,), int64
        Queries so far; room for the points of one.
    """

    landmark_mark: Ints
    facet_mark: Ints
    facet_point: Ints
    order: Ints
    row_ends: Ints
    counts: Ints

    @classmethod
    def of(cls, version: Version) -> Self:
        """Return room for a version and somewhat larger ones.

        Parameters
        ----------
        version : Version
            The complex.

        Returns
        -------
        Workspace
            Fresh marks.
        """
        landmarks, facets = version.n_landmarks * 5 // 4 + 16, version.n_facets * 5 // 4 + 16
        return cls(
            np.zeros(landmarks, np.int32),
            np.zeros(facets, np.int32),
            np.zeros(facets, np.int32),
            np.zeros(landmarks, np.int32),
            np.zeros(landmarks + 1, np.int64),
            np.array([0, 4096]),
        )

    def suffices(self, version: Version) -> bool:
        """Tell whether a version fits.

        Parameters
        ----------
        version : Version
            The complex.

        Returns
        -------
        bool
            False when it has grown too large, or the numbers of queries run out.
        """
        return (
            version.n_landmarks <= len(self.landmark_mark)
            and version.n_facets <= len(self.facet_mark)
            and self.counts[0] < _MOST_QUERIES
        )


@allocating
def sense(
    version: Version, seeds: Ints, radii: Ints, without: Ints, workspace: Workspace
) -> tuple[Ints, Ints]:
    """Return the landmarks by nearness, and the end of each neighborhood with its homology.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    radii : ndarray, int64
        Hops, rising.
    without : ndarray, int32
        Landmarks that are left out of the complex.
    workspace : Workspace
        Marks.

    Returns
    -------
    order : ndarray, int32
        Landmark numbers.
    found : ndarray, shape (2 + len(radii), len(radii)), int64
        How many of them each neighborhood holds; below it what
        `homsense.compiled.mayer_vietoris.history` finds.
    """
    found = np.zeros((2 + len(radii), len(radii)), np.int64)
    ends = found[0]
    while True:
        points = np.empty(workspace.counts[1], np.int32)
        n_points, n_whole = _search(version, seeds, radii, without, workspace, ends, points)
        if n_points >= 0:
            break
        workspace.counts[1] *= 2
    history(workspace.row_ends[: ends[-1] + 1], points, n_points, n_whole, ends, found[1:])
    return workspace.order[: ends[-1]].copy(), found


@apart
def _search(
    version: Version,
    seeds: Ints,
    radii: Ints,
    without: Ints,
    workspace: Workspace,
    ends: Ints,
    points: Ints,
) -> tuple[int, int]:
    """Search hop by hop; the posting list of each landmark met is a row of the dual.

    Return the number of facets met, which are the points of the rows, and how many of them lie in
    the widest neighborhood as a whole, so that none of those is dominated; -1 when `points` is
    too short.
    """
    workspace.counts[0] += 1
    query, n_facets = workspace.counts[0], version.n_facets
    found = n_points = n_whole = hops = place = size = 0
    for landmark in without:
        workspace.landmark_mark[landmark] = query
    for landmark in seeds:
        if workspace.landmark_mark[landmark] != query:
            workspace.landmark_mark[landmark] = query
            workspace.order[found] = landmark
            found += 1
    for stage in range(len(radii) + 1):
        is_last = stage == len(radii)
        while hops < radii[stage] if not is_last else place < found:
            stop = found
            while place < stop:
                start = version.posting_start[workspace.order[place]]
                if size + version.postings[start] > len(points):
                    return -1, 0
                at = np.uint64(start + 1)
                while version.postings[at] < n_facets:
                    facet = np.uint32(version.postings[at])
                    at += ONE
                    if workspace.facet_mark[facet] != query:
                        if version.swallowed_by[facet] < n_facets:
                            continue
                        workspace.facet_mark[facet] = query
                        workspace.facet_point[facet] = n_points
                        n_points += 1
                        if not is_last:
                            for entry in range(
                                version.row_start[facet], version.row_start[facet + 1]
                            ):
                                landmark = np.uint32(version.points[np.uint64(entry)])
                                if workspace.landmark_mark[landmark] != query:
                                    workspace.landmark_mark[landmark] = query
                                    workspace.order[np.uint64(found)] = landmark
                                    found += 1
                    points[np.uint64(size)] = workspace.facet_point[facet]
                    size += 1
                place += 1
                workspace.row_ends[place] = size
            hops += 1
        if not is_last:
            ends[stage] = found
            n_whole = n_points
    return n_points, n_whole
