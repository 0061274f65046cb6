"""From tracks to figures: errors, shares, convergence, coverage and sign tests."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import bdtrc

from homsense_cli.accuracy.run import Track

LAST_M = 300.0
LAST_SHARE = 0.2
WITHIN_M = (15.0, 25.0, 50.0)
CONVERGED_M, STAYS_M = 25.0, 100.0


@dataclass(frozen=True, slots=True)
class Score:
    """Figures over some runs.

    Parameters
    ----------
    runs : int
        How many.
    median_m, p90_m : float
        Over all steps of all runs, metres.
    last_median_m, last_p90_m : float
        Over the last fifth of the steps, metres.
    final_median_m : float
        Median over the runs of the median error over the last 300 m, metres.
    within_15_m, within_25_m, within_50_m : float
        Share of the runs whose median error over the last 300 m is smaller.
    converged_m : float, optional
        Median way after which the error stays below 25 m for 100 m; None when half of the runs
        never get there, metres.
    told_unmapped : float, optional
        Share of the steps where the crowd has not been whose status says so.
    wrongly_unmapped : float, optional
        Share of the steps where the crowd has been whose status says the same.
    coverage_50, coverage_90, coverage_95 : float
        Share of the steps with the truth inside the region.
    """

    runs: int
    median_m: float
    p90_m: float
    last_median_m: float
    last_p90_m: float
    final_median_m: float
    within_15_m: float
    within_25_m: float
    within_50_m: float
    converged_m: float | None
    told_unmapped: float | None
    wrongly_unmapped: float | None
    coverage_50: float
    coverage_90: float
    coverage_95: float

    def as_json(self) -> dict[str, Any]:
        """Return the figures, rounded to what they are worth."""
        return {
            name: round(value, 3) if isinstance(value, float) else value
            for name, value in asdict(self).items()
        }


@dataclass(frozen=True, slots=True)
class Walks:
    """Figures walk by walk: each walk counts once, by the median over its seeds.

    Parameters
    ----------
    walks : int
        How many.
    median_m : float
        Median over the walks of the median error of each, metres.
    mean_m : float
        Mean of the same, metres.
    last_within_15_m : int
        Walks whose median error over the last fifth is at most 15 m.
    beats : dict of str to int
        Walks with a smaller median error than with each control.
    """

    walks: int
    median_m: float
    mean_m: float
    last_within_15_m: int
    beats: dict[str, int]

    def __str__(self) -> str:
        """Return the figures for people."""
        beats = "/".join(str(count) for count in self.beats.values())
        return f"{self.median_m:.1f} m {self.last_within_15_m} {beats}".strip()


def by_walk(tracks: Sequence[Track], controls: Mapping[str, Sequence[Track]], seeds: int) -> Walks:
    """Return the figures walk by walk.

    Parameters
    ----------
    tracks : sequence of Track
        Runs, those of a walk together.
    controls : mapping of str to sequence of Track
        The same walks with what they are compared with.
    seeds : int
        Runs of a walk.

    Returns
    -------
    Walks
        Medians over the seeds.
    """

    def medians(of: Sequence[Track], last: bool) -> np.ndarray[Any, np.dtype[np.float64]]:  # noqa: FBT001 - of two
        found = [
            np.median(track.error_m[-_last(track) :] if last else track.error_m) for track in of
        ]
        return np.median(np.reshape(found, (-1, seeds)), axis=1)

    ours = medians(tracks, last=False)
    return Walks(
        len(ours),
        round(float(np.median(ours)), 2),
        round(float(np.mean(ours)), 2),
        int(np.sum(medians(tracks, last=True) <= WITHIN_M[0])),
        {
            control: int(np.sum(ours < medians(theirs, last=False)))
            for control, theirs in controls.items()
        },
    )


def score(tracks: Sequence[Track]) -> Score:
    """Return the figures of some runs.

    Parameters
    ----------
    tracks : sequence of Track
        At least one.

    Returns
    -------
    Score
        Over all of them.
    """
    errors = np.concatenate([track.error_m for track in tracks])
    last = np.concatenate([track.error_m[-_last(track) :] for track in tracks])
    final = final_medians(tracks)
    converged = float(np.median([_converged_m(track) for track in tracks]))
    inside = np.concatenate([track.inside for track in tracks]).mean(axis=0)
    in_50, in_90, in_95 = (float(share) for share in inside)
    within_15, within_25, within_50 = (float(np.mean(final < within)) for within in WITHIN_M)
    return Score(
        len(tracks),
        float(np.median(errors)),
        float(np.quantile(errors, 0.9)),
        float(np.median(last)),
        float(np.quantile(last, 0.9)),
        float(np.median(final)),
        within_15,
        within_25,
        within_50,
        converged if math.isfinite(converged) else None,
        *_told_unmapped(tracks),
        in_50,
        in_90,
        in_95,
    )


def _told_unmapped(tracks: Sequence[Track]) -> tuple[float | None, float | None]:
    """Return how often unmapped is told where nobody has been, and where somebody has."""
    covered = np.concatenate([track.is_covered for track in tracks])
    told = np.concatenate([track.told_unmapped for track in tracks])
    return (
        None if covered.all() else float(told[~covered].mean()),
        float(told[covered].mean()) if covered.any() else None,
    )


def final_medians(tracks: Sequence[Track]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the median error of each run over its last 300 m, or its last fifth if shorter."""
    return np.array([_final_median(track) for track in tracks])


def sign_test(tracks: Sequence[Track], control: Sequence[Track]) -> float:
    """Return how likely so many runs would beat their control if neither were better.

    Parameters
    ----------
    tracks, control : sequence of Track
        The same runs.

    Returns
    -------
    float
        One-sided probability; equal runs do not count.
    """
    ours, theirs = final_medians(tracks), final_medians(control)
    better, different = int(np.sum(ours < theirs)), int(np.sum(ours != theirs))
    if not different:
        return 1.0
    return float(bdtrc(better - 1, different, 0.5))


def _last(track: Track) -> int:
    return max(1, round(LAST_SHARE * len(track.error_m)))


def _final_median(track: Track) -> float:
    long = track.way_m[-1] > LAST_M / LAST_SHARE - 1.0
    recent = track.way_m > track.way_m[-1] - LAST_M if long else slice(-_last(track), None)
    return float(np.median(track.error_m[recent]))


def _converged_m(track: Track) -> float:
    """Return the way after which the error stays small for a while, else infinite."""
    good_since = math.inf
    for way, error in zip(track.way_m, track.error_m, strict=True):
        if error >= CONVERGED_M:
            good_since = math.inf
        elif math.isinf(good_since):
            good_since = way
        if way - good_since >= STAYS_M:
            return float(good_since)
    return math.inf
