"""Generated downtowns: irregular blocks, streets between them, and roads to drive on. Pure."""

from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from shapely import affinity
from shapely.geometry import Polygon, box

Rng = np.random.Generator


@dataclass(frozen=True, slots=True)
class City:
    """Buildings and the road graph between them, metres.

    Parameters
    ----------
    buildings : tuple of shapely.Polygon
        Footprints, disjoint.
    roads : networkx.Graph
        Nodes are (x, y) places; edges are straight and free of buildings.
    """

    buildings: tuple[Polygon, ...]
    roads: "nx.Graph[tuple[float, float]]"


def downtown(rng: Rng, *, blocks: int = 7, plazas: int = 5, pitch_m: float = 105.0) -> City:
    """Build a downtown of ``blocks**2 - plazas`` buildings.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all irregularity.
    blocks : int, default 7
        Blocks along each side.
    plazas : int, default 5
        Blocks left open.
    pitch_m : float, default 105.0
        Mean distance between street axes, metres.

    Returns
    -------
    City
        Buildings and roads in a square of about ``blocks * pitch_m`` metres.
    """
    x_axes = _street_axes(rng, blocks, pitch_m)
    y_axes = _street_axes(rng, blocks, pitch_m)
    inner = [(i, j) for i in range(1, blocks - 1) for j in range(1, blocks - 1)]
    open_blocks = {inner[k] for k in rng.choice(len(inner), size=plazas, replace=False)}
    buildings = tuple(
        _footprint(rng, box(x_axes[i], y_axes[j], x_axes[i + 1], y_axes[j + 1]))
        for i in range(blocks)
        for j in range(blocks)
        if (i, j) not in open_blocks
    )
    return City(buildings, _road_graph(x_axes, y_axes))


def _street_axes(rng: Rng, blocks: int, pitch_m: float) -> list[float]:
    widths = pitch_m * rng.uniform(0.86, 1.14, size=blocks)
    return [float(x) for x in np.concatenate([[0.0], np.cumsum(widths)])]


def _road_graph(x_axes: list[float], y_axes: list[float]) -> "nx.Graph[tuple[float, float]]":
    roads: nx.Graph[tuple[float, float]] = nx.Graph()
    for x in x_axes:
        for y, y_next in pairwise(y_axes):
            roads.add_edge((x, y), (x, y_next), length_m=y_next - y)
    for y in y_axes:
        for x, x_next in pairwise(x_axes):
            roads.add_edge((x, y), (x_next, y), length_m=x_next - x)
    return roads


def _footprint(rng: Rng, block: Polygon) -> Polygon:
    """Return an irregular building that keeps clear of the axes of the streets around it."""
    west, south, east, north = block.bounds
    street = rng.uniform(9.0, 15.0, size=4)
    lot = box(west + street[0], south + street[1], east - street[2], north - street[3])
    shape = _SHAPES[int(rng.integers(len(_SHAPES)))](rng, lot)
    turned = affinity.rotate(shape, float(rng.uniform(-4.0, 4.0)))
    return Polygon(turned.exterior)


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


def _l_shape(rng: Rng, lot: Polygon) -> Polygon:
    west, south, east, north = lot.bounds
    w, h = (east - west) * rng.uniform(0.3, 0.5), (north - south) * rng.uniform(0.3, 0.5)
    corner = int(rng.integers(4))
    x = west - 1 if corner % 2 else east - w
    y = south - 1 if corner < 2 else north - h  # noqa: PLR2004 - the two southern corners
    return lot.difference(box(x, y, x + w + 1, y + h + 1))


def _u_shape(rng: Rng, lot: Polygon) -> Polygon:
    west, south, east, north = lot.bounds
    third = (east - west) / 3
    depth = (north - south) * rng.uniform(0.3, 0.5)
    court = box(west + third, north - depth, east - third, north + 1)
    quarter_turns = int(rng.integers(4))
    return affinity.rotate(lot.difference(court), 180.0 * (quarter_turns % 2), origin="centroid")


def _notched(rng: Rng, lot: Polygon) -> Polygon:
    shape = _quadrilateral(rng, lot)
    cut = shape.difference(_notch(rng, lot, 0.35, 0.3))
    return cut if isinstance(cut, Polygon) else shape


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
