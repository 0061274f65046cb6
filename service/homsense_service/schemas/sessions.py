"""Session requests on the wire."""

from dataclasses import replace
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from shapely.geometry import Polygon

import homsense
from homsense.registered.place import LOST
from homsense_service.own_motion import Motion, Walked
from homsense_service.schemas.wire import HopList, Landmarks, Moment, Wire, unix_seconds
from homsense_service.sensors import Kind, Sensor

_IMU, _NOISE, _ODOMETRY = homsense.ImuMotion(), homsense.CountNoise(), homsense.OdometryMotion()
_KLD, _AMCL, _RELOCATION = homsense.KldSampling(), homsense.AugmentedMcl(), homsense.Relocation()
_DEFAULTS = homsense.LocalizerConfig()


class HeadingIn(Wire):
    """A compass at the start."""

    mean_rad: float = Field(ge=-1e6, le=1e6)
    std_rad: float = Field(gt=0, description="From a full turn on the heading is unknown.")

    def to_prior(self) -> homsense.HeadingPrior:
        """Return the value."""
        return homsense.HeadingPrior(self.mean_rad, self.std_rad)


class UniformIn(Wire):
    """Anywhere in free space."""

    type: Literal["uniform"]
    heading: HeadingIn | None = None


class GaussianIn(Wire):
    """Around a place."""

    type: Literal["gaussian"]
    x_m: float
    y_m: float
    std_m: float = Field(gt=0, le=1e6)
    heading: HeadingIn | None = None


class PolygonIn(Wire):
    """Within a polygon, metres."""

    type: Literal["polygon"]
    ring: list[Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        min_length=3, max_length=10_000
    )
    heading: HeadingIn | None = None


PriorIn = Annotated[UniformIn | GaussianIn | PolygonIn, Field(discriminator="type")]


class OdometryIn(Wire):
    """Error of odometry, as ratios of standard deviations."""

    type: Literal["odometry"]
    translation_per_m: float = Field(default=_ODOMETRY.translation_per_m, ge=0, le=100)
    translation_per_rad: float = Field(default=_ODOMETRY.translation_per_rad, ge=0, le=100)
    rotation_per_m: float = Field(default=_ODOMETRY.rotation_per_m, ge=0, le=100)
    rotation_per_rad: float = Field(default=_ODOMETRY.rotation_per_rad, ge=0, le=100)
    translation_drift: float = Field(
        default=_ODOMETRY.translation_drift, ge=0, le=100, description="Also at rest, m/sqrt(s)."
    )
    rotation_drift: float = Field(
        default=_ODOMETRY.rotation_drift, ge=0, le=100, description="Also at rest, rad/sqrt(s)."
    )

    def to_model(self) -> homsense.OdometryMotion:
        """Return the value."""
        return homsense.OdometryMotion(**self.model_dump(exclude={"type"}))


class ImuIn(Wire):
    """Gaussian error of accelerations, the paper's by default."""

    type: Literal["imu"]
    sigma_linear: float = Field(default=_IMU.sigma_linear, ge=0, le=1000, description="m/s^2")
    sigma_angular: float = Field(default=_IMU.sigma_angular, ge=0, le=1000, description="rad/s^2")

    def to_model(self) -> homsense.ImuMotion:
        """Return the value."""
        return homsense.ImuMotion(self.sigma_linear, self.sigma_angular)


MotionIn = Annotated[OdometryIn | ImuIn, Field(discriminator="type")]


class SensorIn(Wire):
    """What a session measures, and the error of that."""

    type: Literal["homology", "registered", "both", "auto"] = Field(
        default="auto",
        description="homology: holes are counted. registered: a scan is recognized among those of "
        "the crowd, whose tracks have been placed on the map. both: the two together. auto: "
        "registered where a crowd with tracks has found its place beyond doubt by now, both where "
        "counts tell two thirds as much about those places or more; else homology, and always "
        "when hops or expected are given.",
    )
    hops: HopList | None = Field(default=None, description="The site's when absent.")
    expected: Literal["simulated", "geometric"] | None = Field(
        default=None, description="How counts are expected; the site's when absent."
    )
    sigma: float = Field(
        default=_NOISE.sigma,
        gt=0,
        le=1e6,
        description="Deviation of a count, holes; geometric only.",
    )
    floor: float = Field(
        default=_NOISE.floor, ge=0, lt=1, description="Share that says nothing; geometric only."
    )
    correlation_m: float | None = Field(
        default=None,
        gt=0,
        le=1e6,
        description="Way after which the error of the counts is new, metres; when absent as "
        f"simulated, or {_NOISE.correlation_m:.0f}.",
    )

    def to_noise(self, of_site: homsense.FieldNoise | None) -> homsense.Noise:
        """Return the value."""
        if of_site is None:
            correlation_m = self.correlation_m or _NOISE.correlation_m
            return homsense.CountNoise(self.sigma, self.floor, correlation_m)
        if self.correlation_m is None:
            return of_site
        return replace(of_site, correlation_m=self.correlation_m)


