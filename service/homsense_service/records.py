"""What the store keeps; plain values between the store and the sites."""

from dataclasses import dataclass
from typing import Any, Literal

NEAR_AND_FAR = (2, 3)


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


@dataclass(frozen=True, slots=True)
class StoredReading:
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
