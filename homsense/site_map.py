"""The unlabeled metric map (A1): structures, free space and a frame in metres."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import Transformer
from shapely.geometry import MultiPolygon, Polygon, box, mapping
from shapely.geometry.base import BaseGeometry

from homsense.errors import InvalidMapError
from homsense.geojson import ROLE_DOMAIN, Feature, read_features

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

TOUCHING_M = 0.1
MARGIN_M = 15.0
MAX_EXTENT_M = 100_000.0


@dataclass(frozen=True)
class SiteMap:
    """Structures that limit visibility, and the free space between them.

    Parameters
    ----------
    structures : tuple of shapely.Polygon
        Disjoint structures without interior rings, metres east and north; each is an expected
        hole.
    domain : shapely.MultiPolygon
        Where a device can be at all, structures not yet taken out.
    origin : tuple of float, optional
        (latitude, longitude) of the frame's origin in degrees, WGS84.
    courtyards : tuple of shapely.Polygon
        Open places that no device can reach; they belong to their structure.
    """

    structures: tuple[Polygon, ...]
    domain: MultiPolygon
    origin: tuple[float, float] | None = None
    courtyards: tuple[Polygon, ...] = field(default=(), repr=False)

    @classmethod
    def from_geojson(
        cls, document: Mapping[str, Any], *, origin: tuple[float, float] | None = None
    ) -> Self:
        """Return the map that a GeoJSON document describes.

        Every polygon is a structure, except those whose property ``role`` is ``"domain"``: their
        union is where devices can be. Without any, that is the bounding box with a margin.
        Structures closer than 0.1 m are merged. The member ``"frame": "local"`` means metres;
        otherwise positions are longitude and latitude (RFC 7946).

        Parameters
        ----------
        document : mapping
            FeatureCollection, Feature or geometry.
        origin : tuple of float, optional
            (latitude, longitude) in degrees where the frame begins; by default the middle of the
            polygons for a map in degrees, and none for a map in metres.

        Returns
        -------
        SiteMap
            The map.

        Raises
        ------
        InvalidMapError
            If the document is malformed, a polygon crosses itself, no structure is left or no
            free space is left.

        Examples
        --------
        >>> square = [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]
        >>> document = {"type": "Polygon", "coordinates": [square], "frame": "local"}
        >>> SiteMap.from_geojson(document).bounds
        (-15.0, -15.0, 25.0, 25.0)
        """
        local = _is_local(document)
        features = read_features(document)
        if not local:
            origin = origin or _middle(features)
            features = _to_metres(features, origin)
        structures, courtyards = _merge(
            feature.geometry for feature in features if feature.role != ROLE_DOMAIN
        )
        if not structures:
            message = "the map holds no structure"
            raise InvalidMapError(message, "features")
        areas = [feature.geometry for feature in features if feature.role == ROLE_DOMAIN]
        site_map = cls(structures, _domain(areas, structures), origin, courtyards)
        if site_map.free_space.area <= 0.0:
            message = "the structures leave no free space"
            raise InvalidMapError(message, "features")
        return site_map

    @cached_property
    def free_space(self) -> BaseGeometry:
        """The domain without the structures."""
        return shapely.difference(self.domain, MultiPolygon(self.structures))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north end of the domain, metres."""
        west, south, east, north = self.domain.bounds
        return west, south, east, north

    def is_free(self, xy: FloatArray) -> BoolArray:
        """Tell which places lie in free space.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            True where a device can be.
        """
        places = np.asarray(xy, dtype=np.float64)
        own = shapely.from_wkb(shapely.to_wkb(self.free_space))  # threads must not share an index
        shapely.prepare(own)
        return np.asarray(shapely.contains_xy(own, places[:, 0], places[:, 1]))

    def surface_mesh(self, spacing_m: float = 5.0) -> list[FloatArray]:
        """Return points along the faces of each structure (paper, section V-B.3).

        Parameters
        ----------
        spacing_m : float, default 5.0
            Greatest distance between neighbors, metres.

        Returns
        -------
        list of ndarray, shape (M, 2), float64
            One mesh for each structure; corners are always part of it.
        """
        dense = shapely.segmentize(np.array(self.structures, dtype=object), spacing_m)
        return [shapely.get_coordinates(polygon)[:-1] for polygon in dense]

    def digest(self) -> str:
        """Return the content hash that names this version of the map.

        Returns
        -------
        str
            SHA-256 of structures, domain and origin to the millimetre, hexadecimal.
        """
        content = [
            _rounded(MultiPolygon(self.structures)),
            _rounded(self.domain),
            self.origin and [round(degrees, 9) for degrees in self.origin],
        ]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def to_wgs84(self, xy: FloatArray) -> FloatArray:
        """Return the longitude and latitude of places.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N, 2), float64
            Degrees.

        Raises
        ------
        InvalidMapError
            If the map has no origin.
        """
        if self.origin is None:
            message = "the map has no georeference"
            raise InvalidMapError(message, "origin")
        return _projection(self.origin, inverse=True)(np.asarray(xy, dtype=np.float64))


