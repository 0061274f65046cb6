"""What all of the wire shares: strictness, identifiers, times, readings."""

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from homsense_service.records import StoredReading

MAX_HOPS = 16
NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"

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

Hops = Annotated[int, Field(ge=0, le=MAX_HOPS)]

HopList = Annotated[list[Hops], Field(min_length=1, max_length=8)]


class Origin(Wire):
    """Where the local frame lies on Earth, WGS84 degrees."""

    lat: float = Field(ge=-90, le=90)
    lon: float = Field(ge=-180, le=180)


class ReadingIn(Wire):
    """One landmark heard in a scan."""

    id: Identifier
    rssi: float | None = Field(default=None, ge=-200, le=100, description="dBm.")
    age_s: float = Field(default=0.0, ge=0, description="Age of the sighting, seconds.")
    ssid: str | None = Field(
        default=None,
        max_length=200,
        description="Name of the network, only to see whether its owner has opted out; not kept.",
    )

    @property
    def has_opted_out(self) -> bool:
        """Whether the owner of the network does not want it to be used."""
        return has_opted_out(self.id) or (self.ssid is not None and has_opted_out(self.ssid))


Landmarks = Annotated[list[Identifier | ReadingIn], Field(max_length=MAX_LANDMARKS)]


def has_opted_out(name: str) -> bool:
    """Tell whether the owner of a network does not want it to be used."""
    return name.endswith("_nomap") or "_optout" in name


def readings(landmarks: list[str | ReadingIn]) -> tuple[StoredReading, ...]:
    """Return what was heard, whichever way it was written, but for networks that opted out."""
    return tuple(
        StoredReading(entry)
        if isinstance(entry, str)
        else StoredReading(entry.id, entry.rssi, entry.age_s)
        for entry in landmarks
        if not (has_opted_out(entry) if isinstance(entry, str) else entry.has_opted_out)
    )
