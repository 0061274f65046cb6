"""Session requests on the wire."""

from typing import Annotated, Literal

from pydantic import Field
from shapely.geometry import Polygon

import homsense
from homsense_service.schemas.wire import HopList, Landmarks, Moment, Wire, unix_seconds

_IMU, _NOISE, _ODOMETRY = homsense.ImuMotion(), homsense.CountNoise(), homsense.OdometryMotion()


class HeadingIn(Wire):
    """A compass at the start."""

    mean_rad: float
    std_rad: float = Field(gt=0)

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
    """The homological sensor and its error."""

    type: Literal["homology", "auto"] = "homology"
    hops: HopList | None = Field(default=None, description="The site's when absent.")
    sigma: float = Field(
        default=_NOISE.sigma, gt=0, le=1e6, description="Deviation of a count, holes."
    )
    floor: float = Field(default=_NOISE.floor, ge=0, lt=1, description="Share that says nothing.")
    correlation_m: float = Field(
        default=_NOISE.correlation_m,
        gt=0,
        le=1e6,
        description="Way after which the error is new, metres.",
    )

    def to_noise(self) -> homsense.CountNoise:
        """Return the value."""
        return homsense.CountNoise(self.sigma, self.floor, self.correlation_m)


class SessionIn(Wire):
    """How to localize."""

    particles: int = Field(default=8000, ge=1, le=1_000_000)
    seed: int | None = Field(default=None, ge=0, lt=2**64, description="Drawn when absent.")
    prior: PriorIn = UniformIn(type="uniform")
    motion: MotionIn = OdometryIn(type="odometry")
    sensor: SensorIn = SensorIn()
    resample_below: float = Field(default=0.5, ge=0, le=1, description="Share of particles.")

    def to_localizer_config(self, cell_m: float) -> homsense.LocalizerConfig:
        """Return the value."""
        return homsense.LocalizerConfig(
            particles=self.particles,
            motion=self.motion.to_model(),
            noise=self.sensor.to_noise(),
            prior=_prior(self.prior),
            resample_below=self.resample_below,
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

    def to_delta(self) -> homsense.Delta:
        """Return the value."""
        std = None if self.std is None else (self.std[0], self.std[1], self.std[2])
        return homsense.Delta(self.forward_m, self.left_m, self.turn_rad, std=std)


class StepIn(Wire):
    """One input of a session."""

    seq: int = Field(ge=1, lt=2**53)
    t: Moment | None = None
    delta: DeltaIn = DeltaIn()
    landmarks: Landmarks | None = None

    def seconds(self) -> float | None:
        """Return the time in Unix seconds."""
        return None if self.t is None else unix_seconds(self.t)


class StepsIn(Wire):
    """Steps of a session."""

    steps: list[StepIn] = Field(min_length=1, max_length=256)
