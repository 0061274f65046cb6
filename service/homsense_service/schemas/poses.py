"""Poses on the wire."""

from typing import Literal

from pydantic import Field

from homsense_service.schemas.wire import Origin, Wire

Status = Literal["initializing", "diffuse", "ambiguous", "tracking", "suspect", "unmapped"]


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
    """What the scan was worth."""

    hops: list[int] = Field(description="Neighborhoods; empty when nothing is counted.")
    holes: list[float] | None = Field(
        description="Of the visible set; the mean over its landmarks when simulated; null when "
        "nothing is counted."
    )
    resembled: int | None = Field(
        description="Scans of the crowd that it resembles; null without a registered crowd."
    )


class HealthOut(Wire):
    """State of the filter."""

    ess: float = Field(description="Effective sample size.")
    particles: int
    log_evidence: float = Field(description="Log-likelihood of the last measurement, nats.")
    evidence_vs_uniform: float = Field(
        description="The same, above its mean over all free space, nats."
    )
    relocation_p: float = Field(description="Probability that the pose was lost.")
    relocated: int = Field(description="Particles drawn from the measurement at the last step.")


class PoseOut(Wire):
    """A pose distribution in short."""

    session: str
    seq: int
    tick: int
    t: float | None
    status: Status = Field(
        description="unmapped: a registered crowd has likely not been where the device is."
    )
    pose: BestPose | None = Field(description="null unless ambiguous or tracking.")
    confidence: float = Field(description="Mass of the top mode.")
    modes: list[ModeOut]
    region_area_m2: dict[str, float]
    measurement: MeasurementOut | None
    coverage: float | None = Field(
        description="How likely the crowd has been there; null without a registered crowd."
    )
    health: HealthOut
    map_version: str
    digest: str = Field(description="Hash of the particles: equal for equal inputs.")
    geo: Origin | None = Field(description="The top mode on Earth.")


class SessionOut(Wire):
    """An open session."""

    session: str
    site: str
    map_version: str
    seed: int
    sensor: Literal["homology", "registered", "both"]
    hops: list[int] = Field(description="Neighborhoods; empty when nothing is counted.")
    expected: Literal["simulated", "geometric"] | None = Field(
        description="null when nothing is counted."
    )
    r_geo_m: list[float] | None = Field(description="null when simulated.")
    correlation_m: float = Field(description="Way after which the error is new, metres.")
    pose: PoseOut


class SessionList(Wire):
    """Sessions of a site."""

    sessions: list[str]
    next: str | None = Field(description="Cursor of the next page; null on the last.")


class ParticlesOut(Wire):
    """A thinned set of particles of equal weight: x m, y m, heading rad."""

    particles: list[list[float]]
