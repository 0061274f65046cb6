"""The wire: what requests and answers look like, and how they become values."""

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    StringConstraints,
    ValidationError,
    WrapValidator,
    model_validator,
)
from shapely.geometry import Polygon

import homsense
from homsense_service.records import SiteConfig, StoredReading, StoredScan

MAX_HOPS = 16
MAX_LANDMARKS = 200_000


def unix_seconds(moment: float | str) -> float:
    """Return a time in Unix seconds; text is RFC 3339, UTC unless it says otherwise."""
    if not isinstance(moment, str):
        return moment
    parsed = datetime.fromisoformat(moment)
    aware = parsed if parsed.tzinfo else parsed.replace(tzinfo=UTC)
    return aware.timestamp()


def _sound_moment(moment: float | str) -> float | str:
    unix_seconds(moment)
    return moment


class Wire(BaseModel):
    """Strict: nothing is coerced, nothing unknown is accepted, no number is NaN or infinite."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


Moment = Annotated[
    float | str, AfterValidator(_sound_moment), Field(description="Unix seconds or RFC 3339.")
]
Identifier = Annotated[str, StringConstraints(min_length=1, max_length=200)]
SiteName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
Hops = Annotated[int, Field(ge=0, le=MAX_HOPS)]
HopList = Annotated[list[Hops], Field(min_length=1, max_length=8)]


class Origin(Wire):
    """Where the local frame lies on Earth, WGS84 degrees."""

    lat: float = Field(ge=-90, le=90)
    lon: float = Field(ge=-180, le=180)


class SiteIn(Wire):
    """Configuration of a site."""

    name: Annotated[str, StringConstraints(max_length=200)] = ""
    s_max_m: float = Field(default=80.0, gt=0, le=100_000, description="Sensing range, metres.")
    hops: HopList = Field(
        default=[2, 3], description="Neighborhoods whose holes are counted; near and far."
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
    quorum: Literal[1] = Field(
        default=1, description="Distinct devices that must witness a simplex."
    )
    expected: Literal["geometric"] = Field(
        default="geometric", description="How counts are expected: structures within r_geo."
    )
    distance: Literal["euclidean", "geodesic"] = Field(
        default="euclidean", description="Distance to a structure: straight, or as one walks."
    )
    r_geo_m: list[Annotated[float, Field(gt=0, le=1e6)]] | None = Field(
        default=None,
        description="Geodetic radius of each neighborhood; calibrated from the scans when absent.",
    )
    origin: Origin | None = Field(default=None, description="Georeference of a local map.")

    @model_validator(mode="after")
    def _consistent(self) -> "SiteIn":
        if sorted(set(self.hops)) != self.hops:
            message = "hops must rise"
            raise ValueError(message)
        if self.r_geo_m is not None and len(self.r_geo_m) != len(self.hops):
            message = "r_geo_m must hold one radius for each of hops"
            raise ValueError(message)
        return self

    def to_config(self) -> SiteConfig:
        """Return the value for the store."""
        return SiteConfig(
            name=self.name,
            s_max_m=self.s_max_m,
            hops=tuple(self.hops),
            landmark_key=self.landmark_key,
            min_rssi_dbm=self.min_rssi_dbm,
            max_age_s=self.max_age_s,
            r_geo_m=None if self.r_geo_m is None else tuple(self.r_geo_m),
            distance=self.distance,
            origin=None if self.origin is None else (self.origin.lat, self.origin.lon),
        )

    @classmethod
    def from_config(cls, config: SiteConfig) -> "SiteIn":
        """Return the wire form of a stored value."""
        return cls(
            name=config.name,
            s_max_m=config.s_max_m,
            hops=list(config.hops),
            landmark_key=config.landmark_key,
            min_rssi_dbm=config.min_rssi_dbm,
            max_age_s=config.max_age_s,
            r_geo_m=None if config.r_geo_m is None else list(config.r_geo_m),
            distance=config.distance,
            origin=None
            if config.origin is None
            else Origin(lat=config.origin[0], lon=config.origin[1]),
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


class MapOut(Wire):
    """What became of a map."""

    version: str = Field(description="Content hash.")
    structures: int = Field(description="After touching ones were merged.")
    courtyards: int = Field(description="Enclosed open places; no device gets there.")
    bounds_m: list[float] = Field(description="West, south, east, north.")
    free_area_m2: float
    origin: Origin | None


class ReadingIn(Wire):
    """One landmark heard in a scan."""

    id: Identifier
    rssi: float | None = Field(default=None, ge=-200, le=100, description="dBm.")
    age_s: float = Field(default=0.0, ge=0, description="Age of the sighting, seconds.")


Landmarks = Annotated[list[Identifier | ReadingIn], Field(max_length=MAX_LANDMARKS)]


class Track(Wire):
    """The device's own dead-reckoned pose in its own frame."""

    id: Identifier
    x_m: float
    y_m: float
    heading_rad: float | None = None


