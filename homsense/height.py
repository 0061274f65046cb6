"""Height maps: the number of holes to expect at each place of the metric map (paper, Fig. 2).

A structure is expected as a hole where every point of its surface mesh lies within r_geo.
This file depends on the map alone, never on the landmark complex.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
import shapely
from numpy.typing import NDArray

from homsense.errors import InvalidInputError
from homsense.geodesic import distances_from, free_space_graph
from homsense.grid import Grid
from homsense.site_map import SiteMap

FloatArray = NDArray[np.float64]
Distance = Literal["euclidean", "geodesic"]

MESH_M = 5.0
_SLACK_M = 1e-3
"""Places that far beyond a radius are looked at, too: rounding must not lose any."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Expected number of holes over a grid.

    Parameters
    ----------
    grid : Grid
        The raster.
    values : ndarray, shape (rows, columns), float32
        Expected holes at the middle of each cell.
    r_geo_m : float, optional
        Geodetic radius, metres; absent when values do not come from one.
    """

    grid: Grid
    values: NDArray[np.float32]
    r_geo_m: float | None

    @classmethod
    def geometric(
        cls,
        site_map: SiteMap,
        r_geo_m: float,
        *,
        cell_m: float = 2.0,
        distance: Distance = "euclidean",
        mesh_m: float = MESH_M,
    ) -> Self:
        """Count the structures that lie fully within a radius (paper, section V-B.3).

        Parameters
        ----------
        site_map : SiteMap
            The map.
        r_geo_m : float
            Geodetic radius, metres, positive.
        cell_m : float, default 2.0
            Side of a cell, metres.
        distance : {"euclidean", "geodesic"}, default "euclidean"
            Straight distance, or the length of the shortest way through free space; the latter
            searches the grid once for each mesh point.
        mesh_m : float, default 5.0
            Spacing of the surface mesh, metres.

        Returns
        -------
        HeightMap
            The look-up table.

        Raises
        ------
        InvalidInputError
            If a length is not positive or the grid is too large.

        Examples
        --------
        >>> ring = [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]
        >>> square = {"type": "Polygon", "coordinates": [ring], "frame": "local"}
        >>> height = HeightMap.geometric(SiteMap.from_geojson(square), r_geo_m=20.0)
        >>> height.at(np.array([[-4.0, 5.0], [24.0, 5.0]])).tolist()
        [1.0, 0.0]
        """
        for name, length in (("r_geo_m", r_geo_m), ("mesh_m", mesh_m)):
            if not (np.isfinite(length) and length > 0.0):
                message = f"{name} must be positive, not {length}"
                raise InvalidInputError(message, name)
        grid = Grid.covering(site_map, cell_m)
        meshes = site_map.surface_mesh(mesh_m)
        if distance == "geodesic":
            counts = _count_geodesic(site_map, grid, meshes, r_geo_m)
        else:
            counts = structures_within(meshes, grid.centers(), np.array([r_geo_m]))[0]
        return cls(grid, counts.reshape(grid.shape).astype(np.float32), r_geo_m)

    def at(
        self, xy: FloatArray, *, interpolation: Literal["nearest", "bilinear"] = "nearest"
    ) -> FloatArray:
        """Look up the expected number of holes, in O(1) a place.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.
        interpolation : {"nearest", "bilinear"}, default "nearest"
            Value of the cell, or a mean over the four cells around.

        Returns
        -------
        ndarray, shape (N,), float64
            Expected holes; NaN outside the grid.
        """
        places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        flat = self.grid.flat_index(places)
        if interpolation == "bilinear":
            found = self._bilinear(places)
        else:
            found = self._flat_values[flat].astype(np.float64)
        return np.where(flat < 0, np.nan, found)

    @cached_property
    def _flat_values(self) -> NDArray[np.float32]:
        return np.ascontiguousarray(self.values).ravel()

    def _bilinear(self, places: FloatArray) -> FloatArray:
        grid = self.grid
        column = np.clip((places[:, 0] - grid.west_m) / grid.cell_m - 0.5, 0, grid.columns - 1)
        row = np.clip((places[:, 1] - grid.south_m) / grid.cell_m - 0.5, 0, grid.rows - 1)
        column, row = np.nan_to_num(column), np.nan_to_num(row)
        left = np.minimum(column.astype(np.intp), max(0, grid.columns - 2))
        below = np.minimum(row.astype(np.intp), max(0, grid.rows - 2))
        right = np.minimum(left + 1, grid.columns - 1)
        above = np.minimum(below + 1, grid.rows - 1)
        u, v = column - left, row - below
        south = (1 - u) * self.values[below, left] + u * self.values[below, right]
        north = (1 - u) * self.values[above, left] + u * self.values[above, right]
        return np.asarray((1 - v) * south + v * north, dtype=np.float64)


def structures_within(
    meshes: list[FloatArray], places: FloatArray, radii_m: FloatArray
) -> FloatArray:
    """Count, for each radius and place, the structures whose whole mesh lies within the radius.

    Parameters
    ----------
    meshes : list of ndarray, shape (M, 2), float64
        Surface mesh of each structure, metres.
    places : ndarray, shape (N, 2), float64
        Where to stand, metres.
    radii_m : ndarray, shape (R,), float64
        Straight distances, metres.

    Returns
    -------
    ndarray, shape (R, N), float64
        Counts.
    """
    counts = np.zeros((len(radii_m), len(places)))
    northward = np.argsort(places[:, 1], kind="stable")
    east, north = places[northward].T
    reach = radii_m.max(initial=0.0) + _SLACK_M
    for mesh in meshes:
        hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(mesh)))
        (west_m, south_m), (east_m, north_m) = hull.max(axis=0) - reach, hull.min(axis=0) + reach
        first, last = np.searchsorted(north, (south_m, north_m))
        band = east[first:last]
        near = first + np.flatnonzero((band >= west_m) & (band <= east_m))
        farthest = np.zeros(len(near))
        for x, y in hull:
            np.maximum(farthest, np.hypot(east[near] - x, north[near] - y), out=farthest)
        counts[:, northward[near]] += farthest <= radii_m[:, None]
    return counts


def _count_geodesic(
    site_map: SiteMap, grid: Grid, meshes: list[FloatArray], r_geo_m: float
) -> FloatArray:
    free = site_map.is_free(grid.centers()).reshape(grid.shape)
    graph = free_space_graph(grid, free)
    counts = np.zeros(free.size)
    for mesh in meshes:
        within = free.ravel().copy()
        for distance in distances_from(grid, graph, free, mesh, r_geo_m):
            within &= distance <= r_geo_m
        counts += within
    return counts
