"""Expected holes over the map."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.builders import feature, local_map, square

from homsense import FreeSpace, HeightMap, InvalidInputError, SiteMap, calibrate_r_geo
from homsense.geodesic import distances_from, free_space_graph
from homsense.grid import Grid
from homsense.height import structures_within
from homsense.philox import random_words

Array = NDArray[np.float64]

BLOCKS = SiteMap.from_geojson(
    local_map(*(feature(square(60 * i, 60 * j, 40)) for i in range(4) for j in range(3)))
)


def test_a_structure_counts_where_its_whole_mesh_is_near(square: SiteMap) -> None:
    height = HeightMap.geometric(square, 14.0, cell_m=1.0)
    xy = height.grid.centers()
    corners = np.array([[0, 0], [10, 0], [0, 10], [10, 10]])
    farthest = np.linalg.norm(xy[:, None] - corners, axis=2).max(axis=1)
    assert np.array_equal(height.at(xy), (farthest <= 14.0).astype(float))


numbers = st.integers(-30, 30).map(float) | st.floats(-30.0, 30.0)
points = st.lists(st.tuples(numbers, numbers), min_size=1, max_size=6).map(np.array)


@given(
    meshes=st.lists(points, max_size=4),
    places=points,
    radii=st.lists(st.integers(0, 50).map(float), min_size=1, max_size=3).map(np.array),
)
def test_a_count_is_of_the_structures_no_point_of_which_is_farther(
    meshes: list[Array], places: Array, radii: Array
) -> None:
    expected = np.zeros((len(radii), len(places)))
    for mesh in meshes:
        apart = np.hypot(*(places[:, None] - mesh).transpose(2, 0, 1)).max(axis=1)
        expected += apart <= radii[:, None]
    assert structures_within(meshes, places, radii).tolist() == expected.tolist()


def test_bilinear_look_up_agrees_at_the_middle_of_cells_and_between_them() -> None:
    grid = Grid(0.0, 0.0, 2.0, 2, 2)
    height = HeightMap(grid, np.array([[0.0, 2.0], [4.0, 6.0]], dtype=np.float32), 1.0)
    places = np.array([[1.0, 1.0], [3.0, 1.0], [2.0, 1.0], [2.0, 2.0], [0.0, 0.0]])
    assert height.at(places, interpolation="bilinear").tolist() == [0.0, 2.0, 1.0, 3.0, 0.0]
    assert height.at(places[:2]).tolist() == [0.0, 2.0]


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_outside_the_grid_there_is_no_number(square: SiteMap, interpolation: str) -> None:
    height = HeightMap.geometric(square, 30.0)
    places = np.array([[1e6, 0.0], [math.nan, 0.0], [0.0, -math.inf], [0.0, 0.0]])
    found = height.at(places, interpolation=interpolation)  # type: ignore[arg-type]
    assert np.isnan(found).tolist() == [True, True, True, False]


def test_the_way_round_a_wall_is_longer_than_the_straight_line() -> None:
    wall = {"type": "Polygon", "coordinates": [[[0, -50], [4, -50], [4, 50], [0, 50], [0, -50]]]}
    site_map = SiteMap.from_geojson(local_map(feature(wall)))
    grid = Grid.covering(site_map, 2.0)
    free = site_map.is_free(grid.centers()).reshape(grid.shape)
    graph = free_space_graph(grid, free)
    (distance,) = distances_from(grid, graph, free, np.array([[-1.0, 0.0]]), 500.0)
    (index,) = grid.flat_index(np.array([[5.0, 0.0]]))
    shortest = 2 * math.hypot(1.0, 50.0) + 4.0
    assert shortest <= distance[index] <= 1.1 * shortest


def test_grid_paths_in_the_open_exceed_straight_lines_by_under_three_per_cent() -> None:
    grid = Grid(0.0, 0.0, 1.0, 81, 81)
    free = np.ones(grid.shape, dtype=bool)
    source = np.array([[40.5, 40.5]])
    (found,) = distances_from(grid, free_space_graph(grid, free), free, source, 1e3)
    straight = np.linalg.norm(grid.centers() - source, axis=1)
    far = straight > 10.0
    assert (found[far] >= straight[far] - 1e-9).all()
    assert (found[far] / straight[far]).max() < 1.03


def test_geodesic_counts_never_exceed_euclidean_ones_in_free_space() -> None:
    near = HeightMap.geometric(BLOCKS, 90.0, cell_m=5.0, distance="geodesic", mesh_m=10.0)
    straight = HeightMap.geometric(BLOCKS, 95.0, cell_m=5.0, mesh_m=10.0)
    free = BLOCKS.is_free(near.grid.centers()).reshape(near.grid.shape)
    assert (near.values[free] <= straight.values[free]).all()
    assert near.values[free].max() > 0


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_lengths_must_be_positive(square: SiteMap, bad: float) -> None:
    with pytest.raises(InvalidInputError, match="r_geo_m"):
        HeightMap.geometric(square, bad)
    with pytest.raises(InvalidInputError, match="mesh_m"):
        HeightMap.geometric(square, 10.0, mesh_m=bad)


@pytest.mark.parametrize("true_r", [75.0, 110.0])
def test_calibration_finds_the_radius_that_made_the_counts(true_r: float) -> None:
    free_space = FreeSpace.of(BLOCKS, 2.0)
    places = np.stack(free_space.draw(random_words(5, 0, 0, 400)[:3]), axis=1, dtype=np.float64)
    counts = HeightMap.geometric(BLOCKS, true_r).at(places).astype(int).tolist()
    assert calibrate_r_geo(BLOCKS, free_space, counts) == pytest.approx(true_r, rel=0.08)


def test_calibration_needs_counts(square: SiteMap) -> None:
    with pytest.raises(InvalidInputError, match="counts"):
        calibrate_r_geo(square, FreeSpace.of(square, 2.0), [])
