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
    knows_crowd: bool
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
class Placement:
    """One way to lay the crowd on the map, and how probable it is among those that fit."""

    rotation_rad: float
    scale: float
    cost_m: float
    probability: float


@dataclass(frozen=True, slots=True)
class Placed:
    """The crowd on the map; `placements` are ordered by cost."""

    map_version: str
    tracked: int
    laid_out: int
    scans: int
    walks: int
    reach_m: float
    weakest_dbm: float
    cost_m: float
    margin_m: float
    mirror_margin_m: float
    strain: float
    doubtful: bool
    coverage: float
    information_bits: float
    placements: tuple[Placement, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        placements = tuple(Placement(**placement) for placement in data["placements"])
        return cls(**{**data, "placements": placements})


@dataclass(frozen=True, slots=True)
class Registration:
    """How far the registration of a crowd is, and where the last one lies."""

    state: str
    done: int
    of: int
    reason: str | None
    tracked: int
    placed: Placed | None

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        placed = None if data["placed"] is None else Placed.from_json(data["placed"])
        return cls(**{**data, "placed": placed})


@dataclass(frozen=True, slots=True)
class Floor:
    """How well a crowd fits one of several floors."""

    site: str
    map_version: str
    probability: float
    cost_m: float
    margin_m: float
    mirror_margin_m: float
    strain: float
    doubtful: bool


@dataclass(frozen=True, slots=True)
class Floors:
    """How far a ranking of floors is, and what the last one has told, the likeliest first."""

    state: str
    done: int
    of: int
    reason: str | None
    floors: tuple[Floor, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        return cls(**{**data, "floors": tuple(Floor(**floor) for floor in data["floors"])})


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    topic: str
    verdict: str
    text: str
    advice: str
    setting: dict[str, float | list[int]] | None


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
