"""Styles of generated cities: a downtown of blocks, a grown old town, a campus. Pure."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry import Point, Polygon, box

from homsense_fleet.city import STREET_M, City, downtown

Rng = np.random.Generator

_QUARTERS = 53
_OPEN = 9


def old_town(rng: Rng) -> City:
    """Build a round town of 44 irregular quarters with crooked lanes between them.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all irregularity.

    Returns
    -------
    City
        Lanes run along the edges of a relaxed Voronoi diagram.
    """
    town = Point(0.0, 0.0).buffer(330.0, quad_segs=16)
    seeds = _scattered(rng, town, _QUARTERS)
    cells: list[Polygon] = []
    for _ in range(3):
        drawn = shapely.voronoi_polygons(shapely.multipoints(seeds), extend_to=town)
        cells = [cell.intersection(town) for cell in shapely.get_parts(drawn)]
        seeds = np.array([cell.centroid.coords[0] for cell in cells])
    is_open = set(rng.choice(len(cells), _OPEN, replace=False).tolist())
    buildings = tuple(
        cell.buffer(-float(rng.uniform(5.0, 8.0)), join_style="mitre")
        for number, cell in enumerate(cells)
        if number not in is_open
    )
    return City(buildings, _along_edges(cells), town.buffer(STREET_M))


def campus(rng: Rng) -> City:
    """Build a campus of 44 turned buildings, each in much open space.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all irregularity.

    Returns
    -------
    City
        Ways run around the lots.
    """
    streets = downtown(rng, plazas=9)
    buildings = tuple(_turned(rng, building) for building in streets.buildings)
    return City(buildings, streets.roads, streets.district)


STYLES: dict[str, Callable[[Rng], City]] = {
    "downtown-44": downtown,
    "old-town": old_town,
    "campus": campus,
}


def scaled(city: City, scale: float) -> City:
    """Return a city with everything larger or smaller.

    Parameters
    ----------
    city : City
        The city.
    scale : float
        New size to old.

    Returns
    -------
    City
        Buildings and streets grow alike.
    """
    larger = partial(affinity.scale, xfact=scale, yfact=scale, origin=(0.0, 0.0))
    places = {place: (scale * place[0], scale * place[1]) for place in city.roads.nodes}
    district = None if city.district is None else larger(city.district)
    roads = nx.relabel_nodes(city.roads, places)
    return City(tuple(map(larger, city.buildings)), roads, district)


def _scattered(rng: Rng, area: Polygon, count: int) -> NDArray[np.float64]:
    west, south, east, north = area.bounds
    tried = rng.uniform((west, south), (east, north), size=(4 * count, 2))
    return tried[shapely.contains_xy(area, tried[:, 0], tried[:, 1])][:count]


def _along_edges(cells: list[Polygon]) -> "nx.Graph[tuple[float, float]]":
    roads: nx.Graph[tuple[float, float]] = nx.Graph()
    for cell in cells:
        corners = [(round(x, 3), round(y, 3)) for x, y in cell.exterior.coords]
        roads.add_edges_from(pairwise(corners))
    return roads


def _turned(rng: Rng, lot: Polygon) -> Polygon:
    """Return a slender building that fits into the lot of another."""
    west, south, east, north = lot.bounds
    side = min(east - west, north - south)
    long, short = side * rng.uniform(0.65, 0.95), side * rng.uniform(0.35, 0.6)
    x, y = lot.centroid.x, lot.centroid.y
    plain = box(x - long / 2, y - short / 2, x + long / 2, y + short / 2)
    turned = affinity.rotate(plain, float(rng.uniform(-45.0, 45.0)))
    return turned if box(*lot.bounds).contains(turned) else plain