def _is_local(document: Mapping[str, Any]) -> bool:
    if not hasattr(document, "get"):
        message = "the map is not a GeoJSON object"
        raise InvalidMapError(message)
    frame = document.get("frame", "wgs84")
    if frame not in ("local", "wgs84"):
        message = f'frame is "local" (metres) or "wgs84" (degrees), not {frame!r}'
        raise InvalidMapError(message, "frame")
    return bool(frame == "local")


def _middle(features: list[Feature]) -> tuple[float, float]:
    west, south, east, north = shapely.total_bounds([f.geometry for f in features])
    return float(south + north) / 2, float(west + east) / 2


def _projection(
    origin: tuple[float, float], *, inverse: bool = False
) -> Callable[[FloatArray], FloatArray]:
    """Return the map from degrees to local metres, or back, on arrays of shape (N, 2)."""
    latitude, longitude = origin
    local = f"+proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +datum=WGS84 +units=m"
    ends = (local, "EPSG:4326") if inverse else ("EPSG:4326", local)
    transformer = Transformer.from_crs(*ends, always_xy=True)
    return lambda xy: np.stack(transformer.transform(xy[:, 0], xy[:, 1]), axis=1)


def _to_metres(features: list[Feature], origin: tuple[float, float]) -> list[Feature]:
    for feature in features:
        west, south, east, north = feature.geometry.bounds
        if west < -180 or east > 180 or south < -90 or north > 90:  # noqa: PLR2004 - degrees
            message = (
                f"{feature.where} is not in degrees; a map in metres says "
                '"frame": "local" beside its type'
            )
            raise InvalidMapError(message, feature.where)
    forward = _projection(origin)
    return [
        Feature(
            shapely.transform(feature.geometry, forward),
            feature.role,
            feature.where,
        )
        for feature in features
    ]


def _merge(
    geometries: Iterable[BaseGeometry],
) -> tuple[tuple[Polygon, ...], tuple[Polygon, ...]]:
    """Merge touching polygons; return filled structures and their courtyards, in a fixed order."""
    half = TOUCHING_M / 2
    grown = shapely.buffer(list(geometries), half, join_style="mitre")
    merged = shapely.buffer(shapely.union_all(grown), -half, join_style="mitre")
    parts = [part for part in shapely.get_parts(merged) if part.area > 0.0]
    filled = shapely.get_parts(shapely.union_all([Polygon(part.exterior) for part in parts]))
    courtyards = [Polygon(ring) for part in parts for ring in part.interiors]
    key = shapely.get_coordinates
    return (
        tuple(sorted(filled, key=lambda polygon: key(polygon)[0].tolist())),
        tuple(sorted(courtyards, key=lambda polygon: key(polygon)[0].tolist())),
    )


def _domain(areas: Sequence[BaseGeometry], structures: tuple[Polygon, ...]) -> MultiPolygon:
    west, south, east, north = shapely.total_bounds([*areas, *structures])
    if max(east - west, north - south) > MAX_EXTENT_M:
        message = f"the map spans more than {MAX_EXTENT_M / 1000:.0f} km"
        raise InvalidMapError(message, "features")
    if not areas:
        return MultiPolygon(
            [box(west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M)]
        )
    union = shapely.union_all(areas)
    return MultiPolygon([part for part in shapely.get_parts(union) if isinstance(part, Polygon)])


def _rounded(geometry: BaseGeometry) -> Any:  # noqa: ANN401 - GeoJSON
    return mapping(shapely.set_precision(shapely.normalize(geometry), 0.001))