class RelocationIn(Wire):
    """A standing hypothesis that the pose was lost; new particles come from p(x | z)."""

    type: Literal["relocation"]
    probability: float | None = Field(
        default=None,
        ge=0,
        lt=1,
        description="Between two independent measurements; when absent "
        f"{_RELOCATION.probability} for counts and {LOST} among the crowd, whose measurements are "
        "independent after a few metres.",
    )

    def to_recovery(self, sensor: Kind) -> homsense.Recovery:
        """Return the value."""
        if self.probability is not None:
            return homsense.Relocation(self.probability)
        return _RELOCATION if sensor == "homology" else homsense.Relocation(LOST)


class AmclIn(Wire):
    """The rule of AMCL: random particles when the likelihood falls."""

    type: Literal["amcl"]
    recovery_alpha_slow: float = Field(default=_AMCL.alpha_slow, ge=0, le=1)
    recovery_alpha_fast: float = Field(default=_AMCL.alpha_fast, ge=0, le=1)

    def to_recovery(self, _sensor: Kind) -> homsense.Recovery:
        """Return the value."""
        return homsense.AugmentedMcl(self.recovery_alpha_slow, self.recovery_alpha_fast)


class NoRecoveryIn(Wire):
    """Particles are never drawn anew."""

    type: Literal["none"]

    def to_recovery(self, _sensor: Kind) -> None:
        """Return nothing."""


RecoveryIn = Annotated[RelocationIn | AmclIn | NoRecoveryIn, Field(discriminator="type")]


class AdaptiveIn(Wire):
    """As many particles as the spread asks for (KLD sampling)."""

    least: int = Field(default=_KLD.least, ge=1, le=1_000_000)
    most: int = Field(default=_KLD.most, ge=1, le=1_000_000)
    error: float = Field(default=_KLD.error, gt=0, le=10, description="Nats.")
    quantile: float = Field(
        default=_KLD.quantile, ge=0.5, lt=1, description="A probability, not a z-score."
    )
    cell_m: float = Field(default=_KLD.cell_m, gt=0, le=1e6)
    cell_rad: float = Field(default=_KLD.cell_rad, gt=0, le=7)

    def to_sampling(self) -> homsense.KldSampling:
        """Return the value."""
        return homsense.KldSampling(**self.model_dump())


class SessionIn(Wire):
    """How to localize."""

    particles: int = Field(default=8000, ge=1, le=1_000_000)
    seed: int | None = Field(default=None, ge=0, lt=2**64, description="Drawn when absent.")
    prior: PriorIn = UniformIn(type="uniform")
    motion: MotionIn = OdometryIn(type="odometry")
    sensor: SensorIn = SensorIn()
    resample_below: float = Field(
        default=_DEFAULTS.resample_below, ge=0, le=1, description="Share of particles."
    )
    scheme: Literal["systematic", "stratified", "residual", "multinomial"] = "systematic"
    recovery: RecoveryIn = RelocationIn(type="relocation")
    adaptive: AdaptiveIn | None = None
    contribute: bool = Field(
        default=False, description="Whether its scans join the crowd of the site, with its track."
    )
    weigh_every_m: float = Field(
        default=_DEFAULTS.weigh_every_m,
        ge=0,
        le=1e6,
        description="A device that has moved less learns nothing from another scan, metres.",
    )

    def to_localizer_config(self, cell_m: float, sensor: Sensor) -> homsense.LocalizerConfig:
        """Return the value."""
        return homsense.LocalizerConfig(
            particles=self.particles,
            motion=self.motion.to_model(),
            noise=self.sensor.to_noise(sensor.noise),
            prior=_prior(self.prior),
            resample_below=self.resample_below,
            scheme=self.scheme,
            recovery=self.recovery.to_recovery(sensor.kind),
            adaptive=None if self.adaptive is None else self.adaptive.to_sampling(),
            weigh_every_m=self.weigh_every_m,
            cell_m=cell_m,
        )


