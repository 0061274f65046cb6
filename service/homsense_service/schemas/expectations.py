"""What a site has learnt about itself on the wire."""

from typing import Literal

from pydantic import Field

from homsense_service.schemas.wire import Wire


class LearntOut(Wire):
    """What the scans of a site say about its radio and its sensor, without any label."""

    map_version: str
    scans: int = Field(description="How many there were.")
    transmitters: int
    range_m: float
    dropout: float = Field(description="Share of the transmitters in view that a scan misses.")
    evenness: int = Field(
        description="Of how many random places each transmitter took the one farthest from all "
        "others; 1 when they were placed independently."
    )
    knows_crowd: bool = Field(
        description="Whether the crowd had found its place on the map; else it is taken to walk "
        "everywhere alike."
    )
    hops: list[int] = Field(description="Neighborhoods worth counting.")
    information_bits: list[float] = Field(
        description="What a scan tells about the place with hops 1, 1 to 2, and so on."
    )
    correlation_m: float = Field(description="Way after which the error is new, metres.")


class ExpectationOut(Wire):
    """How far the simulation of a site's sensor is, and what the last one has taught."""

    state: Literal["none", "building", "ready", "failed"]
    done: int = Field(description="Placements simulated.")
    of: int
    reason: str | None = Field(description="Why it failed.")
    learnt: LearntOut | None


class FindingOut(Wire):
    """One thing that was looked at."""

    topic: str
    verdict: Literal["good", "doubtful", "bad"]
    text: str
    advice: str
    setting: dict[str, float | list[int]] | None = Field(
        description="Member of the configuration of the site, and the value to give it."
    )


class DiagnosisOut(Wire):
    """Whether counting holes helps to localize on a site, and what could be set."""

    verdict: Literal["good", "doubtful", "bad"]
    summary: str
    findings: list[FindingOut]
