"""Generated downtowns: irregular blocks, streets between them, and roads to drive on. Pure."""

from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely
from shapely import affinity
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

Rng = np.random.Generator

STREET_M = 12.0


@dataclass(frozen=True, slots=True)
class City:
    """Buildings and the road graph between them, metres.

    Parameters
    ----------
    buildings : tuple of shapely.Polygon
        Footprints, disjoint.
    roads : networkx.Graph
        Nodes are (x, y) places; edges are straight and free of buildings.
    district : shapely.Polygon or shapely.MultiPolygon, optional
        Where anybody can be at all, buildings not yet taken out; anywhere when absent.
    is_open : bool, default False
        Whether one walks straight to destinations; else along the streets.
    """

    buildings: tuple[Polygon, ...]
    roads: "nx.Graph[tuple[float, float]]"
    district: BaseGeometry | None = None
    is_open: bool = False


def downtown(
    rng: Rng,
    *,
    columns: int = 9,
    rows: int = 7,
    cut: int = 4,
    plazas: int = 9,
    pitch_m: float = 90.0,
) -> City:
    """Build a downtown of ``columns * rows - cut * (cut + 1) / 2 - plazas`` buildings.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all irregularity.
    columns, rows : int
        Blocks to the east and to the north.
    cut : int, default 4
        Blocks that are missing along each side of one corner, as beside a river.
    plazas : int, default 9
        Blocks left open, anywhere.
    pitch_m : float, default 90.0
        Mean distance between street axes, metres.

    Returns
    -------
    City
        Buildings and roads.
    """
    x_axes = _street_axes(rng, columns, pitch_m)
    y_axes = _street_axes(rng, rows, pitch_m)
    flip_x, flip_y = rng.integers(2, size=2)
    lots = [
        (abs(flip_x * (columns - 1) - i), abs(flip_y * (rows - 1) - j))
        for i in range(columns)
        for j in range(rows)
        if i + j >= cut
    ]
    plaza = set(rng.choice(len(lots), plazas, replace=False).tolist())
    buildings = tuple(
        _footprint(rng, box(x_axes[i], y_axes[j], x_axes[i + 1], y_axes[j + 1]))
        for number, (i, j) in enumerate(lots)
        if number not in plaza
    )
    district = shapely.union_all(
        [box(x_axes[i], y_axes[j], x_axes[i + 1], y_axes[j + 1]) for i, j in lots]
    ).buffer(STREET_M, join_style="mitre")
    return City(buildings, _road_graph(x_axes, y_axes, lots), district)


def _street_axes(rng: Rng, blocks: int, pitch_m: float) -> list[float]:
    widths = pitch_m * rng.uniform(0.85, 1.15, size=blocks)
    return [float(x) for x in np.concatenate([[0.0], np.cumsum(widths)])]


def _road_graph(
    x_axes: list[float], y_axes: list[float], lots: list[tuple[int, int]]
) -> "nx.Graph[tuple[float, float]]":
    """Return the streets around the lots."""
    roads: nx.Graph[tuple[float, float]] = nx.Graph()
    for i, j in lots:
        west, east, south, north = x_axes[i], x_axes[i + 1], y_axes[j], y_axes[j + 1]
        corners = [(west, south), (east, south), (east, north), (west, north), (west, south)]
        roads.add_edges_from(pairwise(corners))
    return roads


def _footprint(rng: Rng, block: Polygon) -> Polygon:
    """Return an irregular building that keeps clear of the axes of the streets around it."""
    west, south, east, north = block.bounds
    street = rng.uniform(10.0, 15.0, size=4)
    lot = box(west + street[0], south + street[1], east - street[2], north - street[3])
    shape = _SHAPES[int(rng.integers(len(_SHAPES)))](rng, lot)
    turned = affinity.rotate(shape, float(rng.uniform(-4.0, 4.0)))
    return max(
        (part for part in shapely.get_parts(turned) if isinstance(part, Polygon)),
        key=lambda part: part.area,
    )


def _notch(rng: Rng, lot: Polygon, depth: float, width: float) -> Polygon:
    """Cut a rectangle out of a random side of the lot."""
    west, south, east, north = lot.bounds
    w, h = (east - west) * width, (north - south) * depth
    x = float(rng.uniform(west, east - w))
    top = bool(rng.integers(2))
    return box(x, north - h, x + w, north + 1) if top else box(x, south - 1, x + w, south + h)


def _quadrilateral(rng: Rng, lot: Polygon) -> Polygon:
    corners = np.array(lot.exterior.coords[:-1])
    center = corners.mean(axis=0)
    inward = rng.uniform(0.0, 0.22, size=(4, 1))
    return Polygon(corners + inward * (center - corners))


def _l_shape(rng: Rng, lot: Polygon) -> BaseGeometry:
    west, south, east, north = lot.bounds
    w, h = (east - west) * rng.uniform(0.3, 0.5), (north - south) * rng.uniform(0.3, 0.5)
    corner = int(rng.integers(4))
    x = west - 1 if corner % 2 else east - w
    y = south - 1 if corner < 2 else north - h  # noqa: PLR2004 - the two southern corners
    return lot.difference(box(x, y, x + w + 1, y + h + 1))


def _u_shape(rng: Rng, lot: Polygon) -> BaseGeometry:
    west, south, east, north = lot.bounds
    third = (east - west) / 3
    depth = (north - south) * rng.uniform(0.3, 0.5)
    court = box(west + third, north - depth, east - third, north + 1)
    quarter_turns = int(rng.integers(4))
    return affinity.rotate(lot.difference(court), 180.0 * (quarter_turns % 2), origin="centroid")


def _notched(rng: Rng, lot: Polygon) -> BaseGeometry:
    shape = _quadrilateral(rng, lot)
    return shape.difference(_notch(rng, lot, 0.35, 0.3))


def _octagon(rng: Rng, lot: Polygon) -> Polygon:
    west, south, east, north = lot.bounds
    c = min(east - west, north - south) * rng.uniform(0.15, 0.3)
    return Polygon(
        [
            (west + c, south),
            (east - c, south),
            (east, south + c),
            (east, north - c),
            (east - c, north),
            (west + c, north),
            (west, north - c),
            (west, south + c),
        ]
    )


_SHAPES = (_quadrilateral, _l_shape, _u_shape, _notched, _octagon)
