"""Detection in k of the last n scans, chosen by how well it foretells the next scan.

A scan misses transmitters and may report some that are not there. What has been heard in several
scans is surer, but older scans were made elsewhere. Which of the two matters more is seen without
any position: the better detection explains more of what the next scan counts, which shares its
place but not its accidents.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError
from homsense.profiles import Profiles

MOST_SCANS = 5
_WORTH_IT = 0.05
_FEWEST, _LEAST = 30, 1e-300

FloatArray = NDArray[np.float64]


class Detection(NamedTuple):
    """A landmark is in view when it was heard in so many of the last scans.

    Parameters
    ----------
    times : int, default 1
        How often it must have been heard, at least 1.
    scans : int, default 1
        In how many scans, at most five.
    """

    times: int = 1
    scans: int = 1

    def __str__(self) -> str:
        """Return it in words."""
        return f"{self.times} of {self.scans}"

    def checked(self) -> "Detection":
        """Return it, or refuse it.

        Returns
        -------
        Detection
            The same.

        Raises
        ------
        InvalidConfigurationError
            If not ``1 <= times <= scans <= 5``.

        Examples
        --------
        >>> Detection(2, 3).checked()
        Detection(times=2, scans=3)
        """
        if not 1 <= self.times <= self.scans <= MOST_SCANS:
            message = f"detection must be [k, n] with 1 <= k <= n <= {MOST_SCANS}, not {[*self]}"
            raise InvalidConfigurationError(message, "detection")
        return self

    def in_view(self, latest: Sequence[Collection[str]]) -> frozenset[str]:
        """Return what counts as visible.

        Parameters
        ----------
        latest : sequence of collection of str
            What the last scans have heard, the latest at the end. Those before the last `scans`
            are ignored; when there are fewer than `times`, all of them must have heard it.

        Returns
        -------
        frozenset of str
            Landmarks.

        Examples
        --------
        >>> sorted(Detection(2, 3).in_view([{"a", "b"}, {"b"}, {"a", "c"}]))
        ['a', 'b']
        """
        window = latest[-self.scans :]
        enough = min(self.times, len(window))
        if enough <= 1:
            return frozenset().union(*window)
        heard = Counter(landmark for scan in window for landmark in scan)
        return frozenset(landmark for landmark, times in heard.items() if times >= enough)


LAST_SCAN = Detection()
CANDIDATES = tuple(map(Detection._make, ((1, 1), (1, 2), (2, 2), (1, 3), (2, 3), (3, 5))))


@dataclass(frozen=True, slots=True)
class DetectionPoint:
    """How well one detection foretells the next scan.

    Parameters
    ----------
    detection : Detection
        How often of how many.
    unexplained : float
        Share of the variance of the next scan's counts that it does not explain, 0 to 1, mean
        over the neighborhoods.
    """

    detection: Detection
    unexplained: float


def detection_curve(
    walks: Iterable[Sequence[Collection[str]]],
    profiles: Profiles,
    candidates: Sequence[Detection] = CANDIDATES,
) -> list[DetectionPoint]:
    """Return how well each of some detections foretells the next scan.

    Parameters
    ----------
    walks : iterable of sequence of collection of str
        What each device has heard, scan by scan.
    profiles : Profiles
        Holes near each landmark of their complex.
    candidates : sequence of Detection, optional
        What is tried; by default one scan, and some of two, three and five.

    Returns
    -------
    list of DetectionPoint
        One for each candidate, all judged by the same scans; empty when those are too few, or
        all count alike.
    """
    longest = max(candidate.scans for candidate in candidates)
    nows: list[list[tuple[float, ...]]] = []
    nexts: list[tuple[float, ...]] = []
    for walk in walks:
        for end in range(longest, len(walk)):
            later = profiles.mean_holes(walk[end])
            window = walk[end - longest : end]
            now = [profiles.mean_holes(candidate.in_view(window)) for candidate in candidates]
            told = [counts for counts in now if counts is not None]
            if later is not None and len(told) == len(candidates):
                nexts.append(later)
                nows.append(told)
    if len(nexts) < _FEWEST:
        return []
    before = np.array(nows)
    after = np.array(nexts)
    varies = np.ptp(after, axis=0) > 0.0
    if not varies.any():
        return []
    return [
        DetectionPoint(candidate, _unexplained(before[:, at, varies], after[:, varies]))
        for at, candidate in enumerate(candidates)
    ]


def choose_detection(curve: Sequence[DetectionPoint]) -> DetectionPoint | None:
    """Choose the detection that foretells best; the simplest unless another is clearly better.

    Parameters
    ----------
    curve : sequence of DetectionPoint
        From `detection_curve`; the simplest first.

    Returns
    -------
    DetectionPoint or None
        Another than the first only if it explains a twentieth more of the variance; less is lost
        among what counts differ by from one place to the next.

    Examples
    --------
    >>> alone, united = DetectionPoint(Detection(), 0.20), DetectionPoint(Detection(1, 2), 0.12)
    >>> choose_detection([alone, united]).detection
    Detection(times=1, scans=2)
    """
    if not curve:
        return None
    best = min(curve, key=lambda point: point.unexplained)
    return best if best.unexplained <= curve[0].unexplained - _WORTH_IT else curve[0]


def _unexplained(before: FloatArray, after: FloatArray) -> float:
    """Return what a line through the counts before leaves of the variance after, per level."""
    centred, wanted = before - before.mean(axis=0), after - after.mean(axis=0)
    variance = np.square(centred).sum(axis=0)
    shared = np.square((centred * wanted).sum(axis=0))
    explained = shared / np.maximum(variance * np.square(wanted).sum(axis=0), _LEAST)
    return float(1.0 - explained.mean())
