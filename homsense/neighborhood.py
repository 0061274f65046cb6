"""From a visible set to its neighborhood: hop by hop the union of the facets that meet it."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from homsense.errors import InvalidComplexError
from homsense.facet_table import FacetTable, Numbers, Offsets, Ragged, Version
from homsense.history import History, history


class Neighborhoods(NamedTuple):
    """Landmarks by nearness, and the homology of the full subcomplexes on the nearest of them.

    Parameters
    ----------
    order : ndarray, int32
        Landmark numbers, nearest first.
    ends : ndarray, int64
        How many of them each neighborhood holds.
    homology : History
        One place for each neighborhood.
    """

    order: Numbers
    ends: Offsets
    homology: History


def sense(_: FacetTable, version: Version, seeds: Numbers, radii: Sequence[int]) -> Neighborhoods:
    """Find hop neighborhoods and count their holes in one pass.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    radii : sequence of int
        Hops, rising.

    Returns
    -------
    Neighborhoods
        One for each radius.
    """
    order, ends = hop_order(version, seeds, radii)
    return Neighborhoods(order, ends, history(dual_rows(version, order), ends.tolist()))


def rings(version: Version, seeds: Numbers) -> Iterator[Numbers]:
    """Yield the landmarks at 0, 1, 2... hops in the 1-skeleton, until there are no more.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.

    Yields
    ------
    ndarray, int32
        Landmark numbers; each facet is expanded once.
    """
    reached = np.zeros(version.n_landmarks, np.bool_)
    expanded = np.zeros(version.n_facets, np.bool_)
    ring = seeds
    while len(ring):
        yield ring
        reached[ring] = True
        through = np.unique(version.posting_lists(ring).values)
        entered = through[~expanded[through]]
        expanded[entered] = True
        found = np.unique(version.rows(entered).values)
        ring = found[~reached[found]]


def hop_order(version: Version, seeds: Numbers, radii: Sequence[int]) -> tuple[Numbers, Offsets]:
    """Return the landmarks within some numbers of hops, nearest first.

    Parameters
    ----------
    version : Version
        The complex.
    seeds : ndarray, int32
        Landmark numbers at 0 hops, distinct.
    radii : sequence of int
        Hops, rising.

    Returns
    -------
    order : ndarray, int32
        Landmark numbers.
    ends : ndarray, shape (len(radii),), int64
        How many of them lie within each radius.
    """
    found: list[Numbers] = []
    for hops, ring in enumerate(rings(version, seeds)):
        if hops > radii[-1]:
            break
        found.append(ring)
    sizes = np.cumsum([0, *map(len, found)])
    ends = sizes[np.minimum(np.asarray(radii) + 1, len(found))]
    return np.concatenate([np.empty(0, np.int32), *found]), ends


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


def rising(radii: Iterable[int]) -> list[int]:
    """Return radii, refusing those that fall.

    Parameters
    ----------
    radii : iterable of int
        Hops.

    Returns
    -------
    list of int
        The same.

    Raises
    ------
    InvalidComplexError
        If a radius is negative or the radii decrease.
    """
    wanted = list(radii)
    if any(later < earlier for earlier, later in pairwise([0, *wanted])):
        message = f"hops must be non-negative and rising, not {wanted}"
        raise InvalidComplexError(message, "hops")
    return wanted
