"""From raw readings to the set of landmarks in view: the paper's binary sensor (A3, A5)."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from homsense.errors import InvalidScanError


@dataclass(frozen=True, slots=True)
class Reading:
    """One landmark heard once.

    Parameters
    ----------
    landmark : str
        Identifier that the landmark broadcasts; not empty.
    rssi_dbm : float, optional
        Received strength in dBm; ``None`` when the device tells only that it heard the landmark.
    age_s : float, default 0.0
        Seconds between the sighting and the scan that reports it; phones repeat old sightings.

    Raises
    ------
    InvalidScanError
        If the identifier is empty, or a number is not finite, or the age is negative.
    """

    landmark: str
    rssi_dbm: float | None = None
    age_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.landmark:
            message = "a landmark is identified by a non-empty string"
            raise InvalidScanError(message, "landmark")
        if self.rssi_dbm is not None and not math.isfinite(self.rssi_dbm):
            message = f"rssi_dbm must be finite, not {self.rssi_dbm}"
            raise InvalidScanError(message, "rssi_dbm")
        if not (math.isfinite(self.age_s) and self.age_s >= 0.0):
            message = f"age_s must be finite and not negative, not {self.age_s}"
            raise InvalidScanError(message, "age_s")


class Heard(Protocol):
    """What has the fields of a `Reading`."""

    @property
    def landmark(self) -> str:
        """Identifier that the landmark broadcasts."""
        ...

    @property
    def rssi_dbm(self) -> float | None:
        """Received strength, dBm, if the device tells it."""
        ...

    @property
    def age_s(self) -> float:
        """Seconds between the sighting and the scan that reports it."""
        ...


def visible_landmarks(
    readings: Iterable[Heard],
    *,
    min_rssi_dbm: float | None = None,
    max_age_s: float | None = None,
) -> frozenset[str]:
    """Return the landmarks judged visible in a scan.

    The threshold sets the effective sensing range; a reading without a strength passes it.

    Parameters
    ----------
    readings : iterable of Heard
        The scan; a landmark may occur more than once.
    min_rssi_dbm : float, optional
        Weakest strength that counts as visible, dBm; ``None`` keeps all.
    max_age_s : float, optional
        Oldest sighting that counts, seconds; ``None`` keeps all.

    Returns
    -------
    frozenset of str
        The observation: identifiers of the visible landmarks, possibly empty.

    Examples
    --------
    >>> scan = [Reading("a", -50.0), Reading("b", -80.0), Reading("c", -50.0, age_s=9.0)]
    >>> sorted(visible_landmarks(scan, min_rssi_dbm=-70.0, max_age_s=3.0))
    ['a']
    """
    return frozenset(
        reading.landmark
        for reading in readings
        if (min_rssi_dbm is None or reading.rssi_dbm is None or reading.rssi_dbm >= min_rssi_dbm)
        and (max_age_s is None or reading.age_s <= max_age_s)
    )


def observation(landmarks: Iterable[str]) -> frozenset[str]:
    """Return the landmarks as an observation, refusing what cannot be one.

    Parameters
    ----------
    landmarks : iterable of str
        Identifiers; a bare string is refused, since its letters are not meant.

    Returns
    -------
    frozenset of str
        The identifiers.

    Raises
    ------
    InvalidScanError
        If an identifier is not a non-empty string.

    Examples
    --------
    >>> sorted(observation(["b", "a", "b"]))
    ['a', 'b']
    """
    if isinstance(landmarks, str | bytes):
        message = f"an observation is a set of identifiers, not the string {landmarks!r}"
        raise InvalidScanError(message, "landmarks")
    found: frozenset[Any] = frozenset(landmarks)
    for landmark in found:
        if not isinstance(landmark, str) or not landmark:
            message = f"a landmark is identified by a non-empty string, not {landmark!r}"
            raise InvalidScanError(message, "landmarks")
    return found
