"""The true world: buildings, transmitters and radio. Pure; the estimator never sees it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import Transformer
from shapely.geometry import MultiPolygon, Polygon, box, mapping, shape
from shapely.geometry.base import BaseGeometry

from homsense_fleet.city import City
from homsense_fleet.styles import STYLES, scaled

Rng = np.random.Generator
FloatArray = NDArray[np.float64]

CLEARANCE_M = 2.0
AROUND_M = 50.0


@dataclass(frozen=True, slots=True)
class Radio:
    """How transmitters are heard.

    Parameters
    ----------
    s_max_m : float
        No transmitter is heard from farther away, metres.
    dropout : float
        Probability that a transmitter in view is missed in a scan.
    tx_dbm : float
        Strength at one metre, dBm.
    exponent : float
        Path loss exponent.
    shadowing_db : float
        Standard deviation of the strength, dB.
    """

    s_max_m: float = 72.0
    dropout: float = 0.05
    tx_dbm: float = -35.0
    exponent: float = 2.7
    shadowing_db: float = 3.0


@dataclass(frozen=True, slots=True)
class World:
    """Everything that is true.

    Parameters
    ----------
    name : str
        The scenario.
    city : City
        Buildings and roads.
    transmitters : ndarray, shape (T, 2), float64
        Places, metres.
    ids : tuple of str
        Broadcast identifiers.
    radio : Radio
        The radio model.
    walls : shapely.MultiPolygon
        All buildings, prepared for intersection tests.
    barriers : shapely.Polygon or shapely.MultiPolygon
        What nobody enters: the walls, and in a mapped world what lies beyond its domain.
    origin : tuple of float, optional
        (latitude, longitude) of the frame, degrees.
    """

    name: str
    city: City
    transmitters: FloatArray
    ids: tuple[str, ...]
    radio: Radio
    walls: MultiPolygon
    barriers: BaseGeometry
    origin: tuple[float, float] | None = None

    def map_document(self) -> dict[str, Any]:
        """Return the unlabeled map as GeoJSON in local metres."""
        areas: list[tuple[dict[str, str], BaseGeometry]]
        areas = [({}, building) for building in self.city.buildings]
        if self.city.district is not None:
            areas.append(({"role": "domain"}, self.city.district))
        return {
            "type": "FeatureCollection",
            "frame": "local",
            "features": [
                {"type": "Feature", "properties": properties, "geometry": mapping(area)}
                for properties, area in areas
            ],
        }

    def places(self) -> dict[str, tuple[float, float]]:
        """Return where each transmitter is, by identifier."""
        return {
            i: (float(x), float(y)) for i, (x, y) in zip(self.ids, self.transmitters, strict=True)
        }

    def is_free(self, xy: FloatArray) -> bool:
        """Tell whether somebody can be at a place, with some clearance."""
        return bool(shapely.distance(self.barriers, shapely.points(xy)) > CLEARANCE_M)

    def in_view(self, xy: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """Return the transmitters with a free line of sight within range, and their distances."""
        distance = np.hypot(*(self.transmitters - xy).T)
        near = np.flatnonzero(distance <= self.radio.s_max_m)
        ends = np.stack([np.broadcast_to(xy, (len(near), 2)), self.transmitters[near]], axis=1)
        clear = near[~shapely.intersects(self.walls, shapely.linestrings(ends))]
        return clear, distance[clear]

    def scan(self, xy: FloatArray, rng: Rng) -> list[dict[str, Any]]:
        """Return what a device hears at a place: identifiers with strengths in dBm."""
        seen, distance = self.in_view(xy)
        heard = rng.random(len(seen)) >= self.radio.dropout
        noise = rng.normal(0.0, self.radio.shadowing_db, len(seen))
        loss = 10.0 * self.radio.exponent * np.log10(np.maximum(distance, 1.0))
        rssi = self.radio.tx_dbm - loss + noise
        return [
            {"id": self.ids[i], "rssi": round(float(level), 1)}
            for i, level in zip(seen[heard], rssi[heard], strict=True)
        ]


def downtown_44(seed: int, *, n_transmitters: int = 197, radio: Radio | None = None) -> World:
    """Return the paper's setting: 44 buildings and 197 transmitters in a downtown.

    Parameters
    ----------
    seed : int
        Decides the whole world.
    n_transmitters : int, default 197
        How many transmitters there are.
    radio : Radio, optional
        The radio model.

    Returns
    -------
    World
        A world of 44 buildings.
    """
    return city_world("downtown-44", seed, n_transmitters=n_transmitters, radio=radio)


def city_world(
    style: str,
    seed: int,
    *,
    n_transmitters: int = 197,
    radio: Radio | None = None,
    scale: float = 1.0,
) -> World:
    """Return a generated city with its transmitters.

    Parameters
    ----------
    style : str
        One of `homsense_fleet.styles.STYLES`.
    seed : int
        Decides the whole world.
    n_transmitters : int, default 197
        How many transmitters there are.
    radio : Radio, optional
        The radio model.
    scale : float, default 1.0
        Size of buildings and streets, to the usual one.

    Returns
    -------
    World
        A world of 44 buildings.
    """
    rng = np.random.default_rng([seed, 44])
    city = scaled(STYLES[style](rng), scale)
    return _populate(style, city, rng, n_transmitters, radio or Radio())


def world_from_geojson(
    document: dict[str, Any],
    seed: int,
    *,
    n_transmitters: int = 197,
    radio: Radio | None = None,
    name: str = "map",
) -> World:
    """Return a world with the buildings of a GeoJSON map.

    Parameters
    ----------
    document : dict
        Polygons, alone or as features of a collection; metres when it says ``"frame": "local"``,
        else degrees. Where features have the role ``domain``, nobody leaves these.
    seed : int
        Decides the transmitters.
    n_transmitters : int, default 197
        How many transmitters there are.
    radio : Radio, optional
        The radio model.
    name : str, default "map"
        Name of the scenario.

    Returns
    -------
    World
        A world whose roads are a lattice over the largest connected free space.

    Raises
    ------
    ValueError
        If the map holds no building or no free space.
    """
    features = list(_features(document))
    areas = [area for _, area in features]
    origin = None
    if areas and document.get("frame") != "local":
        west, south, east, north = shapely.total_bounds(areas)
        origin = (float(south + north) / 2, float(west + east) / 2)
        areas = _to_metres(areas, origin)
    by_role: dict[str, list[BaseGeometry]] = {"structure": [], "domain": []}
    for (role, _), area in zip(features, areas, strict=True):
        by_role[role].append(area)
    merged = shapely.union_all(shapely.buffer(by_role["structure"], 0.05))
    outlines = [Polygon(part.exterior) for part in shapely.get_parts(merged)]
    buildings = tuple(shapely.get_parts(shapely.union_all(outlines)))
    if not buildings:
        message = "the map holds no building"
        raise ValueError(message)
    domain = shapely.union_all(by_role["domain"]) if by_role["domain"] else None
    barriers = shapely.union_all([*buildings, *_beyond(domain)])
    roads = _lattice(barriers, MultiPolygon(buildings) if domain is None else domain)
    city = City(buildings, roads, domain, is_open=True)
    rng = np.random.default_rng([seed, 45])
    world = _populate(name, city, rng, n_transmitters, radio or Radio())
    return replace(world, barriers=barriers, origin=origin)


def _features(node: dict[str, Any]) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the areas of a document, each with its role."""
    if node["type"] == "FeatureCollection":
        for feature in node["features"]:
            yield from _features(feature)
    elif node["type"] == "Feature":
        properties = node.get("properties") or {}
        yield properties.get("role", "structure"), shape(node["geometry"])
    else:
        yield "structure", shape(node)


