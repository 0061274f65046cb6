"""The range self-check: which RSSI cut gives a sensing range at which holes are structures.

When the range exceeds about 0.8 of the distance between structures, holes fill in; when it is too
short, the complex falls apart. Complexes of falling cuts are nested, so holes that are structures
live over an interval of cuts, while accidents die soon: persistence over the cut tells them apart,
without any ground truth.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from homsense.engine import Engine
from homsense.errors import ComputationLimitError, InvalidInputError
from homsense.history import History
from homsense.nested import nested_homology
from homsense.scan import Reading, visible_landmarks
from homsense.simplicial import LandmarkComplex

STEP_DB = 3.0
STRONGEST_DBM = -45.0
_EULER_TERMS = 20_000


@dataclass(frozen=True, slots=True)
class RangePoint:
    """The complex of one RSSI cut.

    Parameters
    ----------
    min_rssi_dbm : float
        The cut, dBm.
    landmarks_per_scan : float
        Mean number of visible landmarks.
    landmarks, facets : int
        Size of the complex.
    betti : tuple of int
        (b0, b1): fragmentation and holes.
    euler : int, optional
        Euler characteristic; ``None`` when too dense to tell.
    stable : int
        Holes that live from the next stronger cut through this one to the next weaker one.
    """

    min_rssi_dbm: float
    landmarks_per_scan: float
    landmarks: int
    facets: int
    betti: tuple[int, int]
    euler: int | None
    stable: int

    @property
    def alarm(self) -> bool | None:
        """Whether Lemma 5.1 fails (chi is not b0 - b1): range too long, or missed detections."""
        return None if self.euler is None else self.euler != self.betti[0] - self.betti[1]


def range_curve(
    scans: Iterable[Sequence[Reading]],
    cuts_dbm: Sequence[float] | None = None,
    *,
    max_age_s: float | None = None,
    most_in_view: float = math.inf,
    engine: Engine | None = None,
) -> list[RangePoint]:
    """Return what the complex would be at each of some cuts.

    Parameters
    ----------
    scans : iterable of sequence of Reading
        Of a site.
    cuts_dbm : sequence of float, optional
        Falling cuts, dBm; by default -45, -48 and so on down to the weakest reading.
    max_age_s : float, optional
        Oldest sighting that counts, seconds.
    most_in_view : float, optional
        Cuts at which scans see more landmarks in the mean are left out.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.

    Returns
    -------
    list of RangePoint
        One for each cut, from the strongest to the weakest.

    Raises
    ------
    InvalidInputError
        If the cuts do not fall.

    Examples
    --------
    >>> ring = [("ab", -50), ("bc", -50), ("cd", -60), ("da", -60), ("abcd", -80)]
    >>> scans = [[Reading(name, float(dbm)) for name in names] for names, dbm in ring]
    >>> [point.betti for point in range_curve(scans, [-50, -60, -70, -80])]
    [(1, 0), (1, 1), (1, 1), (1, 0)]
    """
    heard = [list(scan) for scan in scans]
    if cuts_dbm is None:
        cuts_dbm = _default_cuts(heard)
    if any(later >= earlier for earlier, later in pairwise(cuts_dbm)):
        message = f"cuts must fall, not {list(cuts_dbm)}"
        raise InvalidInputError(message, "cuts_dbm")
    in_view: list[float] = []
    complexes: list[LandmarkComplex] = []
    for cut in cuts_dbm:
        seen = [visible_landmarks(scan, min_rssi_dbm=cut, max_age_s=max_age_s) for scan in heard]
        in_view.append(sum(map(len, seen)) / max(1, len(heard)))
        if in_view[-1] > most_in_view:
            break
        complexes.append(LandmarkComplex.from_observations(seen, engine))
    stages = nested_homology(complexes, engine)
    return [
        RangePoint(
            cut,
            in_view[at],
            complexes[at].n_landmarks,
            complexes[at].n_facets,
            stages.betti(at),
            quick_euler(complexes[at]),
            _stable(stages, at),
        )
        for at, cut in enumerate(cuts_dbm[: len(complexes)])
    ]


def choose_cut(curve: Sequence[RangePoint]) -> RangePoint | None:
    """Choose the cut with the most stable holes; of equal ones the weakest.

    Parameters
    ----------
    curve : sequence of RangePoint
        From `range_curve`.

    Returns
    -------
    RangePoint or None
        None when no cut has a stable hole.
    """
    best = max(curve, key=lambda point: (point.stable, -point.min_rssi_dbm), default=None)
    return best if best is not None and best.stable else None


def _default_cuts(heard: Iterable[Iterable[Reading]]) -> list[float]:
    """Return cuts that end where weaker ones would change nothing."""
    strengths = [r.rssi_dbm for scan in heard for r in scan if r.rssi_dbm is not None]
    weakest = min(strengths, default=STRONGEST_DBM)
    steps = max(0, math.ceil((STRONGEST_DBM - weakest) / STEP_DB))
    return [STRONGEST_DBM - STEP_DB * step for step in range(steps + 1)]


def _stable(stages: History, at: int) -> int:
    return stages.rank(at - 1, at + 1) if 0 < at < len(stages.components) - 1 else 0


def quick_euler(grown: LandmarkComplex) -> int | None:
    """Return the Euler characteristic of a complex, unless it is too dense for that.

    Parameters
    ----------
    grown : LandmarkComplex
        The complex.

    Returns
    -------
    int or None
        None where it takes more than a moment.
    """
    try:
        return grown.euler_characteristic(max_terms=_EULER_TERMS)
    except ComputationLimitError:
        return None
