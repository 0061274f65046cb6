"""Small maps and complexes with known answers."""

from typing import Any


def square(west: float, south: float, side: float) -> dict[str, Any]:
    """Return a square Polygon geometry."""
    east, north = west + side, south + side
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Polygon", "coordinates": [ring]}


def feature(geometry: dict[str, Any], **properties: str) -> dict[str, Any]:
    """Return a Feature."""
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def local_map(*features: dict[str, Any]) -> dict[str, Any]:
    """Return a FeatureCollection in metres."""
    return {"type": "FeatureCollection", "frame": "local", "features": list(features)}


SQUARE_MAP = local_map(feature(square(0, 0, 10)))
SITE_MAP = local_map(
    feature(square(0, 0, 20)), feature(square(40, 0, 20)), feature(square(0, 40, 20))
)

TORUS = [{i, (i + 1) % 7, (i + 3) % 7} for i in range(7)] + [
    {i, (i + 2) % 7, (i + 3) % 7} for i in range(7)
]
PROJECTIVE_PLANE = [
    {0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}, {0, 1, 5},
    {1, 2, 4}, {2, 3, 5}, {1, 3, 4}, {2, 4, 5}, {1, 3, 5},
]  # fmt: skip
ANNULUS = [{i, (i + 1) % 6, (i + 2) % 6} for i in range(6)]

GOLDEN: dict[str, tuple[list[set[Any]], tuple[int, ...]]] = {
    "point": ([{0}], (1, 0, 0)),
    "two points": ([{0}, {1}], (2, 0, 0)),
    "full triangle": ([{0, 1, 2}], (1, 0, 0)),
    "hollow triangle": ([{0, 1}, {1, 2}, {0, 2}], (1, 1, 0)),
    "hollow tetrahedron": ([{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}], (1, 0, 1)),
    "7-vertex torus": (TORUS, (1, 2, 1)),
    "6-vertex projective plane": (PROJECTIVE_PLANE, (1, 1, 1)),
    "annulus": (ANNULUS, (1, 1, 0)),
}


def named(simplices: list[set[Any]]) -> list[frozenset[str]]:
    """Return simplices with strings for vertices."""
    return [frozenset(map(str, simplex)) for simplex in simplices]