def _prior(wire: UniformIn | GaussianIn | PolygonIn) -> homsense.Prior:
    heading = homsense.HeadingPrior() if wire.heading is None else wire.heading.to_prior()
    if isinstance(wire, GaussianIn):
        return homsense.GaussianPrior(wire.x_m, wire.y_m, wire.std_m, heading)
    if isinstance(wire, PolygonIn):
        polygon = Polygon(wire.ring)
        if not polygon.is_valid:
            message = "the ring crosses itself"
            raise homsense.InvalidConfigurationError(message, "prior.ring")
        return homsense.PolygonPrior(polygon, heading)
    return homsense.UniformPrior(heading)


class DeltaIn(Wire):
    """Motion since the step before, in the body frame at its start."""

    forward_m: float = Field(default=0.0, ge=-1e6, le=1e6)
    left_m: float = Field(default=0.0, ge=-1e6, le=1e6)
    turn_rad: float = Field(default=0.0, ge=-1e6, le=1e6)
    std: list[Annotated[float, Field(ge=0, le=1e6)]] | None = Field(
        default=None, min_length=3, max_length=3, description="Deviations of the three."
    )
    covariance: list[float] | None = Field(
        default=None,
        min_length=9,
        max_length=9,
        description="Of the three, row by row; goes before std.",
    )

    def to_delta(self) -> homsense.Delta:
        """Return the value."""
        std = None if self.std is None else (self.std[0], self.std[1], self.std[2])
        covariance = None if self.covariance is None else tuple(self.covariance)
        delta = homsense.Delta(
            self.forward_m, self.left_m, self.turn_rad, std=std, covariance=covariance
        )
        return delta.checked()


class ImuSampleIn(Wire):
    """One reading of a level accelerometer and a gyroscope."""

    dt_s: float = Field(gt=0, le=10, description="How long it holds, seconds.")
    forward: float = Field(ge=-1000, le=1000, description="Acceleration, m/s^2.")
    left: float = Field(ge=-1000, le=1000, description="Acceleration, m/s^2.")
    turn: float = Field(ge=-1000, le=1000, description="Turn rate, rad/s.")

    def to_sample(self) -> homsense.ImuSample:
        """Return the value."""
        return homsense.ImuSample(self.dt_s, self.forward, self.left, self.turn)


class WalkedIn(Wire):
    """A pedestrian's step."""

    length_m: float = Field(ge=0, le=100)
    heading_rad: float = Field(
        ge=-1e6, le=1e6, description="From any direction that stays the same."
    )


class StepIn(Wire):
    """One input of a session."""

    seq: int = Field(ge=1, lt=2**53)
    t: Moment | None = None
    delta: DeltaIn | None = None
    imu: list[ImuSampleIn] | None = Field(
        default=None, min_length=1, max_length=1000, description="In place of delta."
    )
    walked: WalkedIn | None = Field(default=None, description="In place of delta.")
    landmarks: Landmarks | None = None

    @model_validator(mode="after")
    def _has_one_motion(self) -> Self:
        if sum(motion is not None for motion in (self.delta, self.imu, self.walked)) > 1:
            message = "a step has one of delta, imu and walked"
            raise ValueError(message)
        return self

    def motion(self) -> Motion:
        """Return what the device says about its motion."""
        if self.imu is not None:
            return tuple(sample.to_sample() for sample in self.imu)
        if self.walked is not None:
            return Walked(self.walked.length_m, self.walked.heading_rad)
        return homsense.Delta() if self.delta is None else self.delta.to_delta()

    def seconds(self) -> float | None:
        """Return the time in Unix seconds."""
        return None if self.t is None else unix_seconds(self.t)


class StepsIn(Wire):
    """Steps of a session."""

    steps: list[StepIn] = Field(min_length=1, max_length=256)
