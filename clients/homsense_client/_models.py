"""Answers of the service as values."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Site:
    """A site and what it holds."""

    name: str
    config: dict[str, Any]
    map_version: str | None
    observations: int
    landmarks: int

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        return cls(
            data["site"],
            dict(data["config"]),
            data["map_version"],
            data["observations"],
            data["landmarks"],
        )


@dataclass(frozen=True, slots=True)
class MapInfo:
    """What became of a map."""

    version: str
    structures: int
    courtyards: int
    bounds_m: tuple[float, float, float, float]
    free_area_m2: float

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        west, south, east, north = data["bounds_m"]
        return cls(
            data["version"],
            data["structures"],
            data["courtyards"],
            (west, south, east, north),
            data["free_area_m2"],
        )


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of a batch of scans."""

    accepted: int
    duplicate: int
    dropped: tuple[tuple[int, str], ...]
    complex_version: int

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        dropped = tuple((item["index"], item["reason"]) for item in data["dropped"])
        return cls(data["accepted"], data["duplicate"], dropped, data["complex_version"])


@dataclass(frozen=True, slots=True)
class RawComplex:
    """The complex of all that any device has seen."""

    landmarks: int
    facets: int
    betti: tuple[int, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        return cls(**{**data, "betti": tuple(data["betti"])})


@dataclass(frozen=True, slots=True)
class Quarantined:
    """A transmitter that is left out because it seems to have moved."""

    landmark: str
    reason: str
    hops_apart: float | None
    here: tuple[str, ...]
    there: tuple[str, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        return cls(**{**data, "here": tuple(data["here"]), "there": tuple(data["there"])})


@dataclass(frozen=True, slots=True)
class Complex:
    """The landmark complex of a site."""

    version: int
    digest: str
    observations: int
    devices: int
    landmarks: int
    facets: int
    edges: int
    betti: tuple[int, ...]
    euler: int | None
    quorum: int
    raw: RawComplex
    quarantined: tuple[Quarantined, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        parts = {
            "betti": tuple(data["betti"]),
            "raw": RawComplex.from_json(data["raw"]),
            "quarantined": tuple(map(Quarantined.from_json, data["quarantined"])),
        }
        return cls(**{**data, **parts})


@dataclass(frozen=True, slots=True)
class Level:
    """Homology of one neighborhood."""

    hops: int | None
    r_pseudo_m: float | None
    vertices: int
    facets: int
    betti: tuple[int, ...]
    euler: int | None
    holes: int
    raw_holes: int
    lasting: int | None
    cycles: tuple[tuple[str, ...], ...] | None

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        cycles = data["cycles"]
        listed = None if cycles is None else tuple(tuple(cycle) for cycle in cycles)
        return cls(**{**data, "betti": tuple(data["betti"]), "cycles": listed})


@dataclass(frozen=True, slots=True)
class LocalHomology:
    """The answer of the homological sensor."""

    complex_version: int
    known: int
    levels: tuple[Level, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        levels = tuple(Level.from_json(one) for one in data["levels"])
        return cls(data["complex_version"], data["known"], levels)


@dataclass(frozen=True, slots=True)
class Mode:
    """One hypothesis about the pose."""

    weight: float
    x_m: float
    y_m: float
    covariance: tuple[tuple[float, float], tuple[float, float]]
    heading_rad: float
    heading_resultant: float
    accuracy_m: float

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        (xx, xy), (yx, yy) = data["covariance"]
        return cls(
            data["weight"],
            data["x_m"],
            data["y_m"],
            ((xx, xy), (yx, yy)),
            data["heading"]["mean_rad"],
            data["heading"]["resultant"],
            data["accuracy_m"],
        )


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose distribution in short; `modes` are ordered by weight."""

    session: str
    seq: int
    t: float | None
    status: str
    modes: tuple[Mode, ...]
    region_area_m2: dict[str, float]
    holes: tuple[float, ...] | None
    resembled: int | None
    coverage: float | None
    ess: float
    relocation_p: float
    map_version: str
    digest: str
    geo: tuple[float, float] | None

    @property
    def best(self) -> Mode:
        """The top mode."""
        return self.modes[0]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        measured, geo = data["measurement"] or {}, data["geo"]
        holes = measured.get("holes")
        return cls(
            data["session"],
            data["seq"],
            data["t"],
            data["status"],
            tuple(Mode.from_json(mode) for mode in data["modes"]),
            dict(data["region_area_m2"]),
            None if holes is None else tuple(holes),
            measured.get("resembled"),
            data["coverage"],
            data["health"]["ess"],
            data["health"]["relocation_p"],
            data["map_version"],
            data["digest"],
            None if geo is None else (geo["lat"], geo["lon"]),
        )


@dataclass(frozen=True, slots=True)
class SessionInfo:
    """An open session."""

    id: str
    site: str
    map_version: str
    seed: int
    sensor: str
    hops: tuple[int, ...]
    expected: str | None
    r_geo_m: tuple[float, ...] | None
    correlation_m: float
    pose: Pose

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the value of an answer."""
        return cls(
            data["session"],
            data["site"],
            data["map_version"],
            data["seed"],
            data["sensor"],
            tuple(data["hops"]),
            data["expected"],
            None if data["r_geo_m"] is None else tuple(data["r_geo_m"]),
            data["correlation_m"],
            Pose.from_json(data["pose"]),
        )
