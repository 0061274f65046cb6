"""The registered complex: scans of a crowd that have places on the map.

How similar two scans are at a distance is learnt once more from the registered crowd, across
walks, so it allows for whatever is wrong with the places.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.registered.crowd import NEIGHBORS, Crowd, Likeness, WalkScan, likeness
from homsense.registered.layout import Layout, Pull, largest_part, lay_out, settle
from homsense.registered.registration import (
    DISTINCT_M,
    Ground,
    Placement,
    Registration,
    apart,
    register,
    unlikely_m,
)
from homsense.registered.similarity import Hearing, ScanIndex, Signature
from homsense.scan import Reading

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

LEVELS = np.array([0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6])
RINGS = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.6, 4.0])
FAR_RINGS = 2
GROUND_SD_M = 3.0
COVERED_SHARE = 0.5
MAPPED, HALF_MAPPED = 0.9, 0.5
PLAUSIBLE_M = 1.0
STAGES = ("heard", "compared", "laid out", "registered", "settled")
_MOST_SAMPLED = 1000
_PRIOR_PAIRS = 0.5
_MIRROR = np.array([-1.0, 1.0])


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
            True within half a reach of a scan.
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


@dataclass(frozen=True)
class LaidOutCrowd:
    """A crowd in a frame of its own, ready to be placed on any map.

    Parameters
    ----------
    hearing : Hearing
        What of a scan counts.
    crowd : Crowd
        The scans.
    like : Likeness
        Which of them are alike.
    layout : Layout
        Where they were made, in that frame.
    """

    hearing: Hearing
    crowd: Crowd
    like: Likeness
    layout: Layout

    @classmethod
    def of(
        cls,
        scans: Iterable[WalkScan],
        hearing: Hearing | None = None,
        neighbors: int = NEIGHBORS,
        on_stage: Callable[[str], None] = lambda _stage: None,
    ) -> Self:
        """Lay a crowd out.

        Parameters
        ----------
        scans : iterable of WalkScan
            The crowd.
        hearing : Hearing, optional
            What of a scan counts.
        neighbors : int, default 4
            Most similar scans that each scan is joined with.
        on_stage : callable, optional
            Told each of `STAGES` when it is reached.

        Returns
        -------
        LaidOutCrowd
            Without any map.

        Raises
        ------
        InvalidInputError
            If the crowd is too small to be laid out.
        """
        rule = hearing or Hearing()
        crowd = Crowd.of(scans, rule)
        on_stage("heard")
        like = likeness(crowd, neighbors)
        on_stage("compared")
        if not len(like.first):
            message = "no two walks have heard alike"
            raise InvalidInputError(message, "scans")
        layout = lay_out(crowd, like)
        on_stage("laid out")
        return cls(rule, crowd, like, layout)

    def on(
        self,
        free_space: FreeSpace,
        rotation_sd_rad: float | None = None,
        on_stage: Callable[[str], None] = lambda _stage: None,
    ) -> RegisteredComplex:
        """Place the crowd on a map, without any label.

        Parameters
        ----------
        free_space : FreeSpace
            Of the map.
        rotation_sd_rad : float, optional
            How far the headings of the crowd are from those of the map, radians; unknown when
            absent.
        on_stage : callable, optional
            Told each of `STAGES` when it is reached.

        Returns
        -------
        RegisteredComplex
            Of the scans that hang together.
        """
        part = self._part
        shape = self.layout.xy[part]
        tried = register(shape, free_space, rotation_sd_rad)
        (mirrored,) = register(shape * _MIRROR, free_space, thorough=False)
        best_m = min(placement.cost_m for placement in tried)
        on_stage("registered")
        ground = Ground.of(free_space)
        settled: list[tuple[Placement, FloatArray]] = []
        for placement in tried:
            if placement.cost_m > best_m + PLAUSIBLE_M:
                continue
            xy = self._settled(placement, ground)[part]
            unlikely = unlikely_m(placement.rotation_rad, placement.scale, rotation_sd_rad)
            settled.append((placement._replace(cost_m=ground.mismatch_m(xy) + unlikely), xy))
        settled.sort(key=lambda pair: pair[0].cost_m)
        distinct = apart((xy for _, xy in settled), DISTINCT_M, len(settled))
        on_stage("settled")
        return RegisteredComplex(
            self.hearing,
            self.crowd.walk[part],
            settled[0][1],
            tuple(heard for heard, kept in zip(self.crowd.signatures, part, strict=True) if kept),
            self.like.radio.reach_m,
            Registration(
                tuple(settled[number][0] for number in distinct), mirrored.cost_m - best_m
            ),
            self.crowd.source[part],
        )

    @cached_property
    def _part(self) -> BoolArray:
        return largest_part(self.crowd, self.like)

    def _settled(self, placement: Placement, ground: Ground) -> FloatArray:
        turned = self.layout.heading + placement.rotation_rad
        placed = Layout(placement.place(self.layout.xy), turned, self.layout.log_step)
        return settle(
            self.crowd, self.like, placed, lambda xy: Pull(ground.nearest(xy), GROUND_SD_M)
        ).xy


def register_crowd(
    scans: Iterable[WalkScan],
    free_space: FreeSpace,
    *,
    hearing: Hearing | None = None,
    neighbors: int = NEIGHBORS,
    rotation_sd_rad: float | None = None,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> RegisteredComplex:
    """Lay a crowd out and place it on a map, without any label.

    Parameters
    ----------
    scans : iterable of WalkScan
        The crowd.
    free_space : FreeSpace
        Of the map.
    hearing : Hearing, optional
        What of a scan counts.
    neighbors : int, default 4
        Most similar scans that each scan is joined with.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the map, radians; unknown when absent.
    on_stage : callable, optional
        Told each of `STAGES` when it is reached.

    Returns
    -------
    RegisteredComplex
        Of the scans that hang together.

    Raises
    ------
    InvalidInputError
        If the crowd is too small to be laid out.
    """
    laid_out = LaidOutCrowd.of(scans, hearing, neighbors, on_stage)
    return laid_out.on(free_space, rotation_sd_rad, on_stage)
