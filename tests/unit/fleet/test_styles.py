"""Every style of city is one in which robots can drive between buildings."""

import numpy as np
import pytest
import shapely
from homsense_fleet.routes import wander
from homsense_fleet.styles import STYLES, scaled
from homsense_fleet.world import World, city_world, world_from_geojson
from support.builders import SITE_MAP


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("seed", range(3))
def test_a_city_has_44_buildings_and_roads_between_them(style: str, seed: int) -> None:
    world = city_world(style, seed)
    assert len(world.city.buildings) == 44
    walls = shapely.union_all(world.city.buildings)
    assert walls.area == pytest.approx(sum(b.area for b in world.city.buildings))
    ends = np.array(list(world.city.roads.edges))
    assert not shapely.intersects(walls, shapely.linestrings(ends)).any()
    assert world.city.district is not None
    assert shapely.contains(world.city.district.buffer(1e-6), walls)
    assert not shapely.intersects_xy(world.walls, *world.transmitters.T).any()


def test_a_city_scales_with_everything_in_it() -> None:
    city = STYLES["old-town"](np.random.default_rng(1))
    double = scaled(city, 2.0)
    assert double.buildings[0].area == pytest.approx(4.0 * city.buildings[0].area)
    assert double.roads.number_of_edges() == city.roads.number_of_edges()


def _is_clear(world: World, corners: np.ndarray) -> bool:
    return not shapely.intersects(world.walls, shapely.linestrings([corners])).any()


def test_in_the_open_one_walks_straight_to_destinations() -> None:
    world = world_from_geojson(SITE_MAP, 1, n_transmitters=5)
    corners = wander(world, np.random.default_rng(2), 600.0)
    legs = np.hypot(*np.diff(corners, axis=0).T)
    assert legs.sum() >= 600.0
    assert _is_clear(world, corners)
    assert np.median(legs) > 16.0
