"""The crowd complex: walks of own motion, joined where their scans hear alike.

No position is used. How far apart two scans of a similarity are is learnt from pairs of scans of
the same walk, whose distance the device itself has measured.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidInputError
from homsense.registered.similarity import Hearing, ScanIndex, Signature
from homsense.scan import Reading

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SIMILARITY_EDGES = np.array([0.0, *np.arange(0.05, 0.625, 0.05), 0.7, 1.0])
NEW_SIGHTINGS_S = 3.5
FEWEST_PAIRS = 10
LEAST_RMS_M = 1.0
JUMP_M, FASTEST_MPS, PAUSE_S = 50.0, 50.0, 120.0
STANDING_M, MOST_STANDING, LONGEST = 1.0, 10, 1000
LEAST_SIMILAR, UNLIKE = 0.25, 0.1
NEIGHBORS = 4


@dataclass(frozen=True, slots=True)
class WalkScan:
    """One scan of a device that keeps account of its own motion.

    Parameters
    ----------
    walk : str
        Which walk of which device.
    t_s : float
        When, seconds.
    x_m, y_m : float
        Dead-reckoned place in a frame of the walk's own, metres.
    readings : tuple of Reading
        What was heard.
    """

    walk: str
    t_s: float
    x_m: float
    y_m: float
    readings: tuple[Reading, ...]


def legs(scans: Sequence[WalkScan]) -> IntArray:
    """Return which walk each scan is of; where one jumps or pauses, another begins.

    Parameters
    ----------
    scans : sequence of WalkScan
        Walk by walk, each in order of time.

    Returns
    -------
    ndarray, shape (N,), int64
        From 0, rising.

    Examples
    --------
    >>> there = [WalkScan("w", t_s, x_m, 0.0, ()) for t_s, x_m in ((0, 0), (2, 3), (4, 3000))]
    >>> legs([*there, WalkScan("x", 0.0, 3000.0, 0.0, ())]).tolist()
    [0, 0, 1, 2]
    """
    if not scans:
        return np.empty(0, np.int64)
    is_new = np.array([scan.walk != before.walk for before, scan in pairwise(scans)], np.bool_)
    account = np.array([(scan.t_s, scan.x_m, scan.y_m) for scan in scans])
    passed_s, right_m, up_m = np.diff(account, axis=0).T
    is_new |= ~(np.hypot(right_m, up_m) <= JUMP_M + FASTEST_MPS * passed_s) | (passed_s > PAUSE_S)
    return np.append(0, np.cumsum(is_new))


def not_standing(scans: Sequence[WalkScan], leg: IntArray) -> IntArray:
    """Return which scans to keep: of those in a row that are at one place the first ten.

    Parameters
    ----------
    scans : sequence of WalkScan
        As `legs` takes them.
    leg : ndarray, shape (N,), int64
        As it numbers them.

    Returns
    -------
    ndarray, shape (M,), int64
        Rising.
    """
    kept: list[int] = []
    since, count = 0, 0
    for number, (here, walk) in enumerate(zip(scans, leg.tolist(), strict=True)):
        there = scans[since]
        moved_m = math.hypot(here.x_m - there.x_m, here.y_m - there.y_m)
        if walk != leg[since] or not moved_m <= STANDING_M:
            since, count = number, 0
        count += 1
        if count <= MOST_STANDING:
            kept.append(number)
    return np.array(kept, np.int64)


@dataclass(frozen=True)
class Crowd:
    """Scans of many walks, sorted by walk, then by time.

    Parameters
    ----------
    walk : ndarray, shape (N,), int64
        Number of the walk of each scan.
    own_xy : ndarray, shape (N, 2), float64
        Dead-reckoned place in the frame of the walk, metres.
    t_s : ndarray, shape (N,), float64
        When, seconds.
    signatures : tuple of mapping
        What was heard.
    source : ndarray, shape (N,), int64
        Which of the scans that the crowd was made of.
    """

    walk: IntArray
    own_xy: FloatArray
    t_s: FloatArray
    signatures: tuple[Signature, ...]
    source: IntArray

    @classmethod
    def of(cls, scans: Iterable[WalkScan], hearing: Hearing | None = None) -> Self:
        """Return the crowd of some scans.

        Parameters
        ----------
        scans : iterable of WalkScan
            In any order.
        hearing : Hearing, optional
            What of a scan counts.

        Returns
        -------
        Crowd
            Of the scans that hear enough: of a phone that stands still the first ten. A very long
            walk counts as several.
        """
        rule = hearing or Hearing()
        heard = [
            (scan, signature, source)
            for source, scan in enumerate(scans)
            if (signature := rule.signature(scan.readings))
        ]
        heard.sort(key=lambda entry: (entry[0].walk, entry[0].t_s))
        made = [scan for scan, *_ in heard]
        leg = legs(made)
        moving = not_standing(made, leg)
        kept = [heard[number] for number in moving.tolist()]
        return cls(
            _shortened(leg[moving]),
            np.array([(scan.x_m, scan.y_m) for scan, *_ in kept], np.float64).reshape(-1, 2),
            np.array([scan.t_s for scan, *_ in kept], np.float64),
            tuple(signature for _, signature, _ in kept),
            np.array([source for *_, source in kept], np.int64),
        )

    def few(self, most: int) -> Self:
        """Return every second, third... walk, so that there are no more scans than wanted.

        Parameters
        ----------
        most : int
            Wanted, in walks of equal length.

        Returns
        -------
        Crowd
            All walks where they are few.
        """
        every = max(1, -(-self.size // most))
        kept = np.flatnonzero(self.walk % every == 0)
        return type(self)(
            self.walk[kept] // every,
            self.own_xy[kept],
            self.t_s[kept],
            tuple(self.signatures[scan] for scan in kept.tolist()),
            self.source[kept],
        )

    @property
    def size(self) -> int:
        """Number of scans."""
        return len(self.walk)

    @property
    def n_walks(self) -> int:
        """Number of walks."""
        return int(self.walk[-1]) + 1 if self.size else 0

    @property
    def steps(self) -> IntArray:
        """Scans that another one of the same walk follows."""
        return np.flatnonzero(self.walk[1:] == self.walk[:-1])


def _shortened(leg: IntArray) -> IntArray:
    """Return the legs anew, none of more than `LONGEST` scans."""
    begin = np.searchsorted(leg, leg)
    parts = (np.arange(len(leg)) - begin) // LONGEST
    return np.cumsum((np.diff(leg, prepend=leg[:1]) != 0) | (np.diff(parts, prepend=0) > 0))


@dataclass(frozen=True)
class RadioDistance:
    """How far apart two scans of a similarity are.

    Parameters
    ----------
    similarity : ndarray, shape (B,), float64
        Rising.
    rms_m : ndarray, shape (B,), float64
        Root mean square distance, falling, metres.
    """

    similarity: FloatArray
    rms_m: FloatArray

    def __call__(self, similarity: FloatArray) -> FloatArray:
        """Return the root mean square distance of pairs, metres."""
        return np.interp(similarity, self.similarity, self.rms_m)

    @property
    def reach_m(self) -> float:
        """Distance over which scans still hear alike, metres: the scale of the radio field."""
        return float(np.interp(LEAST_SIMILAR, self.similarity, self.rms_m))


@dataclass(frozen=True)
class Likeness:
    """The most similar scans of other walks, and which are at all alike.

    Parameters
    ----------
    first, second : ndarray, shape (E,), int64
        The two scans of each edge.
    similarity : ndarray, shape (E,), float64
        How alike they hear.
    radio : RadioDistance
        What that means in metres.
    compatible : ndarray, shape (P,), int64
        All pairs of a similarity of a tenth or more, rising: the number of the one times that of
        all scans, plus the number of the other.
    """

    first: IntArray
    second: IntArray
    similarity: FloatArray
    radio: RadioDistance
    compatible: IntArray


def likeness(crowd: Crowd, neighbors: int = NEIGHBORS) -> Likeness:
    """Join each scan with the most similar ones of other walks.

    Parameters
    ----------
    crowd : Crowd
        The scans.
    neighbors : int, default 4
        Most edges that a scan asks for.

    Returns
    -------
    Likeness
        Edges of a similarity of a quarter or more.

    Raises
    ------
    InvalidInputError
        If the walks are too few or too short to tell how similarity falls with distance.
    """
    index = ScanIndex.of(crowd.signatures)
    bounds = np.searchsorted(crowd.walk, np.arange(crowd.n_walks + 1))
    squares, counts = np.zeros(len(SIMILARITY_EDGES) - 1), np.zeros(len(SIMILARITY_EDGES) - 1)
    edges, compatible = [], []
    for scan, signature in enumerate(crowd.signatures):
        found = index.similarities(signature)
        begin, end = bounds[crowd.walk[scan]], bounds[crowd.walk[scan] + 1]
        later = np.arange(scan + 1, end)
        later = later[crowd.t_s[later] - crowd.t_s[scan] > NEW_SIGHTINGS_S]
        apart = crowd.own_xy[later] - crowd.own_xy[scan]
        number = np.searchsorted(SIMILARITY_EDGES[1:-1], found[later], side="right")
        squares += np.bincount(number, (apart * apart).sum(axis=1), len(squares))
        counts += np.bincount(number, minlength=len(counts))
        found[begin:end] = 0.0
        near = np.argsort(-found, kind="stable")[:neighbors]
        near = near[found[near] >= LEAST_SIMILAR]
        edges.append(np.stack([np.full(len(near), scan), near, found[near]]))
        compatible.append(scan * crowd.size + np.flatnonzero(found >= UNLIKE))
    radio = _radio_distance(squares, counts)
    one, other, similarity = np.concatenate(edges, axis=1)
    low, high, once = each_once(one.astype(np.int64), other.astype(np.int64), crowd.size)
    return Likeness(low, high, similarity[once], radio, np.concatenate(compatible))


def each_once(one: IntArray, other: IntArray, size: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return each pair of scans once, the lower number first.

    Parameters
    ----------
    one, other : ndarray, shape (P,), int64
        The two scans of each pair, either first.
    size : int
        Number of scans.

    Returns
    -------
    low, high : ndarray, int64
        The pairs.
    which : ndarray, int64
        Where each of them came first.
    """
    low, high = np.minimum(one, other), np.maximum(one, other)
    _, which = np.unique(low * size + high, return_index=True)
    return low[which], high[which], which


def _radio_distance(squares: FloatArray, counts: FloatArray) -> RadioDistance:
    enough = counts >= FEWEST_PAIRS
    rms = np.minimum.accumulate(np.sqrt(squares[enough] / counts[enough]))
    if len(rms) < 2 or rms[0] <= LEAST_RMS_M:  # noqa: PLR2004 - a line needs two points
        message = "the walks are too few or too short to tell how similarity falls with distance"
        raise InvalidInputError(message, "scans")
    middle = 0.5 * (SIMILARITY_EDGES[1:] + SIMILARITY_EDGES[:-1])
    return RadioDistance(middle[enough], np.maximum(rms, LEAST_RMS_M))
