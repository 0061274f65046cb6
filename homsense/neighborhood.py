"""From a visible set to its neighborhood: hop by hop the union of the facets that meet it."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from heapq import heapify, heappop, heappush
from itertools import accumulate, islice
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidComplexError
from homsense.facet_table import FacetTable, Numbers, Ragged, Version
from homsense.history import History, history

Radius = TypeVar("Radius", int, float)


class Neighborhoods(NamedTuple):
    """Landmarks by nearness, and the homology of the full subcomplexes on the nearest of them.

    Parameters
    ----------
    order : ndarray, int32
        Landmark numbers, nearest first.
    ends : sequence of int
        How many of them each neighborhood holds.
    homology : History
        One place for each neighborhood.
    """

    order: Numbers
    ends: Sequence[int]
    homology: History


def sense(
    _: FacetTable, version: Version, seeds: Numbers, radii: Sequence[int], without: Numbers
) -> Neighborhoods:
    """Find hop neighborhoods and count their holes in one pass.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    radii : sequence of int
        Hops, rising.
    without : ndarray, int32
        Landmarks that are left out of the complex.

    Returns
    -------
    Neighborhoods
        One for each radius.
    """
    order, ends = hop_order(version, seeds, radii, without)
    return Neighborhoods(order, ends, history(dual_rows(version, order), ends))


def rings(version: Version, seeds: Numbers, without: Numbers | None = None) -> Iterator[Numbers]:
    """Yield the landmarks at 0, 1, 2... hops in the 1-skeleton, until there are no more.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    without : ndarray, int32, optional
        Landmarks that are left out of the complex.

    Yields
    ------
    ndarray, int32
        Landmark numbers; each facet is expanded once.
    """
    reached = np.zeros(version.n_landmarks, np.bool_)
    if without is not None:
        reached[without] = True
    expanded = np.zeros(version.n_facets, np.bool_)
    ring = seeds[~reached[seeds]]
    while len(ring):
        yield ring
        reached[ring] = True
        through = np.unique(version.posting_lists(ring).values)
        entered = through[~expanded[through]]
        expanded[entered] = True
        found = np.unique(version.rows(entered).values)
        ring = found[~reached[found]]


def hop_order(
    version: Version, seeds: Numbers, radii: Sequence[int], without: Numbers | None = None
) -> tuple[Numbers, list[int]]:
    """Return the landmarks within some numbers of hops, nearest first.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    radii : sequence of int
        Hops, rising.
    without : ndarray, int32, optional
        Landmarks that are left out of the complex.

    Returns
    -------
    order : ndarray, int32
        Landmark numbers.
    ends : list of int
        How many of them lie within each radius.
    """
    found = list(islice(rings(version, seeds, without), radii[-1] + 1))
    sizes = list(accumulate(map(len, found), initial=0))
    ends = [sizes[min(radius + 1, len(found))] for radius in radii]
    return np.concatenate([np.empty(0, np.int32), *found]), ends


def metric_order(
    version: Version,
    seeds: Numbers,
    radii_m: Sequence[float],
    range_m: NDArray[np.float64],
    without: Numbers,
) -> tuple[Numbers, list[int]]:
    """Return the landmarks within some pseudo-distances, nearest first.

    An edge is as long as the mean range of its two landmarks, so it is `s_max` when all ranges
    are. Facets are entered in the order of the distance halfway across their first edge, so the
    first way to a landmark is the shortest.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at distance 0, distinct.
    radii_m : sequence of float
        r_pseudo, metres, rising.
    range_m : ndarray, shape (n_landmarks,), float64
        Range of each landmark, metres, positive.
    without : ndarray, int32
        Landmarks that are left out of the complex.

    Returns
    -------
    order : ndarray, int32
        Landmark numbers.
    ends : list of int
        How many of them lie within each radius.
    """
    left_out = set(without.tolist())
    distance = dict.fromkeys(set(seeds.tolist()) - left_out, 0.0)
    entered: set[int] = set()
    queue = [(float(range_m[seed]) / 2, seed) for seed in distance]
    heapify(queue)
    while queue:
        halfway, landmark = heappop(queue)
        through = version.posting_lists(np.array([landmark], np.int32)).values
        fresh = [facet for facet in through.tolist() if facet not in entered]
        entered.update(fresh)
        for other in set(version.rows(np.array(fresh, np.int32)).values.tolist()):
            there = halfway + float(range_m[other]) / 2
            if other not in distance and other not in left_out and there <= radii_m[-1]:
                distance[other] = there
                heappush(queue, (there + float(range_m[other]) / 2, other))
    order = sorted(distance, key=lambda landmark: (distance[landmark], landmark))
    distances = [distance[landmark] for landmark in order]
    return np.array(order, np.int32), [bisect_right(distances, radius) for radius in radii_m]


def nearness_order(version: Version) -> Numbers:
    """Return all landmarks so that neighbors stand close, which the engine likes.

    Parameters
    ----------
    version : Version
        The complex.

    Returns
    -------
    ndarray, int32
        Landmark numbers, one component after the other.
    """
    left = np.ones(version.n_landmarks, np.bool_)
    found: list[Numbers] = [np.empty(0, np.int32)]
    for landmark in range(version.n_landmarks):
        if left[landmark]:
            for ring in rings(version, np.array([landmark], np.int32)):
                left[ring] = False
                found.append(ring)
    return np.concatenate(found)


def dual_rows(version: Version, landmarks: Numbers) -> Ragged:
    """Return posting lists with the facets numbered as they first occur.

    Parameters
    ----------
    version : Version
        The complex.
    landmarks : ndarray, int32
        Landmark numbers.

    Returns
    -------
    Ragged
        The generating simplices of the Dowker dual of the full subcomplex on the landmarks.
    """
    lists = version.posting_lists(landmarks)
    return Ragged(lists.ends, _by_occurrence(lists.values))


def _by_occurrence(values: Numbers) -> Numbers:
    _, first, inverse = np.unique(values, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int32)
    rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return rank[inverse]


def rising(radii: Iterable[Radius]) -> list[Radius]:
    """Return radii, refusing those that fall.

    Parameters
    ----------
    radii : iterable of int or float
        Hops or metres.

    Returns
    -------
    list of int or float
        The same.

    Raises
    ------
    InvalidComplexError
        If a radius is negative or the radii decrease.
    """
    wanted: list[Radius] = list(radii)
    if not all(radius >= 0 for radius in wanted) or wanted != sorted(wanted):
        message = f"radii (hops or metres) must be non-negative and rising, not {wanted}"
        raise InvalidComplexError(message, "radii")
    return wanted
