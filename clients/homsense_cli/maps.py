"""Map files -> GeoJSON: GeoJSON itself, or footprints of a city, gzipped or not."""

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np

from homsense import InvalidMapError
from homsense.geojson import read_features

_GZIP = b"\x1f\x8b"


def read_map(path: Path, window_m: float | None = None) -> dict[str, Any]:
    """Return a map as GeoJSON.

    Parameters
    ----------
    path : pathlib.Path
        GeoJSON, or ``{"buildings": [{"poly": [{"ext", "holes"}]}]}`` in metres.
    window_m : float, optional
        For footprints: keep the square of this side, metres, that holds the most.

    Returns
    -------
    dict
        GeoJSON.

    Raises
    ------
    ValueError
        If the file holds neither.
    """
    document = read_json(path)
    if not isinstance(document, dict) or "buildings" not in document:
        try:
            read_features(document)
        except InvalidMapError as error:
            message = f"{path} is not a map: {error}"
            raise ValueError(message) from error
        return dict(document)
    polygons = [polygon for entry in document["buildings"] for polygon in entry["poly"]]
    if window_m is not None:
        polygons = _busiest_window(polygons, window_m)
    return collection([feature(polygon) for polygon in polygons])


def read_json(path: Path) -> Any:  # noqa: ANN401 - parsed JSON
    """Return the content of a JSON file, gzipped or not; raise ValueError when it is none."""
    raw = path.read_bytes()
    try:
        return json.loads(gzip.decompress(raw) if raw.startswith(_GZIP) else raw)
    except ValueError as error:
        message = f"{path} is not JSON: {error}"
        raise ValueError(message) from error


def collection(features: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a FeatureCollection in local metres."""
    return {"type": "FeatureCollection", "frame": "local", "features": features}


def feature(polygon: dict[str, Any], **properties: str) -> dict[str, Any]:
    """Return the Feature of a polygon that is given as ``ext`` and ``holes``."""
    rings = [polygon["ext"], *polygon["holes"]]
    closed = [ring if ring[0] == ring[-1] else [*ring, ring[0]] for ring in rings]
    geometry = {"type": "Polygon", "coordinates": closed}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _busiest_window(polygons: list[dict[str, Any]], window_m: float) -> list[dict[str, Any]]:
    centers = np.array([np.mean(polygon["ext"], axis=0) for polygon in polygons])
    west, south = (np.sort(centers[:, axis]) for axis in (0, 1))
    corners = np.stack(np.meshgrid(west[::4], south[::4]), axis=-1).reshape(-1, 2)
    apart = centers[None, :, :] - corners[:, None, :]
    inside = ((apart >= 0.0) & (apart <= window_m)).all(axis=2)
    kept = inside[int(inside.sum(axis=1).argmax())]
    return [polygon for polygon, keep in zip(polygons, kept, strict=True) if keep]
