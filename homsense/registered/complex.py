"""The registered complex: scans of a crowd that have places on the map.

How similar two scans are at a distance is learnt once more from the registered crowd, across
walks, so it allows for whatever is wrong with the places.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.registered.registration import Registration
from homsense.registered.similarity import Hearing, ScanIndex, Signature
from homsense.scan import Reading

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

LEVELS = np.array([0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6])
RINGS = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.6, 4.0])
FAR_RINGS = 2
COVERED_SHARE = 0.4
"""Of the reach: how near to a scan the crowd has been."""

ENOUGH = 100
"""Scans on a square of one reach."""

MAPPED, HALF_MAPPED = 0.9, 0.5
_MOST_SAMPLED = 1000
_PRIOR_PAIRS = 0.5


class Sighting(NamedTuple):
    """What a scan says about where it was made: the scans of the crowd that it resembles.

    Parameters
    ----------
    scan : tuple of int
        Scans of the complex, rising.
    level : tuple of int
        How similar each is: how many of `LEVELS` it reaches, at least 1.
    """

    scan: tuple[int, ...]
    level: tuple[int, ...]


def is_unmapped(status: str, coverage: float) -> bool:
    """Tell whether a pose is best called unmapped.

    Parameters
    ----------
    status : str
        Of the pose without a crowd.
    coverage : float
        Share of its mass where the crowd has been.

    Returns
    -------
    bool
        True when a place is told that hardly anybody has been to, or most of what is possible is
        such a place.

    Examples
    --------
    >>> is_unmapped("tracking", 0.8), is_unmapped("diffuse", 0.8), is_unmapped("diffuse", 0.2)
    (True, False, True)
    """
    return coverage < (MAPPED if status in {"tracking", "ambiguous"} else HALF_MAPPED)


@dataclass(frozen=True)
class RegisteredComplex:
    """A crowd that lies on a map.

    Parameters
    ----------
    hearing : Hearing
        What of a scan counts.
    walk : ndarray, shape (N,), int64
        Walk of each scan.
    xy : ndarray, shape (N, 2), float64
        Where it was made, metres.
    signatures : tuple of mapping
        What it heard.
    reach_m : float
        Distance over which scans hear alike, metres.
    registration : Registration
        How the crowd was placed.
    source : ndarray, shape (N,), int64
        Which of the scans that were given.
    """

    hearing: Hearing
    walk: IntArray
    xy: FloatArray
    signatures: tuple[Signature, ...]
    reach_m: float
    registration: Registration
    source: IntArray

    @property
    def size(self) -> int:
        """Number of scans."""
        return len(self.walk)

    def of(self, scans: BoolArray) -> Self:
        """Return the complex of some of the scans.

        Parameters
        ----------
        scans : ndarray, shape (N,), bool
            True for those to keep.

        Returns
        -------
        RegisteredComplex
            As registered.
        """
        return replace(
            self,
            walk=self.walk[scans],
            xy=self.xy[scans],
            signatures=tuple(self.signatures[scan] for scan in np.flatnonzero(scans).tolist()),
            source=self.source[scans],
        )

    def thinned(self, enough: int = ENOUGH) -> Self:
        """Return the complex of no more scans in a place than are of use there.

        Parameters
        ----------
        enough : int, default 100
            Most scans on a square whose side is the reach.

        Returns
        -------
        RegisteredComplex
            Of every scan where they are few.
        """
        square = np.floor(self.xy / self.reach_m)
        _, of_square, counts = np.unique(square, axis=0, return_inverse=True, return_counts=True)
        of_square = of_square.ravel()
        order = np.argsort(of_square, kind="stable")
        rank = np.empty(self.size, np.int64)
        rank[order] = np.arange(self.size) - np.repeat(np.cumsum(counts) - counts, counts)
        # of n on a square, the k-th stays where k * enough / n passes a whole number
        n = np.maximum(counts[of_square], enough)
        return self.of((rank + 1) * enough // n > rank * enough // n)

    def sighting(self, readings: Iterable[Reading]) -> Sighting | None:
        """Compare a scan with the crowd.

        Parameters
        ----------
        readings : iterable of Reading
            The scan.

        Returns
        -------
        Sighting or None
            None when it hears too little; empty when it resembles nothing.
        """
        signature = self.hearing.signature(readings)
        if not signature:
            return None
        level = np.searchsorted(LEVELS, self._index.similarities(signature), side="right")
        scan = np.flatnonzero(level)
        return Sighting(tuple(scan.tolist()), tuple(level[scan].tolist()))

    def covers(self, xy: FloatArray) -> BoolArray:
        """Tell where the crowd has been.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            True within `COVERED_SHARE` of the reach from a scan.
        """
        apart, _ = self._tree.query(xy, distance_upper_bound=COVERED_SHARE * self.reach_m)
        return np.isfinite(apart)

    def ring(self, apart_m: FloatArray) -> IntArray:
        """Return how many of `RINGS`, in reaches, lie within some distances.

        Parameters
        ----------
        apart_m : ndarray, shape (N,), float64
            Distances, metres.

        Returns
        -------
        ndarray, shape (N,), int64
            From 0 to the number of rings.
        """
        return np.searchsorted(RINGS * self.reach_m, apart_m, side="right")

    @cached_property
    def nats(self) -> FloatArray:
        """Log-likelihood of each level in each ring, above that of the level far away.

        Shape (rings + 1, levels + 1).
        """
        pairs = np.full((len(RINGS) + 1, len(LEVELS) + 1), _PRIOR_PAIRS)
        for scan in range(0, self.size, max(1, self.size // _MOST_SAMPLED)):
            others = self.walk != self.walk[scan]
            found = self._index.similarities(self.signatures[scan])[others]
            ring = self.ring(np.linalg.norm(self.xy[others] - self.xy[scan], axis=1))
            cell = ring * pairs.shape[1] + np.searchsorted(LEVELS, found, side="right")
            pairs += np.bincount(cell, minlength=pairs.size).reshape(pairs.shape)
        share = pairs / pairs.sum(axis=1, keepdims=True)
        above: FloatArray = np.log(share / share[-FAR_RINGS:].mean(axis=0))
        return above

    @cached_property
    def _index(self) -> ScanIndex:
        return ScanIndex.of(self.signatures)

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.xy)
