"""What a site has learnt about itself, as values."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Learnt:
    """What the scans of a site say about its radio and its sensor."""

    map_version: str
    scans: int
    transmitters: int
    range_m: float
    dropout: float
    evenness: int
    hops: tuple[int, ...]
    information_bits: tuple[float, ...]
    correlation_m: float

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        listed = {name: tuple(data[name]) for name in ("hops", "information_bits")}
        return cls(**{**data, **listed})


@dataclass(frozen=True, slots=True)
class Expectation:
    """How far the simulation of a site's sensor is, and what the last one has taught."""

    state: str
    done: int
    of: int
    reason: str | None
    learnt: Learnt | None

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        learnt = None if data["learnt"] is None else Learnt.from_json(data["learnt"])
        return cls(**{**data, "learnt": learnt})


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    topic: str
    verdict: str
    text: str
    advice: str
    setting: dict[str, float] | None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Whether counting holes helps to localize on a site, and what could be set."""

    verdict: str
    summary: str
    findings: tuple[Finding, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        findings = tuple(Finding(**finding) for finding in data["findings"])
        return cls(data["verdict"], data["summary"], findings)
