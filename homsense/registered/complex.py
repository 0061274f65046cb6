"""The registered complex: scans of a crowd that have places on the map.

How similar two scans are at a distance is learnt once more from the registered crowd, across
walks, so it allows for whatever is wrong with the places.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.exact import log2
from homsense.registered.registration import Registration
from homsense.registered.similarity import Hearing, ScanIndex, Signature
from homsense.scalar import LN_2
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

NEVER_SURE = 0.1
"""Least share of the mass to reckon with where the crowd has been, and where it has not."""

EVEN_ODDS = 0.5
"""A pose is called unmapped when its coverage is less."""

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
    landmark : tuple of int
        Landmarks that it hears, of those that the complex knows.
    height_db : tuple of int
        How far above what just counts each is heard, from 1, dB.
    """

    scan: tuple[int, ...]
    level: tuple[int, ...]
    landmark: tuple[int, ...] = ()
    height_db: tuple[int, ...] = ()

    @property
    def highest(self) -> int:
        """The level of the most similar one; 0 if it resembles nothing."""
        return max(self.level, default=0)


class _Learnt(NamedTuple):
    """Pairs of scans of different walks by ring and level; scans by whether others were near."""

    pairs: FloatArray
    scans: FloatArray


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
    rivals : tuple of ndarray, shape (N, 2), float64
        Where the scans lie under the next placements, as long as these are nearly as good.
    """

    hearing: Hearing
    walk: IntArray
    xy: FloatArray
    signatures: tuple[Signature, ...]
    reach_m: float
    registration: Registration
    source: IntArray
    rivals: tuple[FloatArray, ...] = ()

    @property
    def placed(self) -> tuple[Self, ...]:
        """The crowd under each placement that it may have, the best first."""
        if not self.rivals:
            return (self,)
        return tuple(replace(self, xy=xy, rivals=()) for xy in (self.xy, *self.rivals))

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
            rivals=tuple(xy[scans] for xy in self.rivals),
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
        return self.compared(signature) if signature else None

    def own_sighting(self, scan: int) -> Sighting:
        """Compare one of the crowd's own scans with all of them, itself included.

        Parameters
        ----------
        scan : int
            Number of the scan.

        Returns
        -------
        Sighting
            What it resembles.
        """
        return self.compared(self.signatures[scan])

    def compared(self, signature: Signature) -> Sighting:
        """Compare with the crowd what a scan hears.

        Parameters
        ----------
        signature : mapping of str to float
            From `Hearing.signature`.

        Returns
        -------
        Sighting
            What it resembles.
        """
        level = np.searchsorted(LEVELS, self.index.similarities(signature), side="right")
        scan = np.flatnonzero(level)
        column = self.index.column
        known = {column[name]: part for name, part in signature.items() if name in column}
        height_db = self.hearing.heights_db(np.array([*known.values()])).astype(np.int64)
        return Sighting(
            tuple(scan.tolist()),
            tuple(level[scan].tolist()),
            tuple(known),
            tuple(height_db.tolist()),
        )

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

    def coverage(self, share: float, level: int | None) -> float:
        """Return how likely the crowd has been where a device is.

        Parameters
        ----------
        share : float
            Of the mass of its pose, how much lies where the crowd has been.
        level : int or None
            The highest one of its last `Sighting`; None before the first.

        Returns
        -------
        float
            Bayes' rule: how much a scan resembles those of others where they have been, and where
            they have not, is learnt from the crowd, walk by walk.
        """
        even = min(max(share, NEVER_SURE), 1.0 - NEVER_SURE)
        nats = 0.0 if level is None else float(self.coverage_nats[level])
        return 1.0 / (1.0 + (1.0 - even) / even * math.exp(-nats))

    @cached_property
    def nats(self) -> FloatArray:
        """Log-likelihood of each level in each ring, above that of the level far away.

        Shape (rings + 1, levels + 1).
        """
        pairs = self._learnt.pairs
        share = pairs / pairs.sum(axis=1, keepdims=True)
        above: FloatArray = np.log(share / share[-FAR_RINGS:].mean(axis=0))
        return above

    @cached_property
    def coverage_nats(self) -> FloatArray:
        """How much likelier each highest level is where others have been, shape (levels + 1,)."""
        scans = self._learnt.scans
        elsewhere, near = log2(scans / scans.sum(axis=1, keepdims=True))
        above: FloatArray = LN_2 * (near - elsewhere)
        return above

    @cached_property
    def _learnt(self) -> _Learnt:
        pairs = np.full((len(RINGS) + 1, len(LEVELS) + 1), _PRIOR_PAIRS)
        scans = np.full((2, len(LEVELS) + 1), _PRIOR_PAIRS)
        for scan in range(0, self.size, max(1, self.size // _MOST_SAMPLED)):
            others = self.walk != self.walk[scan]
            found = self.index.similarities(self.signatures[scan])[others]
            level = np.searchsorted(LEVELS, found, side="right")
            apart = np.linalg.norm(self.xy[others] - self.xy[scan], axis=1)
            cell = self.ring(apart) * pairs.shape[1] + level
            pairs += np.bincount(cell, minlength=pairs.size).reshape(pairs.shape)
            is_near = apart.min(initial=np.inf) <= COVERED_SHARE * self.reach_m
            scans[int(is_near), level.max(initial=0)] += 1.0
        return _Learnt(pairs, scans)

    @cached_property
    def index(self) -> ScanIndex:
        """The scans by landmark; it gives landmarks their numbers."""
        return ScanIndex.of(self.signatures)

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.xy)
