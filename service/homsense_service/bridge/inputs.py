"""What devices send, as values: numbered motion and scans."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

import homsense
from homsense_service.own_motion import Motion
from homsense_service.records import StoredReading

FloatArray = NDArray[np.float64]
MOST_SAMPLES = 1000
_LONGEST_S, _LONGEST_GAP_S = 10.0, 3600.0


class Deltas(NamedTuple):
    """Motions in the body frame, numbered without gaps.

    Parameters
    ----------
    first : int
        Number of the first.
    motions : ndarray, shape (n, 3)
        Forward (m), left (m), turn (rad).
    durations_s : ndarray, shape (n,)
        Seconds.
    covariances : ndarray, shape (n, 3, 3), optional
        As the device states them.
    """

    first: int
    motions: FloatArray
    durations_s: FloatArray
    covariances: FloatArray | None = None

    @property
    def following(self) -> int:
        """Number of the next input."""
        return self.first + len(self.motions)

    def from_number(self, number: int) -> Self:
        """Return those from a number on."""
        at = number - self.first
        stated = None if self.covariances is None else self.covariances[at:]
        return self._replace(
            first=number,
            motions=self.motions[at:],
            durations_s=self.durations_s[at:],
            covariances=stated,
        )

    def continues(self, before: Sequence["Moving"]) -> bool:
        """Tell whether these can become one motion with those before."""
        last = before[-1]
        if not isinstance(last, Deltas):
            return False
        return (last.covariances is None) == (self.covariances is None)

    def joined(self, others: Sequence["Moving"]) -> Self:
        """Return these and those that follow, which all continue them."""
        if not others:
            return self
        alike: list[Deltas] = [self, *(part for part in others if isinstance(part, Deltas))]
        stated = [part.covariances for part in alike if part.covariances is not None]
        return self._replace(
            motions=np.concatenate([part.motions for part in alike]),
            durations_s=np.concatenate([part.durations_s for part in alike]),
            covariances=np.concatenate(stated) if stated else None,
        )

    def motion(self) -> Motion:
        """Return all of it as one motion."""
        return _sound(homsense.composed(self.motions, self.durations_s, self.covariances))

    def guessed(self, lost: int) -> Motion:
        """Return what as many lost inputs may have been: the same pace, as wrong as it is long."""
        forward, left, turn = (lost * self.motions.mean(axis=0)).tolist()
        spread = lost * np.sqrt(np.square(self.motions).mean(axis=0))
        return _sound(
            homsense.Delta(
                forward,
                left,
                turn,
                lost * float(self.durations_s.mean()),
                std=(float(spread[0]), float(spread[1]), float(spread[2])),
            )
        )


class Readings(NamedTuple):
    """Readings of an IMU, numbered without gaps.

    Parameters
    ----------
    first : int
        Number of the first.
    samples : tuple of homsense.ImuSample
        In order of time.
    """

    first: int
    samples: tuple[homsense.ImuSample, ...]

    @property
    def following(self) -> int:
        """Number of the next input."""
        return self.first + len(self.samples)

    @property
    def durations_s(self) -> FloatArray:
        """How long each holds, seconds."""
        return np.array([sample.dt_s for sample in self.samples])

    def from_number(self, number: int) -> Self:
        """Return those from a number on."""
        return self._replace(first=number, samples=self.samples[number - self.first :])

    def continues(self, before: Sequence["Moving"]) -> bool:
        """Tell whether these can become one motion with those before."""
        if not isinstance(before[-1], Readings):
            return False
        return self.following - before[0].first <= MOST_SAMPLES

    def joined(self, others: Sequence["Moving"]) -> Self:
        """Return these and those that follow, which all continue them."""
        alike: list[Readings] = [self, *(part for part in others if isinstance(part, Readings))]
        return self._replace(samples=tuple(sample for part in alike for sample in part.samples))

    def motion(self) -> Motion:
        """Return all of it as one motion."""
        return self.samples

    def guessed(self, lost: int) -> Motion:
        """Return what as many lost inputs may have been: the same forces all the time."""
        dt_s, forward, left, turn = np.array(self.samples).mean(axis=0).tolist()
        rest_s = min(lost * dt_s, _LONGEST_GAP_S)
        pieces = max(1, int(np.ceil(rest_s / _LONGEST_S)))
        return (homsense.ImuSample(rest_s / pieces, forward, left, turn),) * pieces


class Scan(NamedTuple):
    """A scan; it counts as one input.

    Parameters
    ----------
    first : int
        Its number.
    readings : tuple of StoredReading
        What was heard.
    t : float, optional
        When, as the device says, seconds.
    """

    first: int
    readings: tuple[StoredReading, ...]
    t: float | None = None

    @property
    def following(self) -> int:
        """Number of the next input."""
        return self.first + 1


def _sound(delta: homsense.Delta) -> homsense.Delta:
    """Return a motion itself, or none when it is beyond all bounds."""
    try:
        return delta.checked()
    except homsense.InvalidInputError:
        return homsense.Delta()


Moving = Deltas | Readings
Input = Moving | Scan
