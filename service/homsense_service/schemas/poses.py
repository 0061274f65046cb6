"""Poses on the wire."""

from typing import Literal

from pydantic import Field

from homsense_service.schemas.wire import Origin, Wire


class HeadingOut(Wire):
    """A circular mean and how much the directions agree."""

    mean_rad: float
    resultant: float


class ModeOut(Wire):
    """One hypothesis."""

    weight: float
    x_m: float
    y_m: float
    covariance: list[list[float]]
    heading: HeadingOut
    accuracy_m: float


class BestPose(Wire):
    """The top mode."""

    x_m: float
    y_m: float
    heading_rad: float
    accuracy_m: float


class MeasurementOut(Wire):
    """What the sensor counted."""

    hops: list[int]
    holes: list[int]


class HealthOut(Wire):
    """State of the filter."""

    ess: float
    particles: int


class PoseOut(Wire):
    """A pose distribution in short."""

    session: str
    seq: int
    tick: int
    t: float | None
    status: Literal["initializing", "diffuse", "ambiguous", "tracking"]
    pose: BestPose | None = Field(description="null when diffuse or initializing.")
    confidence: float = Field(description="Mass of the top mode.")
    modes: list[ModeOut]
    region_area_m2: dict[str, float]
    measurement: MeasurementOut | None
    health: HealthOut
    map_version: str
    geo: Origin | None = Field(description="The top mode on Earth.")


class SessionOut(Wire):
    """An open session."""

    session: str
    site: str
    map_version: str
    seed: int
    hops: list[int]
    r_geo_m: list[float]
    pose: PoseOut


class ParticlesOut(Wire):
    """A thinned set of particles of equal weight: x m, y m, heading rad."""

    particles: list[list[float]]
