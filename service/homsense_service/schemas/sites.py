"""Sites, maps and height maps on the wire."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, field_validator, model_validator

from homsense.detection import LAST_SCAN, Detection
from homsense_service.records import NEAR_AND_FAR, SiteConfig
from homsense_service.schemas.wire import HopList, Origin, Wire
from homsense_service.sensors import check_simulated

MAX_QUORUM = 4
DAY_S = 86_400.0


class Retention(Wire):
    """How long scans count."""

    epoch_days: float = Field(ge=0.01, le=3660, description="Scans are forgotten by epochs.")
    epochs: int = Field(ge=1, le=64, description="Epochs that count, the current one included.")


class SiteIn(Wire):
    """Configuration of a site."""

    name: Annotated[str, StringConstraints(max_length=200)] = ""
    s_max_m: float = Field(default=80.0, gt=0, le=100_000, description="Sensing range, metres.")
    hops: HopList | None = Field(
        default=None,
        description="Neighborhoods whose holes are counted; chosen by the site when absent.",
    )
    landmark_key: Literal["bssid", "ssid"] = Field(
        default="bssid",
        description="bssid: compared in lower case with colons; ssid: compared as they are.",
    )
    min_rssi_dbm: float | None = Field(
        default=None, ge=-200, le=100, description="Weakest strength that counts as visible."
    )
    max_age_s: float | None = Field(
        default=None, ge=0, description="Oldest sighting that counts, seconds."
    )
    detection: list[int] = Field(
        default=list(LAST_SCAN),
        min_length=2,
        max_length=2,
        description="[k, n]: what a session has heard in k of its last n scans counts; n up to 5.",
    )
    quorum: int = Field(
        default=1,
        ge=1,
        le=MAX_QUORUM,
        description="Distinct devices that must have seen landmarks together.",
    )
    quarantine: bool = Field(
        default=True, description="Leave out transmitters that join regions far apart otherwise."
    )
    retention: Retention | None = Field(
        default=None, description="How long scans count; for ever when absent."
    )
    expected: Literal["simulated", "geometric"] = Field(
        default="simulated",
        description="How counts are expected: by simulating sites like this one, or as structures "
        "within r_geo.",
    )
    distance: Literal["euclidean", "geodesic"] = Field(
        default="euclidean", description="Distance to a structure: straight, or as one walks."
    )
    r_geo_m: list[Annotated[float, Field(gt=0, le=1e6)]] | None = Field(
        default=None,
        description="Geodetic radius of each neighborhood; calibrated from the scans when absent.",
    )
    origin: Origin | None = Field(default=None, description="Georeference of a local map.")
    track_headings: Literal["east", "common"] = Field(
        default="east",
        description="Whether the x axis of every track points east, or only the same way for all.",
    )
    wall_tolerance_m: float = Field(
        default=0.0,
        ge=0,
        le=100,
        description="How far behind a wall a device may still be, metres; 1 for a floor plan.",
    )

    @field_validator("detection")
    @classmethod
    def _possible(cls, detection: list[int]) -> list[int]:
        return list(Detection(*detection).checked())

    @model_validator(mode="after")
    def _consistent(self) -> "SiteIn":
        hops = self.hops or list(NEAR_AND_FAR)
        if sorted(set(hops)) != hops:
            message = "hops must rise"
            raise ValueError(message)
        if self.expected == "simulated":
            check_simulated(self.hops or ())
        if self.r_geo_m is not None and len(self.r_geo_m) != len(hops):
            message = "r_geo_m must hold one radius for each of hops"
            raise ValueError(message)
        return self

    def to_config(self) -> SiteConfig:
        """Return the value for the store."""
        return SiteConfig(
            name=self.name,
            s_max_m=self.s_max_m,
            hops=None if self.hops is None else tuple(self.hops),
            expected=self.expected,
            landmark_key=self.landmark_key,
            min_rssi_dbm=self.min_rssi_dbm,
            max_age_s=self.max_age_s,
            detection=Detection(*self.detection),
            quorum=self.quorum,
            quarantine=self.quarantine,
            retention=None
            if self.retention is None
            else (self.retention.epoch_days * DAY_S, self.retention.epochs),
            r_geo_m=None if self.r_geo_m is None else tuple(self.r_geo_m),
            distance=self.distance,
            origin=None if self.origin is None else (self.origin.lat, self.origin.lon),
            track_headings=self.track_headings,
            wall_tolerance_m=self.wall_tolerance_m,
        )

    @classmethod
    def from_config(cls, config: SiteConfig) -> "SiteIn":
        """Return the wire form of a stored value."""
        return cls(
            name=config.name,
            s_max_m=config.s_max_m,
            hops=None if config.hops is None else list(config.hops),
            expected=config.expected,
            landmark_key=config.landmark_key,
            min_rssi_dbm=config.min_rssi_dbm,
            max_age_s=config.max_age_s,
            detection=list(config.detection),
            quorum=config.quorum,
            quarantine=config.quarantine,
            retention=None
            if config.retention is None
            else Retention(
                epoch_days=config.retention[0] / DAY_S, epochs=int(config.retention[1])
            ),
            r_geo_m=None if config.r_geo_m is None else list(config.r_geo_m),
            distance=config.distance,
            origin=None
            if config.origin is None
            else Origin(lat=config.origin[0], lon=config.origin[1]),
            track_headings=config.track_headings,
            wall_tolerance_m=config.wall_tolerance_m,
        )


class SiteOut(Wire):
    """A site and what it holds."""

    site: str
    config: SiteIn
    map_version: str | None
    observations: int
    landmarks: int


class SiteList(Wire):
    """All sites."""

    sites: list[SiteOut]
    next: str | None = Field(description="Cursor of the next page; null on the last.")


class MapOut(Wire):
    """What became of a map."""

    version: str = Field(description="Content hash.")
    structures: int = Field(description="After touching ones were merged.")
    courtyards: int = Field(description="Enclosed open places; no device gets there.")
    bounds_m: list[float] = Field(description="West, south, east, north.")
    free_area_m2: float
    origin: Origin | None


class HeightMapOut(Wire):
    """Expected holes over the map, row by row from the south-west corner."""

    hops: int
    expected: Literal["simulated", "geometric"]
    r_geo_m: float | None = Field(description="null when simulated.")
    cell_m: float
    west_m: float
    south_m: float
    columns: int
    rows: int
    values: list[list[float | None]] = Field(description="null where nobody can be.")
    spread: list[list[float | None]] | None = Field(
        description="Deviation of the counts; null when geometric."
    )
