"""Scans, the complex and its local homology on the wire."""

from typing import Annotated, Any

from pydantic import (
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    WrapValidator,
    model_validator,
)

from homsense_service.records import StoredScan
from homsense_service.schemas.wire import (
    HopList,
    Identifier,
    Landmarks,
    Moment,
    Wire,
    readings,
    unix_seconds,
)


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
        heard = readings(self.landmarks)
        if not heard:
            message = "landmarks: all have opted out"
            raise ValueError(message)
        return StoredScan(
            self.device,
            self.scan_id,
            unix_seconds(self.observed_at),
            heard,
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


def _first_reason(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    path = ".".join(str(part) for part in first["loc"])
    return f"{path}: {first['msg']}" if path else str(first["msg"])


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


class DeletedOut(Wire):
    """What was deleted."""

    scans: int


class RawComplexOut(Wire):
    """The complex of all that any device has seen."""

    landmarks: int
    facets: int
    betti: list[int]


class QuarantinedOut(Wire):
    """A transmitter that is left out because it seems to have moved."""

    landmark: str
    reason: str
    hops_apart: float | None = Field(
        description="In the mean; null when nothing else joins its two places."
    )
    here: list[str] = Field(description="Some of the landmarks seen beside it at one place.")
    there: list[str] = Field(description="Some of those at the other.")


class ComplexOut(Wire):
    """What a quorum of devices has seen, without the transmitters in quarantine."""

    version: int
    digest: str
    observations: int
    devices: int
    landmarks: int
    facets: int
    edges: int
    betti: list[int]
    euler: int | None = Field(description="null when the complex is too dense to tell.")
    quorum: int = Field(description="Distinct devices that must have seen landmarks together.")
    raw: RawComplexOut
    quarantined: list[QuarantinedOut]


class RangePointOut(Wire):
    """What the complex would be at one RSSI cut."""

    min_rssi_dbm: float
    landmarks_per_scan: float
    landmarks: int
    facets: int
    betti: list[int]
    euler: int | None = Field(description="null when the complex is too dense to tell.")
    alarm: bool | None = Field(description="Whether chi is not b0 - b1 (Lemma 5.1 fails).")
    stable: int = Field(description="Holes from the next stronger cut to the next weaker one.")


_CHECKED = "How many scans were looked at: evenly over the log, HOMSENSE_CHECK_SCANS at most."


class RangeCurveOut(Wire):
    """The range self-check of a site."""

    version: int
    scans: int = Field(description=_CHECKED)
    min_rssi_dbm: float | None = Field(description="The cut in force.")
    chosen_min_rssi_dbm: float | None = Field(
        description="The cut with the most stable holes; null when no hole is stable."
    )
    points: list[RangePointOut]


class WitnessPointOut(Wire):
    """What the complex would be for one number of witnesses."""

    witnesses: int
    landmarks: int
    facets: int
    betti: list[int]
    lasting: int = Field(description="Holes that are still there with one witness fewer.")


class WitnessCurveOut(Wire):
    """The witness check of a site."""

    version: int
    scans: int = Field(description=_CHECKED)
    quorum: int = Field(description="The quorum in force.")
    median_witnesses: float = Field(description="Distinct devices that have seen a landmark.")
    suggested_quorum: int = Field(description="Grows with the density of the crowd.")
    points: list[WitnessPointOut]


PseudoRadius = Annotated[float, Field(ge=0, le=1e6)]


class LocalHomologyIn(Wire):
    """A question to the homological sensor."""

    landmarks: Landmarks
    hops: HopList | None = Field(default=None, description="The site's when absent.")
    r_pseudo_m: Annotated[list[PseudoRadius], Field(min_length=1, max_length=8)] | None = Field(
        default=None,
        description="Radii in metres instead of hops; every edge is as long as s_max_m.",
    )
    lasting: bool = Field(
        default=False, description="Tell how many holes are still there one hop farther."
    )
    cycles: bool = Field(default=False, description="Tell which holes are meant.")

    @model_validator(mode="after")
    def _hops_or_metres(self) -> "LocalHomologyIn":
        if self.r_pseudo_m is not None and (self.hops is not None or self.lasting):
            message = "r_pseudo_m goes with neither hops nor lasting"
            raise ValueError(message)
        return self


class Level(Wire):
    """Homology of one neighborhood."""

    hops: int | None = Field(description="null when asked for in metres.")
    r_pseudo_m: float | None = Field(description="null when asked for in hops.")
    vertices: int
    facets: int
    betti: list[int]
    euler: int | None
    holes: int = Field(description="b1 of what a quorum of devices has seen: the measurement.")
    raw_holes: int = Field(description="b1 of what any device has seen.")
    lasting: int | None = Field(description="Holes that are no artifact of the cut; if asked.")
    cycles: list[list[str]] | None = Field(
        description="Landmarks of a short closed walk round each hole; if asked."
    )


class LocalHomologyOut(Wire):
    """The answer of the homological sensor."""

    complex_version: int
    known: int = Field(description="How many of the landmarks the complex knows.")
    levels: list[Level]
