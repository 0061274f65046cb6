"""Transmitters that have moved, found by what they join: regions that are far apart otherwise.

All landmarks that were ever seen together with one landmark lie within twice the sensing range of
it, unless it has moved in between; then they fall into groups that are far apart in the rest of
the complex, and the landmark is a false short-cut between them. Distances are means over a group:
where several have moved, some other false short-cut leads to the nearest of it. No position is
used.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from homsense import neighborhood
from homsense.facet_table import Numbers, Version
from homsense.simplicial import LandmarkComplex

FAR_HOPS, SUPPORT = 2.0, 3
_COMPANION = 0.5


@dataclass(frozen=True, slots=True)
class Displaced:
    """A landmark that has been at two places.

    Parameters
    ----------
    landmark : str
        Its identifier.
    hops_apart : float, optional
        How far those seen there are from the nearest of those seen here, without it, in the mean;
        ``None`` when nothing else joins the two places.
    here, there : tuple of str
        Who was seen beside it at the one and the other place, sorted; the larger group first.
    """

    landmark: str
    hops_apart: float | None
    here: tuple[str, ...]
    there: tuple[str, ...]


def displaced(
    landmark_complex: LandmarkComplex,
    landmarks: Iterable[str] | None = None,
    *,
    far_hops: float = FAR_HOPS,
    support: int = SUPPORT,
) -> list[Displaced]:
    """Return the landmarks that join regions which are far apart otherwise.

    Companions, landmarks that are nearly always seen with the one in question, such as the other
    identifiers of the same transmitter, are left out with it.

    Parameters
    ----------
    landmark_complex : LandmarkComplex
        The complex.
    landmarks : iterable of str, optional
        Which ones to look at; all by default.
    far_hops : float, default 2
        Hops, in the mean, that make regions far apart.
    support : int, default 3
        Facets through the landmark that must speak for either place; fewer may be a hole of the
        crowd, not a move.

    Returns
    -------
    list of Displaced
        Sorted by landmark.

    Examples
    --------
    >>> street = [{f"l{n:02d}", f"l{n + 1:02d}", f"l{n + 2:02d}"} for n in range(20)]
    >>> car = [{"car", f"l{n:02d}", f"l{n + 1:02d}"} for n in (2, 3, 4, 14, 15, 16)]
    >>> k = LandmarkComplex.from_observations([*street, *car])
    >>> [(found.landmark, found.hops_apart) for found in displaced(k)]
    [('car', 5.5)]
    """
    wanted = landmark_complex.landmarks if landmarks is None else landmarks
    found, version = [], landmark_complex.version
    numbers = np.sort(landmark_complex.numbers(wanted))
    facets = np.diff(version.posting_lists(numbers).ends)
    for number in numbers[facets >= 2 * support].tolist():
        parts = _far_parts(version, number, far_hops, support)
        if parts is not None:
            hops, here, there = parts
            (name,) = landmark_complex.names(np.array([number], np.int32))
            beside = [tuple(sorted(landmark_complex.names(part))) for part in (here, there)]
            found.append(Displaced(name, hops, beside[0], beside[1]))
    return sorted(found, key=lambda one: one.landmark)


def _far_parts(
    version: Version, number: int, far_hops: float, support: int
) -> tuple[float | None, Numbers, Numbers] | None:
    """Return the distance of the farthest group of the link from the largest, and both groups."""
    without = _companions(version, number)
    through = version.posting_lists(np.array([number], np.int32)).values
    groups = [
        group
        for group in _link_groups(version, without)
        if _support(version, group, through) >= support
    ]
    if len(groups) <= 1:
        return None
    distance = _distances(version, groups[0], without)
    hops, farthest = max((float(distance[group].mean()), at) for at, group in enumerate(groups))
    if hops < far_hops:
        return None
    return None if hops == version.n_landmarks else hops, groups[0], groups[farthest]


def _support(version: Version, group: Numbers, through: Numbers) -> int:
    """Return how many of some facets hold a landmark of a group."""
    return int(np.isin(through, version.posting_lists(group).values).sum())


def _companions(version: Version, number: int) -> Numbers:
    """Return a landmark and those whose facets are by half or more the same."""
    own = version.posting_lists(np.array([number], np.int32)).values
    near, shared = np.unique(version.rows(own).values, return_counts=True)
    sizes = np.diff(version.posting_lists(near).ends)
    return near[shared >= _COMPANION * (len(own) + sizes - shared)]


def _link_groups(version: Version, without: Numbers) -> list[Numbers]:
    """Return what was seen beside some landmarks, by connected component, the largest first."""
    facets = np.unique(version.posting_lists(without).values)
    left_out = set(without.tolist())
    groups: list[set[int]] = []
    for row in version.rows(facets).lists():
        joined = set(row) - left_out
        apart = []
        for group in groups:
            if group.isdisjoint(joined):
                apart.append(group)
            else:
                joined |= group
        groups = [*apart, joined] if joined else apart
    groups.sort(key=lambda group: (-len(group), sorted(group)))
    return [np.array(sorted(group), np.int32) for group in groups]


def _distances(version: Version, start: Numbers, without: Numbers) -> Numbers:
    """Return hops from a group without some landmarks; the number of all where there is no way."""
    distance = np.full(version.n_landmarks, version.n_landmarks, np.int32)
    for hops, ring in enumerate(neighborhood.rings(version, start, without)):
        distance[ring] = hops
    return distance
