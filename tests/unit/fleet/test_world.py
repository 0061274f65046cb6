"""The simulated world is the one it promises, and its devices keep to it."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from homsense_fleet.device import OdometryNoise, drive, phone_scans
from homsense_fleet.routes import walk_positions, wander
from homsense_fleet.world import Radio, downtown_44, world_from_geojson
from shapely.geometry import LineString, box, mapping
from support.builders import SITE_MAP


@pytest.mark.parametrize("seed", range(5))
def test_downtown_has_44_buildings_and_197_transmitters(seed: int) -> None:
    world = downtown_44(seed)
    assert len(world.city.buildings) == 44
    assert len(set(world.ids)) == 197
    assert all(building.is_valid for building in world.city.buildings)
    assert not shapely.intersects_xy(world.walls, *world.transmitters.T).any()
    overlap = sum(b.area for b in world.city.buildings) - shapely.union_all(world.walls).area
    assert abs(overlap) < 1e-6


def test_roads_keep_clear_of_buildings() -> None:
    world = downtown_44(1)
    lines = shapely.linestrings([[a, b] for a, b in world.city.roads.edges])
    assert not shapely.intersects(world.walls, lines).any()


def test_the_seed_decides_the_world() -> None:
    one, same, other = downtown_44(1), downtown_44(1), downtown_44(2)
    assert one.map_document() == same.map_document()
    assert one.ids == same.ids
    assert one.map_document() != other.map_document()


def test_only_transmitters_in_range_and_in_sight_are_heard() -> None:
    world = downtown_44(3, radio=Radio(s_max_m=60.0, dropout=0.0))
    rng = np.random.default_rng(1)
    for place in walk_positions(wander(world, rng, 400.0), 20.0, 400.0):
        heard = {entry["id"] for entry in world.scan(place, rng)}
        for name, (x, y) in world.places().items():
            line = shapely.LineString([place, (x, y)])
            expected = line.length <= 60.0 and not line.intersects(world.walls)
            assert (name in heard) == expected


def test_missed_detections_are_as_frequent_as_told() -> None:
    world = downtown_44(3, radio=Radio(dropout=0.3))
    rng = np.random.default_rng(1)
    place = np.array(sorted(world.city.roads.nodes)[20])
    due = len(world.in_view(place)[0])
    assert due > 3
    mean = np.mean([len(world.scan(place, rng)) for _ in range(2000)])
    assert mean == pytest.approx(0.7 * due, rel=0.05)


def test_a_robot_that_measures_well_can_be_dead_reckoned() -> None:
    world = downtown_44(4)
    steps = list(
        drive(world, np.random.default_rng(2), length_m=300.0, noise=OdometryNoise(0.0, 0.0))
    )
    first = steps[0]
    x, y, heading = first.truth
    x -= first.delta["forward_m"] * math.cos(heading)
    y -= first.delta["forward_m"] * math.sin(heading)
    for step in steps:
        forward, left = step.delta["forward_m"], step.delta["left_m"]
        x += math.cos(heading) * forward - math.sin(heading) * left
        y += math.sin(heading) * forward + math.cos(heading) * left
        heading += step.delta["turn_rad"]
        assert (x, y) == pytest.approx(step.truth[:2], abs=1e-6)
    assert steps[-1].travelled_m == 300.0


def test_phones_walk_outside_buildings_and_post_what_the_contract_takes() -> None:
    world = downtown_44(5)
    scans = list(phone_scans(world, "p", np.random.default_rng(3), count=40))
    assert 30 <= len(scans) <= 40
    assert len({scan["scan_id"] for scan in scans}) == len(scans)
    assert all(entry["rssi"] < -30 for scan in scans for entry in scan["landmarks"])
    assert not any(key in scan for scan in scans for key in ("x", "y", "position"))


def test_phones_keep_account_of_their_steps_from_where_they_began() -> None:
    world = downtown_44(5)
    tracks = [
        scan["track"] for scan in phone_scans(world, "p", np.random.default_rng(3), count=40)
    ]
    assert (tracks[0]["x_m"], tracks[0]["y_m"]) == (0.0, 0.0)
    ways = [math.dist(*pair) for pair in pairwise((t["x_m"], t["y_m"]) for t in tracks)]
    assert 5.0 < np.median(ways) < 20.0


def test_any_geojson_map_can_be_loaded() -> None:
    world = world_from_geojson(SITE_MAP, 1, n_transmitters=12)
    assert len(world.city.buildings) == 3
    assert list(phone_scans(world, "p", np.random.default_rng(1), count=5))
    degrees = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {},
        "geometry": {"type": "Polygon", "coordinates": [[[24.94, 60.17], [24.941, 60.17],
        [24.941, 60.171], [24.94, 60.171], [24.94, 60.17]]]}}]}  # fmt: skip
    on_earth = world_from_geojson(degrees, 1, n_transmitters=5)
    assert on_earth.origin == pytest.approx((60.1705, 24.9405))
    assert on_earth.walls.area == pytest.approx(55.5 * 111.4, rel=0.02)
    with pytest.raises(ValueError, match="no building"):
        world_from_geojson({"type": "FeatureCollection", "features": []}, 1)


def test_nobody_leaves_the_domain_of_a_map() -> None:
    hall = box(0, 0, 200, 200) - box(14, 14, 186, 186)
    features = [
        {"type": "Feature", "properties": {"role": role}, "geometry": mapping(area)}
        for role, area in (("domain", hall), ("structure", box(0, 90, 2, 110)))
    ]
    document = {"type": "FeatureCollection", "frame": "local", "features": features}
    world = world_from_geojson(document, 1, n_transmitters=12)
    assert len(world.city.buildings) == 1
    assert shapely.contains_xy(hall, world.transmitters).all()
    assert hall.contains(LineString(wander(world, np.random.default_rng(1), 2000.0)))
    assert world.is_free(np.array([7.0, 40.0]))
    assert not world.is_free(np.array([100.0, 100.0]))
    assert not world.is_free(np.array([-10.0, 40.0]))
    again = world_from_geojson(world.map_document(), 1, n_transmitters=12)
    assert np.array_equal(again.transmitters, world.transmitters)


def test_a_map_may_be_a_bare_polygon() -> None:
    square = {"type": "Polygon", "coordinates": [[[0, 0], [60, 0], [60, 60], [0, 60], [0, 0]]]}
    world = world_from_geojson({**square, "frame": "local"}, 1, n_transmitters=5)
    assert world.walls.area == pytest.approx(3600.0, rel=0.01)
