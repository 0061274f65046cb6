"""What the store keeps; plain values between the store and the sites."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from homsense.detection import LAST_SCAN, Detection

NEAR_AND_FAR = (2, 3)


def tupled(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields whose lists are tuples, as JSON has taken them for lists."""

    def as_tuple(value: Any) -> Any:  # noqa: ANN401 - whatever JSON has
        return tuple(map(as_tuple, value)) if isinstance(value, list) else value

    return {name: as_tuple(value) for name, value in fields.items()}


def config_of(fields: Mapping[str, Any]) -> "SiteConfig":
    """Return the configuration that JSON tells of."""
    known = tupled(fields)
    detection = Detection(*known.pop("detection", ()))
    return SiteConfig(**known, detection=detection)


@dataclass(frozen=True, slots=True)
class SiteConfig:
    """Configuration of a site.

    Parameters
    ----------
    name : str
        For people.
    s_max_m : float
        Sensing range, metres; need not be precise.
    hops : tuple of int, optional
        Radii of the neighborhoods whose holes are counted, rising; chosen by the site when
        absent.
    expected : {"simulated", "geometric"}
        How counts are expected.
    landmark_key : {"bssid", "ssid"}
        Hardware addresses are compared in lower case with colons; names as they are.
    min_rssi_dbm : float, optional
        Weakest strength that counts as visible, dBm.
    max_age_s : float, optional
        Oldest sighting that counts, seconds.
    detection : Detection
        In how many of the last scans of a session a landmark must have been heard.
    quorum : int
        Distinct devices that must have seen landmarks together.
    quarantine : bool
        Whether transmitters that seem to have moved are left out.
    retention : tuple of (float, int), optional
        Length of an epoch, seconds, and how many count, the current one included; all scans count
        when absent.
    r_geo_m : tuple of float, optional
        Geodetic radius of each neighborhood, metres; calibrated from the scans when absent.
    distance : {"euclidean", "geodesic"}
        How distance to a structure is measured on the map.
    origin : tuple of float, optional
        (latitude, longitude) of the local frame, degrees.
    track_headings : {"east", "common"}
        Whether the x axis of every track points east, or only the same way for all.
    wall_tolerance_m : float
        How far behind a wall a device may still be, metres.
    """

    name: str = ""
    s_max_m: float = 80.0
    hops: tuple[int, ...] | None = None
    expected: Literal["simulated", "geometric"] = "simulated"
    landmark_key: Literal["bssid", "ssid"] = "bssid"
    min_rssi_dbm: float | None = None
    max_age_s: float | None = None
    detection: Detection = LAST_SCAN
    quorum: int = 1
    quarantine: bool = True
    retention: tuple[float, int] | None = None
    r_geo_m: tuple[float, ...] | None = None
    distance: Literal["euclidean", "geodesic"] = "euclidean"
    origin: tuple[float, float] | None = None
    track_headings: Literal["east", "common"] = "east"
    wall_tolerance_m: float = 0.0

    @property
    def near_and_far(self) -> tuple[int, ...]:
        """The neighborhoods of the paper's sensor."""
        return self.hops or NEAR_AND_FAR


class StoredReading(NamedTuple):
    """One landmark of a stored scan: identifier, strength and age as the device gave them."""

    landmark: str
    rssi_dbm: float | None = None
    age_s: float = 0.0


@dataclass(frozen=True, slots=True)
class StoredScan:
    """A scan as a device posted it; (device, scan_id) is its natural key within a site.

    Parameters
    ----------
    device, scan_id : str
        The natural key.
    observed_at : float
        Unix seconds.
    readings : tuple of StoredReading
        What was heard.
    track : dict, optional
        The device's own dead-reckoned pose in its own frame.
    """

    device: str
    scan_id: str
    observed_at: float
    readings: tuple[StoredReading, ...]
    track: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class SiteRecord:
    """A site without its map and scans.

    Parameters
    ----------
    config : SiteConfig
        How it is configured.
    revision : int
        Grows whenever configuration or map are replaced.
    """

    config: SiteConfig
    revision: int = 1


class NumberedScan(NamedTuple):
    """A scan and its place in the log.

    Parameters
    ----------
    number : int
        Rising, not without gaps.
    scan : StoredScan
        As it was posted.
    """

    number: int
    scan: StoredScan


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """What a site has made of the log, so that a start need not read all of it.

    Parameters
    ----------
    through : int
        Number of the last scan in it.
    key : str
        The configuration that it was made under.
    body : bytes
        From `checkpoints.py`.
    """

    through: int
    key: str
    body: bytes


@dataclass(frozen=True, slots=True)
class SessionRecord:
    """A session as it was opened.

    Parameters
    ----------
    name, site : str
        Identifiers.
    opened_at_s : float
        Unix seconds.
    document : dict
        From `journaling.py`.
    """

    name: str
    site: str
    opened_at_s: float
    document: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Binding:
    """A device that streams into a session.

    Parameters
    ----------
    device : str
        Its name.
    session : str
        Identifier.
    nonce : str
        Of the request that has bound it, to know that again.
    token : bytes
        What the device shows with every message.
    key : str
        Name of the API key that has opened it.
    pose_hz : float
        How many steps are made of motion alone, at most, each second.
    """

    device: str
    session: str
    nonce: str
    token: bytes
    key: str
    pose_hz: float


@dataclass(frozen=True, slots=True)
class Event:
    """Something that has changed a session.

    Parameters
    ----------
    number : int
        1, 2, 3... within the session.
    seq : int
        Of the step; of the last step before when it is no step.
    fingerprint : bytes
        Hash of what the device gave; empty when it is no step.
    body : bytes
        From `journaling.py`.
    """

    number: int
    seq: int
    fingerprint: bytes
    body: bytes


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a session after an event; a cache, the journal is the truth.

    Parameters
    ----------
    number : int
        Of the event.
    body : bytes
        From `journaling.py`.
    """

    number: int
    body: bytes


@dataclass(frozen=True, slots=True)
class KeyRecord:
    """An API key; the key itself is not kept.

    Parameters
    ----------
    name : str
        For people; also names it when it is deleted.
    hashed : bytes
        SHA-256 of the key.
    scopes : tuple of str
        What it is good for.
    sites : tuple of str, optional
        Where; everywhere when absent.
    created_at_s : float
        Unix seconds.
    """

    name: str
    hashed: bytes
    scopes: tuple[str, ...]
    sites: tuple[str, ...] | None
    created_at_s: float