def _beyond(domain: BaseGeometry | None) -> list[BaseGeometry]:
    """Return what surrounds a domain, if there is one."""
    if domain is None:
        return []
    around = box(*domain.bounds).buffer(AROUND_M, join_style="mitre")
    return [around.difference(domain)]


def _to_metres(areas: list[Any], origin: tuple[float, float]) -> list[Any]:
    latitude, longitude = origin
    local = f"+proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +datum=WGS84 +units=m"
    forward = Transformer.from_crs("EPSG:4326", local, always_xy=True)
    return [
        shapely.transform(area, lambda xy: np.stack(forward.transform(*xy.T), axis=1))
        for area in areas
    ]


def _populate(name: str, city: City, rng: Rng, count: int, radio: Radio) -> World:
    walls = MultiPolygon(list(city.buildings))
    shapely.prepare(walls)
    district = city.district or box(*walls.bounds).buffer(10.0, join_style="mitre")
    shapely.prepare(district)
    places = _well_spread(rng, district, walls, count)
    ids = tuple(_bssid(rng) for _ in range(count))
    return World(name, city, places, ids, radio, walls, walls)


def _well_spread(
    rng: Rng, district: BaseGeometry, walls: MultiPolygon, count: int, candidates: int = 40
) -> FloatArray:
    """Place transmitters outside the walls, each the candidate farthest from those before it."""
    west, south, east, north = district.bounds
    chosen = np.empty((0, 2))
    while len(chosen) < count:
        tried = rng.uniform((west, south), (east, north), size=(candidates, 2))
        inside = shapely.intersects_xy(district, tried[:, 0], tried[:, 1])
        tried = tried[inside & ~shapely.intersects_xy(walls, tried[:, 0], tried[:, 1])]
        if len(tried) and len(chosen):
            gaps = np.linalg.norm(tried[:, None] - chosen[None], axis=2).min(axis=1)
            tried = tried[[int(gaps.argmax())]]
        chosen = np.vstack([chosen, tried[:1]])
    return chosen


def _bssid(rng: Rng) -> str:
    octets = rng.integers(0, 256, size=6)
    octets[0] &= 0xFC
    return ":".join(f"{octet:02x}" for octet in octets)


def _lattice(barriers: BaseGeometry, about: BaseGeometry, spacing_m: float = 8.0) -> Any:  # noqa: ANN401
    """Return the largest connected lattice graph that keeps clear of some barriers."""
    west, south, east, north = about.bounds
    xs = np.arange(west - spacing_m, east + 1.5 * spacing_m, spacing_m)
    ys = np.arange(south - spacing_m, north + 1.5 * spacing_m, spacing_m)
    blocked = barriers.buffer(CLEARANCE_M)
    shapely.prepare(blocked)
    grid = nx.grid_2d_graph(len(xs), len(ys))
    edges = np.array(list(grid.edges))
    ends = np.stack([xs[edges[..., 0]], ys[edges[..., 1]]], axis=-1)
    free = ~shapely.intersects(blocked, shapely.linestrings(ends))
    roads: nx.Graph[tuple[float, float]] = nx.Graph()
    for (x0, y0), (x1, y1) in ends[free].tolist():
        roads.add_edge((x0, y0), (x1, y1), length_m=spacing_m)
    if not roads:
        message = "the map leaves no free space to move in"
        raise ValueError(message)
    return roads.subgraph(max(nx.connected_components(roads), key=len)).copy()
