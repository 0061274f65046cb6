"""Routes through a world: along streets, or on errands through open space. Pure."""

import math

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString

from homsense_fleet.world import CLEARANCE_M, World

Rng = np.random.Generator
FloatArray = NDArray[np.float64]
Place = tuple[float, float]


def wander(world: World, rng: Rng, length_m: float) -> FloatArray:
    """Return the corners of a random route on the roads.

    Parameters
    ----------
    world : World
        Gives the roads.
    rng : numpy.random.Generator
        Chooses the turns.
    length_m : float
        Least length, metres.

    Returns
    -------
    ndarray, shape (K, 2), float64
        Corners; on streets the route turns back only where one ends, in the open it leads from
        one random destination to the next.
    """
    if world.city.is_open:
        return _errands(world, rng, length_m)
    nodes = sorted(world.city.roads.nodes)
    here: Place = nodes[int(rng.integers(len(nodes)))]
    before: Place | None = None
    corners = [here]
    travelled = 0.0
    while travelled < length_m:
        ahead = _next_corner(world, rng, before, here)
        travelled += math.dist(here, ahead)
        corners.append(ahead)
        before, here = here, ahead
    return np.array(corners)


def _errands(world: World, rng: Rng, length_m: float) -> FloatArray:
    nodes = sorted(world.city.roads.nodes)
    stops = [nodes[int(rng.integers(len(nodes)))]]
    corners: list[Place] = stops[:]
    travelled = 0.0
    while travelled < length_m:
        stops.append(nodes[int(rng.integers(len(nodes)))])
        way = nx.shortest_path(world.city.roads, stops[-2], stops[-1], weight="length_m")
        for ahead in _straightened(world, way)[1:]:
            travelled += math.dist(corners[-1], ahead)
            corners.append(ahead)
    return np.array(corners)


def _straightened(world: World, way: list[Place]) -> list[Place]:
    """Return the corners that are left when a way is pulled tight around the buildings."""
    corners, at = [way[0]], 0
    while at < len(way) - 1:
        reach = 1
        while at + reach < len(way) and _is_clear(world, way[at], way[at + reach]):
            reach *= 2
        ahead = min(at + reach, len(way) - 1)
        while ahead > at + 1 and not _is_clear(world, way[at], way[ahead]):
            ahead -= 1
        corners.append(way[ahead])
        at = ahead
    return corners


def _is_clear(world: World, here: Place, there: Place) -> bool:
    return bool(shapely.distance(world.barriers, LineString([here, there])) > CLEARANCE_M)


def _next_corner(world: World, rng: Rng, before: Place | None, here: Place) -> Place:
    ways = sorted(place for place in world.city.roads[here] if place != before)
    if not ways:
        return before or here
    if before is not None:
        straight = (2 * here[0] - before[0], 2 * here[1] - before[1])
        along = [way for way in ways if math.dist(way, straight) < 0.5 * math.dist(here, before)]
        if along and rng.random() < 0.6:  # noqa: PLR2004 - drivers mostly go on
            return along[0]
    return ways[int(rng.integers(len(ways)))]


def walk_positions(corners: FloatArray, spacing_m: float, length_m: float) -> FloatArray:
    """Return places along a route at equal distances.

    Parameters
    ----------
    corners : ndarray, shape (K, 2), float64
        The route.
    spacing_m : float
        Distance between places, metres.
    length_m : float
        Where to stop, metres from the start.

    Returns
    -------
    ndarray, shape (S, 2), float64
        Places, the start first.
    """
    legs = np.hypot(*np.diff(corners, axis=0).T)
    at = np.concatenate([[0.0], np.cumsum(legs)])
    distance = np.arange(0.0, min(length_m, at[-1]) + 1e-9, spacing_m)
    return np.stack([np.interp(distance, at, corners[:, axis]) for axis in (0, 1)], axis=1)
