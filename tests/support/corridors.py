"""A small building whose corridors a crowd has walked: ground truth for the registered complex."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import mapping

from homsense import FreeSpace, Reading, SiteMap, WalkScan

FloatArray = NDArray[np.float64]
Corridors = tuple[tuple[tuple[float, float], tuple[float, float]], ...]

CORRIDORS = (
    ((5.0, 5.0), (115.0, 5.0)),
    ((5.0, 5.0), (5.0, 75.0)),
    ((5.0, 75.0), (75.0, 75.0)),
    ((75.0, 75.0), (75.0, 5.0)),
    ((5.0, 40.0), (75.0, 40.0)),
    ((115.0, 5.0), (115.0, 45.0)),
)
TURNED_ALIKE = (
    ((5.0, 5.0), (60.0, 5.0)),
    ((60.0, 5.0), (60.0, 75.0)),
    ((60.0, 75.0), (115.0, 75.0)),
)
"""Half a turn about (60, 40) leaves them as they are."""

WIDTH_M = 4.0
PACE_M = 2.5


def mirrored(free_space: FreeSpace) -> FreeSpace:
    """Return the mirror image, on the same raster."""
    free = free_space.free[:-1].reshape(free_space.grid.shape)
    return FreeSpace(free_space.grid, np.append(free[:, ::-1], False))


def building(corridors: Corridors = CORRIDORS) -> SiteMap:
    """Return the map: solid but for the corridors."""
    half = WIDTH_M / 2.0
    boxes = [
        (min(a, c) - half, min(b, d) - half, max(a, c) + half, max(b, d) + half)
        for (a, b), (c, d) in corridors
    ]
    features = [_feature(box, "domain") for box in boxes]
    features.append(_feature((20.0, 15.0, 50.0, 30.0), None))
    return SiteMap.from_geojson(
        {"type": "FeatureCollection", "frame": "local", "features": features}
    )


def _feature(box: tuple[float, ...], role: str | None) -> dict[str, object]:
    west, south, east, north = box
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    properties = {} if role is None else {"role": role}
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


@dataclass(frozen=True)
class Building:
    """The map, its transmitters, and who walks there."""

    site_map: SiteMap
    free_space: FreeSpace
    transmitters: FloatArray
    corridors: Corridors = CORRIDORS

    @classmethod
    def of(cls, seed: int, count: int = 70, corridors: Corridors = CORRIDORS) -> "Building":
        """Return a building with transmitters at random places."""
        site_map = building(corridors)
        rng = np.random.default_rng(seed)
        places = rng.uniform((-5.0, -5.0), (125.0, 85.0), (count, 2))
        return cls(site_map, FreeSpace.of(site_map, 1.0), places, corridors)

    def document(self) -> dict[str, Any]:
        """Return the map as it is posted."""
        features = [{"type": "Feature", "properties": {"role": "domain"},
            "geometry": mapping(self.site_map.domain)}]  # fmt: skip
        features += [
            {"type": "Feature", "properties": {}, "geometry": mapping(structure)}
            for structure in self.site_map.structures
        ]
        return {"type": "FeatureCollection", "frame": "local", "features": features}

    def readings(self, place: FloatArray, rng: np.random.Generator) -> tuple[Reading, ...]:
        """Return what is heard at a place."""
        apart = np.maximum(np.linalg.norm(self.transmitters - place, axis=1), 1.0)
        level = -38.0 - 26.0 * np.log10(apart) + rng.normal(0.0, 3.0, len(apart))
        return tuple(
            Reading(f"tx-{number:02d}", round(float(dbm)))
            for number, dbm in enumerate(level)
            if dbm >= -85.0
        )

    def walk(self, rng: np.random.Generator, length_m: float = 60.0) -> FloatArray:
        """Return true places along the corridors, a pace apart."""
        corridor = self.corridors[rng.integers(len(self.corridors))]
        here, there = np.array(corridor[rng.integers(2)]), np.array(corridor[0])
        if np.array_equal(here, there):
            there = np.array(corridor[1])
        places = [here]
        while len(places) * PACE_M < length_m:
            left = float(np.linalg.norm(there - here))
            if left < PACE_M:
                here = there
                ends = [c[::-1] if c[1] == tuple(here) else c for c in self.corridors]
                onward = [end for start, end in ends if start == tuple(here)]
                there = np.array(onward[rng.integers(len(onward))])
                continue
            here = here + (there - here) / left * PACE_M
            places.append(here)
        return np.array(places)

    def crowd(self, seed: int, walks: int = 60, turned_rad: float = 0.0) -> list[WalkScan]:
        """Return the scans of a crowd, whose headings are all turned by an angle."""
        return [scan for scan, _ in self.crowd_with_truth(seed, walks, turned_rad)]

    def crowd_with_truth(
        self, seed: int, walks: int = 60, turned_rad: float = 0.0
    ) -> Iterator[tuple[WalkScan, FloatArray]]:
        """Yield scans with the place where each was made."""
        rng = np.random.default_rng(seed)
        for number in range(walks):
            places = self.walk(rng)
            own = _dead_reckoned(places, turned_rad, rng)
            for moment, (place, reckoned) in enumerate(zip(places, own, strict=True)):
                readings = self.readings(place, rng)
                x, y = (float(axis) for axis in reckoned)
                yield WalkScan(f"walk-{number:03d}", 2.0 * moment, x, y, readings), place


def heard(readings: tuple[Reading, ...]) -> list[dict[str, Any]]:
    """Return readings as they are posted."""
    return [{"id": reading.landmark, "rssi": reading.rssi_dbm} for reading in readings]


def posted(scan: WalkScan) -> dict[str, Any]:
    """Return a scan of a walk as it is posted."""
    return {
        "device": scan.walk,
        "scan_id": str(scan.t_s),
        "observed_at": scan.t_s,
        "landmarks": heard(scan.readings),
        "track": {"id": "1", "x_m": scan.x_m, "y_m": scan.y_m},
    }


def _dead_reckoned(places: FloatArray, turned_rad: float, rng: np.random.Generator) -> FloatArray:
    moves = np.diff(places, axis=0) * rng.normal(1.0, 0.05)
    turn = turned_rad + rng.normal(0.0, 0.05) + rng.normal(0.0, 0.05, len(moves))
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.stack(
        [cos * moves[:, 0] - sin * moves[:, 1], sin * moves[:, 0] + cos * moves[:, 1]], axis=1
    )
    return np.concatenate([np.zeros((1, 2)), np.cumsum(turned, axis=0)])