class ScanIn(Wire):
    """One scan."""

    device: Identifier
    scan_id: Identifier
    observed_at: Moment
    landmarks: Landmarks
    track: Track | None = None

    def to_stored(self, max_landmarks: int) -> StoredScan:
        """Return the value for the store; raise ValueError when it makes no sense."""
        if not self.landmarks:
            message = "landmarks: no landmark was heard"
            raise ValueError(message)
        if len(self.landmarks) > max_landmarks:
            message = f"landmarks: {len(self.landmarks)} are more than the limit {max_landmarks}"
            raise ValueError(message)
        return StoredScan(
            self.device,
            self.scan_id,
            unix_seconds(self.observed_at),
            readings(self.landmarks),
            None if self.track is None else self.track.model_dump(),
        )


class DroppedScan(Wire):
    """A scan that is not one."""

    reason: str


def _keep_or_drop(
    value: Any,  # noqa: ANN401 - anything may be posted
    handler: ModelWrapValidatorHandler[ScanIn],
) -> ScanIn | DroppedScan:
    try:
        return handler(value)
    except ValidationError as error:
        return DroppedScan(reason=_first_reason(error))


class ScansIn(Wire):
    """A batch of scans; one bad scan does not spoil it."""

    scans: list[Annotated[ScanIn, WrapValidator(_keep_or_drop)]] = Field(
        min_length=1, max_length=1000
    )


class Dropped(Wire):
    """A scan that was not taken, and why."""

    index: int
    reason: str


class ScansOut(Wire):
    """What became of a batch; written when it is durable."""

    accepted: int
    duplicate: int
    dropped: list[Dropped]
    complex_version: int


class ComplexOut(Wire):
    """The landmark complex of a site."""

    version: int
    digest: str
    observations: int
    devices: int
    landmarks: int
    facets: int
    edges: int
    betti: list[int]
    euler: int | None = Field(description="null when the complex is too dense to tell.")


class LocalHomologyIn(Wire):
    """A question to the homological sensor."""

    landmarks: Landmarks
    hops: HopList | None = Field(default=None, description="The site's when absent.")


class Level(Wire):
    """Homology of one neighborhood."""

    hops: int
    vertices: int
    facets: int
    betti: list[int]
    euler: int | None
    holes: int


class LocalHomologyOut(Wire):
    """The answer of the homological sensor."""

    complex_version: int
    known: int = Field(description="How many of the landmarks the complex knows.")
    levels: list[Level]


class HeightMapOut(Wire):
    """Expected holes over the map, row by row from the south-west corner."""

    hops: int
    r_geo_m: float
    cell_m: float
    west_m: float
    south_m: float
    columns: int
    rows: int
    values: list[list[float]]


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
    translation_per_m: float = Field(default=0.16, ge=0, le=100)
    translation_per_rad: float = Field(default=0.1, ge=0, le=100)
    rotation_per_m: float = Field(default=0.01, ge=0, le=100)
    rotation_per_rad: float = Field(default=0.05, ge=0, le=100)

    def to_model(self) -> homsense.OdometryMotion:
        """Return the value."""
        return homsense.OdometryMotion(**self.model_dump(exclude={"type"}))


class ImuIn(Wire):
    """Gaussian error of accelerations, the paper's by default."""

    type: Literal["imu"]
    sigma_linear: float = Field(default=10.0, ge=0, le=1000, description="m/s^2")
    sigma_angular: float = Field(default=0.435, ge=0, le=1000, description="rad/s^2")

    def to_model(self) -> homsense.ImuMotion:
        """Return the value."""
        return homsense.ImuMotion(self.sigma_linear, self.sigma_angular)


MotionIn = Annotated[OdometryIn | ImuIn, Field(discriminator="type")]


class SensorIn(Wire):
    """The homological sensor and its error."""

    type: Literal["homology", "auto"] = "homology"
    hops: HopList | None = Field(default=None, description="The site's when absent.")
    sigma: float = Field(default=1.5, gt=0, le=1e6, description="Deviation of a count, holes.")
    floor: float = Field(default=0.02, ge=0, lt=1, description="Share that says nothing.")
    correlation_m: float = Field(
        default=150.0, gt=0, le=1e6, description="Way after which the error is new, metres."
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


class HealthzOut(Wire):
    """The process lives."""

    status: Literal["ok"]


class InfoOut(Wire):
    """What this service is."""

    name: str
    version: str
    sites: int
    sessions: int


class FieldError(Wire):
    """An offending member of the request."""

    field: str
    message: str


class Problem(Wire):
    """RFC 9457 problem details."""

    type: str
    title: str
    status: int
    code: str
    detail: str
    errors: list[FieldError] | None = None


def readings(landmarks: list[str | ReadingIn]) -> tuple[StoredReading, ...]:
    """Return what was heard, whichever way it was written."""
    return tuple(
        StoredReading(entry)
        if isinstance(entry, str)
        else StoredReading(entry.id, entry.rssi, entry.age_s)
        for entry in landmarks
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


def _first_reason(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    path = ".".join(str(part) for part in first["loc"])
    return f"{path}: {first['msg']}" if path else str(first["msg"])
