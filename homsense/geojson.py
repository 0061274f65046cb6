"""From a GeoJSON document to polygons, with errors that name the offending member."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from shapely.geometry import MultiPolygon, Polygon
from shapely.validation import explain_validity

from homsense.errors import InvalidMapError
from homsense.pose import FARTHEST_M

ROLE_DOMAIN = "domain"
ROLE_STRUCTURE = "structure"

_RING = 4
_FINITE = f"finite numbers of at most {FARTHEST_M:g}"
_MAX_DEPTH = 8


@dataclass(frozen=True, slots=True)
class Feature:
    """A polygon of the map.

    Parameters
    ----------
    geometry : shapely.Polygon or shapely.MultiPolygon
        The area, in the units of the document.
    role : str
        ``"structure"`` or ``"domain"``.
    where : str
        Dotted path of the geometry in the document.
    """

    geometry: Polygon | MultiPolygon
    role: str
    where: str


def read_features(document: Mapping[str, Any]) -> list[Feature]:
    """Return the polygons of a document.

    Parameters
    ----------
    document : mapping
        FeatureCollection, Feature, GeometryCollection, Polygon or MultiPolygon.

    Returns
    -------
    list of Feature
        At least one.

    Raises
    ------
    InvalidMapError
        If the document is not such a thing, a number is not finite or beyond `FARTHEST_M`, or a
        polygon is not valid.
    """
    features = list(_walk(document, "", ROLE_STRUCTURE, 0))
    if not features:
        message = "the map holds no polygon"
        raise InvalidMapError(message, "features")
    return features


def _walk(node: object, where: str, role: str, depth: int) -> Iterator[Feature]:
    if not isinstance(node, Mapping) or depth > _MAX_DEPTH:
        raise _malformed("a GeoJSON object", where)
    kind = node.get("type")
    if kind == "FeatureCollection":
        for index, feature in enumerate(_list(node, "features", where)):
            yield from _walk(feature, _at(where, "features", index), role, depth + 1)
    elif kind == "GeometryCollection":
        for index, geometry in enumerate(_list(node, "geometries", where)):
            yield from _walk(geometry, _at(where, "geometries", index), role, depth + 1)
    elif kind == "Feature":
        properties = node.get("properties") or {}
        if not isinstance(properties, Mapping):
            raise _malformed("an object", _at(where, "properties"))
        role = properties.get("role", ROLE_STRUCTURE)
        if role not in (ROLE_STRUCTURE, ROLE_DOMAIN):
            raise _malformed('"structure" or "domain"', _at(where, "properties", "role"))
        yield from _walk(node.get("geometry"), _at(where, "geometry"), role, depth + 1)
    elif kind in ("Polygon", "MultiPolygon"):
        yield Feature(_area(node, kind, where), role, where or "geometry")
    else:
        raise _malformed("a FeatureCollection of polygons", _at(where, "type"))


def _area(node: Mapping[str, Any], kind: str, where: str) -> Polygon | MultiPolygon:
    rings = _list(node, "coordinates", where)
    path = _at(where, "coordinates")
    if kind == "Polygon":
        geometry: Polygon | MultiPolygon = _polygon(rings, path)
    else:
        geometry = MultiPolygon(
            [_polygon(part, _at(path, index)) for index, part in enumerate(rings)]
        )
    if not geometry.is_valid:
        message = f"{path} is not a valid polygon: {explain_validity(geometry)}"
        raise InvalidMapError(message, path)
    if geometry.area <= 0.0:
        raise _malformed("a polygon with an area", path)
    return geometry


def _polygon(rings: object, path: str) -> Polygon:
    if not isinstance(rings, Sequence) or isinstance(rings, str) or not rings:
        raise _malformed("a list of rings", path)
    outlines = [_ring(ring, _at(path, index)) for index, ring in enumerate(rings)]
    return Polygon(outlines[0], outlines[1:])


def _ring(ring: object, path: str) -> "np.typing.NDArray[np.float64]":
    try:
        places = np.asarray([position[:2] for position in ring], dtype=np.float64)  # type: ignore[attr-defined]
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        raise _malformed("a list of [x, y] positions", path) from None
    if places.ndim != 2 or places.shape[1] != 2 or len(places) < _RING:  # noqa: PLR2004 - (N, 2)
        raise _malformed("a ring of at least four [x, y] positions", path)
    if not (np.abs(places) <= FARTHEST_M).all():
        raise _malformed(_FINITE, path)
    return places


def _list(node: Mapping[str, Any], member: str, where: str) -> Sequence[Any]:
    found = node.get(member)
    if not isinstance(found, Sequence) or isinstance(found, str):
        raise _malformed("a list", _at(where, member))
    return found


def _at(where: str, *parts: object) -> str:
    return ".".join([*([where] if where else []), *map(str, parts)])


def _malformed(expected: str, where: str) -> InvalidMapError:
    return InvalidMapError(f"expected {expected} at {where or 'the top'}", where or None)
