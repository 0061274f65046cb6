"""The paper's figures 2, 3 and 4, drawn from a recorded run."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import networkx as nx
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as PolygonPatch
from numpy.typing import NDArray
from shapely.geometry import Polygon

import homsense
from homsense.engine import PYTHON
from homsense.skeleton import skeleton

FloatArray = NDArray[np.float64]

TOUCHING = 1e-9
WALL, FAR, NEAR, SEEN, TRUTH = "#c9ccd1", "#e3a857", "#2f6f9f", "#c0392b", "#1a1a1a"
STYLE: dict[Any, Any] = {
    "font.family": "serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}


def draw_all(run: Mapping[str, Any], directory: Path) -> list[Path]:
    """Draw the three figures of a recorded run.

    Parameters
    ----------
    run : mapping
        What `demo_run.Run.as_json` recorded.
    directory : pathlib.Path
        Where the pictures go.

    Returns
    -------
    list of pathlib.Path
        PNG files, in the order of the paper.
    """
    if "height_maps" not in run:
        message = "this is not a recorded run"
        raise ValueError(message)
    mpl.use("Agg")
    directory.mkdir(parents=True, exist_ok=True)
    drawn = {
        "figure2_height_maps.png": height_maps,
        "figure3_evolution.png": evolution,
        "figure4_measurement_error.png": measurement_error,
    }
    paths = []
    with mpl.rc_context(STYLE):
        for name, draw in drawn.items():
            figure = draw(run)
            paths.append(directory / name)
            figure.savefig(paths[-1])
            plt.close(figure)
    return paths


def height_maps(run: Mapping[str, Any]) -> Figure:
    """Draw Figure 2: the expected number of holes over the map, near and far."""
    figure, axes = plt.subplots(1, len(run["height_maps"]), figsize=(9.6, 3.9), squeeze=False)
    site_map = homsense.SiteMap.from_geojson(run["map_document"])
    for ax, height, label in zip(axes[0], run["height_maps"], _labels(run), strict=True):
        values, extent = _raster(height)
        values[~_free(site_map, height)] = np.nan
        picture = ax.imshow(values, origin="lower", extent=extent, cmap="viridis")
        _draw_walls(ax, site_map, color="#ffffff", edge="#6b7078")
        _plain(ax, site_map, f"{label}, {_source(height)}")
        figure.colorbar(picture, ax=ax, label="expected holes", shrink=0.75)
    return figure


def evolution(run: Mapping[str, Any]) -> Figure:
    """Draw Figure 3: landmarks, complex and posterior as the robot moves."""
    site_map = homsense.SiteMap.from_geojson(run["map_document"])
    grown = homsense.LandmarkComplex.from_observations(run["facets"], PYTHON)
    places = {name: tuple(place) for name, place in run["transmitters"].items()}
    layout = coordinate_free_layout(grown)
    snapshots = run["snapshots"]
    figure, axes = plt.subplots(
        len(snapshots), 3, figsize=(11.4, 3.05 * len(snapshots)), squeeze=False
    )
    for (left, middle, right), snapshot in zip(axes, snapshots, strict=True):
        levels = homsense.sense_local_homology(grown, snapshot["visible"], run["hops"])
        colors = _neighborhood_colors(grown, snapshot["visible"], levels)
        _draw_walls(left, site_map)
        _draw_landmarks(left, places, colors, snapshot["visible"])
        _draw_truth(left, snapshot["truth"])
        counts = ", ".join(f"{level.holes} holes in {level.hops} hops" for level in levels)
        _plain(left, site_map, f"{snapshot['travelled_m']:.0f} m: {counts}")
        _draw_complex(middle, grown, layout, colors, snapshot["visible"])
        _draw_walls(right, site_map)
        particles = np.array(snapshot["particles"])
        right.scatter(
            particles[:, 0], particles[:, 1], s=1.2, color=NEAR, alpha=0.35, linewidths=0
        )
        _draw_truth(right, snapshot["truth"])
        _plain(right, site_map, "posterior")
    axes[0][1].set_title("landmark complex (no coordinates)")
    return figure


def measurement_error(run: Mapping[str, Any]) -> Figure:
    """Draw Figure 4: absolute error of the measured counts, and the error of the position."""
    moments = run["moments"]
    way = np.array([moment["travelled_m"] for moment in moments])
    truth = np.array([moment["truth"][:2] for moment in moments])
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.2, 4.6), sharex=True)
    levels = zip(run["height_maps"], _labels(run), (NEAR, FAR, TRUTH, SEEN), strict=False)
    for index, (height, label, color) in enumerate(levels):
        expected = _as_height_map(height).at(truth)
        measured = np.array([np.nan if m["holes"] is None else m["holes"][index] for m in moments])
        upper.plot(way, np.abs(measured - expected), color=color, linewidth=1.0, label=label)
    upper.set_ylabel("absolute error, holes")
    upper.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    lower.plot(way, [m["error_m"] for m in moments], color=NEAR, label="homological sensing")
    lower.plot(way, [m["baseline_m"] for m in moments], color=WALL, label="motion and walls only")
    lower.set_yscale("log")
    lower.set_ylabel("position error, m")
    lower.set_xlabel("way, m")
    lower.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    return figure


def coordinate_free_layout(grown: homsense.LandmarkComplex) -> dict[str, FloatArray]:
    """Place landmarks in the plane by their hop distances alone.

    Parameters
    ----------
    grown : homsense.LandmarkComplex
        The complex.

    Returns
    -------
    dict of str to ndarray, shape (2,), float64
        Classical scaling of the hop distances, then stress majorization.
    """
    graph = skeleton(grown)
    if not graph:
        return {}
    hops = dict(nx.all_pairs_shortest_path_length(graph))
    names = sorted(graph)
    farthest = max(max(reached.values()) for reached in hops.values()) + 2.0
    distance = np.array([[float(hops[a].get(b, farthest)) for b in names] for a in names])
    places = _classical_scaling(distance)
    for _ in range(200):
        places = _majorize(places, distance)
    return dict(zip(names, places, strict=True))


def _classical_scaling(distance: FloatArray) -> FloatArray:
    center = np.eye(len(distance)) - 1.0 / len(distance)
    values, vectors = np.linalg.eigh(-0.5 * center @ np.square(distance) @ center)
    places: FloatArray = vectors[:, -2:] * np.sqrt(np.maximum(values[-2:], 0.0))
    return places if places.shape[1] == 2 else np.zeros((len(distance), 2))  # noqa: PLR2004


def _majorize(places: FloatArray, distance: FloatArray) -> FloatArray:
    """Take one step of stress majorization with weights 1 / distance^2."""
    weights = np.divide(1.0, np.square(distance), where=distance > 0, out=np.zeros_like(distance))
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    pull = np.divide(
        weights * distance, apart, where=apart > TOUCHING, out=np.zeros_like(distance)
    )
    moved = pull.sum(axis=1, keepdims=True) * places - pull @ places + weights @ places
    result: FloatArray = moved / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    return result


def _labels(run: Mapping[str, Any]) -> list[str]:
    names = ["near", "far"] if len(run["hops"]) == 2 else ["level"] * len(run["hops"])  # noqa: PLR2004
    return [f"{name} ({hops} hops)" for name, hops in zip(names, run["hops"], strict=True)]


def _source(height: Mapping[str, Any]) -> str:
    r_geo_m = height["r_geo_m"]
    return "simulated" if r_geo_m is None else f"$r_{{geo}}$ = {r_geo_m:.0f} m"


def _raster(height: Mapping[str, Any]) -> tuple[FloatArray, tuple[float, float, float, float]]:
    west, south, cell = height["west_m"], height["south_m"], height["cell_m"]
    extent = (west, west + cell * height["columns"], south, south + cell * height["rows"])
    return np.array(height["values"], dtype=np.float64), extent


def _as_height_map(height: Mapping[str, Any]) -> homsense.HeightMap:
    grid = homsense.Grid(
        height["west_m"], height["south_m"], height["cell_m"], height["columns"], height["rows"]
    )
    values = np.array(height["values"], dtype=np.float32)
    return homsense.HeightMap(grid, values, height["r_geo_m"])


def _free(site_map: homsense.SiteMap, height: Mapping[str, Any]) -> NDArray[np.bool_]:
    grid = _as_height_map(height).grid
    return site_map.is_free(grid.centers()).reshape(grid.shape)


def _draw_walls(
    ax: Axes, site_map: homsense.SiteMap, *, color: str = WALL, edge: str = "#8a9099"
) -> None:
    patches = [PolygonPatch(np.array(s.exterior.coords)) for s in site_map.structures]
    ax.add_collection(PatchCollection(patches, facecolor=color, edgecolor=edge, linewidth=0.4))


def _draw_truth(ax: Axes, truth: tuple[float, float, float]) -> None:
    x, y, heading = truth
    ax.plot(x, y, marker="o", markersize=9, markerfacecolor="none", color=TRUTH, markeredgewidth=1)
    ax.annotate(
        "",
        xytext=(x, y),
        xy=(x + 45 * np.cos(heading), y + 45 * np.sin(heading)),
        arrowprops={"arrowstyle": "-|>", "color": TRUTH, "linewidth": 1},
    )


def _neighborhood_colors(
    grown: homsense.LandmarkComplex,
    visible: Iterable[str],
    levels: list[homsense.LocalHomology],
) -> dict[str, str]:
    """Color each landmark by the smallest neighborhood that holds it."""
    colors = dict.fromkeys(sorted(grown.landmarks), "#b5bac1")
    for level, color in zip(reversed(levels), (FAR, NEAR), strict=False):
        colors.update(dict.fromkeys(level.landmarks, color))
    colors.update(dict.fromkeys(set(visible) & grown.landmarks, SEEN))
    return colors


def _draw_landmarks(
    ax: Axes, places: dict[str, tuple[float, float]], colors: dict[str, str], visible: list[str]
) -> None:
    for name in sorted(colors):
        marker, size = ("s", 16) if name in visible else ("o", 6)
        x, y = places[name]
        ax.scatter(x, y, marker=marker, s=size, color=colors[name], linewidths=0)


def _draw_complex(
    ax: Axes,
    grown: homsense.LandmarkComplex,
    layout: dict[str, FloatArray],
    colors: dict[str, str],
    visible: list[str],
) -> None:
    hulls = [_hull([layout[name] for name in facet]) for facet in grown.facets if len(facet) > 2]  # noqa: PLR2004
    ax.add_collection(PolyCollection(hulls, facecolor="#9aa7b8", alpha=0.12, linewidth=0))
    edges = [(layout[a], layout[b]) for a, b in skeleton(grown).edges]
    ax.add_collection(LineCollection(edges, colors="#7d8794", linewidths=0.25, alpha=0.7))
    for name, place in layout.items():
        marker, size = ("s", 16) if name in visible else ("o", 6)
        ax.scatter(
            place[0], place[1], marker=marker, s=size, color=colors[name], linewidths=0, zorder=3
        )
    ax.set_aspect("equal")
    ax.axis("off")


def _hull(points: list[FloatArray]) -> FloatArray:
    hull = Polygon(points).convex_hull
    return np.array(hull.exterior.coords if isinstance(hull, Polygon) else points)


def _plain(ax: Axes, site_map: homsense.SiteMap, title: str) -> None:
    west, south, east, north = site_map.bounds
    ax.set(xlim=(west, east), ylim=(south, north), aspect="equal", xticks=[], yticks=[])
    ax.set_title(title)
    for side in ax.spines.values():
        side.set_visible(True)
        side.set_linewidth(0.4)
