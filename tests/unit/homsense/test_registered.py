"""A crowd without labels finds its place on the map, and devices find theirs among the crowd."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from unittest.mock import Mock

import numpy as np
import pytest
from support.corridors import Building, mirrored

from homsense import (
    CodeMap,
    CountNoise,
    Delta,
    FreeSpace,
    Hearing,
    HeightMap,
    HolesAtPlace,
    InvalidConfigurationError,
    InvalidInputError,
    JointLikelihood,
    JointMeasurement,
    Localizer,
    LocalizerConfig,
    PlaceLikelihood,
    Reading,
    RegisteredComplex,
    Sighting,
    WalkScan,
    rank_floors,
    register_crowd,
)
from homsense.backend import NUMPY, compiled
from homsense.likelihood import CodeLikelihood, Likelihood
from homsense.registered.crowd import Crowd, likeness
from homsense.registered.layout import Layout, Pull, lay_out, parts, settle
from homsense.registered.placing import STAGES
from homsense.registered.registration import MIRRORED_M, register

BLOCK_M, MIDDLE_M = 3.0, 75.0


@cache
def registered(seed: int = 0, turned_rad: float = 0.0) -> tuple[Building, RegisteredComplex]:
    building = Building.of(seed)
    crowd = building.crowd(seed + 10, 40, turned_rad)
    return building, register_crowd(crowd, building.free_space)


def likelihood(building: Building, found: RegisteredComplex) -> PlaceLikelihood:
    return PlaceLikelihood(found, building.free_space)


@pytest.mark.parametrize("turned_rad", [0.0, 2.0])
def test_a_crowd_finds_its_place_whatever_its_compass_calls_east(turned_rad: float) -> None:
    building, found = registered(0, turned_rad)
    truth = [
        (scan.walk, scan.t_s, *place)
        for scan, place in building.crowd_with_truth(10, 40, turned_rad)
        if found.hearing.signature(scan.readings)
    ]
    places = np.array([entry[2:] for entry in sorted(truth, key=lambda entry: entry[:2])])
    assert len(places) == found.size
    assert np.median(np.linalg.norm(found.xy - places, axis=1)) < 4.0
    best = found.registration.placements[0]
    assert math.cos(best.rotation_rad + turned_rad) > 0.95
    assert found.registration.margin_m > 0.5


def test_a_crowd_knows_its_floor() -> None:
    building, found = registered()
    own = building.free_space
    hall = FreeSpace(own.grid, np.append(np.ones(len(own.free) - 1, np.bool_), False))
    floors = {"hall": hall, "own": own, "mirrored": mirrored(own)}
    ranked = rank_floors(building.crowd(10, 40), floors)
    assert {fit.name for fit in ranked} == set(floors)
    assert ranked[0].name == "own"
    assert ranked[0].probability > 0.9
    assert ranked[0].complex.registration == found.registration
    assert sum(fit.probability for fit in ranked) == pytest.approx(1.0)
    costs = [fit.complex.registration.cost_m for fit in ranked]
    assert costs == sorted(costs)
    with pytest.raises(InvalidInputError, match="at least one map"):
        rank_floors(building.crowd(10, 40), {})


def test_a_foreign_map_costs_more_and_a_crowd_without_likeness_is_refused() -> None:
    building, found = registered()
    foreign = register_crowd(building.crowd(10, 40), mirrored(building.free_space))
    cost = found.registration.cost_m
    assert foreign.registration.cost_m > 1.5 * cost
    assert foreign.registration.is_doubtful
    assert not found.registration.is_doubtful
    strangers = [
        WalkScan(
            f"w{walk}",
            2.0 * moment,
            2.5 * moment,
            0.0,
            tuple(
                Reading(f"{walk}-{number}", -50.0 - abs(3 * moment - 6 * number))
                for number in range(9)
            ),
        )
        for walk in range(4)
        for moment in range(20)
    ]
    with pytest.raises(InvalidInputError, match="no two walks"):
        register_crowd(strangers, building.free_space)
    with pytest.raises(InvalidInputError, match="too few"):
        register_crowd(strangers[:1], building.free_space)


def test_scans_may_come_in_any_order_and_each_stage_is_told() -> None:
    building = Building.of(0)
    crowd = building.crowd(10, 12)
    stages: list[str] = []
    found = register_crowd(crowd, building.free_space, on_stage=stages.append)
    again = register_crowd(crowd[::-1], building.free_space)
    assert tuple(stages) == STAGES
    assert np.array_equal(found.xy, again.xy)


@pytest.mark.parametrize("most", [1, 100, 333, 10_000])
def test_of_a_large_crowd_some_whole_walks_are_laid_out(most: int) -> None:
    crowd = Crowd.of(Building.of(0).crowd(10, 40))
    few = crowd.few(most)
    chosen = np.isin(crowd.source, few.source)
    assert not set(crowd.walk[chosen].tolist()) & set(crowd.walk[~chosen].tolist())
    assert set(few.walk.tolist()) == set(range(few.n_walks))
    longest = np.bincount(crowd.walk).max()
    assert min(most, crowd.size) / 2 - longest <= few.size <= most + longest


def test_a_layout_is_the_crowd_up_to_similarity() -> None:
    building = Building.of(1)
    pairs = list(building.crowd_with_truth(11, 40))
    crowd = Crowd.of(scan for scan, _ in pairs)
    like = likeness(crowd)
    part = parts(crowd, like) == 0
    truth = np.array([place for scan, place in pairs if Hearing().signature(scan.readings)])
    there, here = (
        xy[:, 0] + 1j * xy[:, 1] - (xy[:, 0] + 1j * xy[:, 1]).mean()
        for xy in (truth[part], lay_out(crowd, like).xy[part])
    )
    turned = (np.conj(here) @ there) / (np.conj(here) @ here)
    assert part.mean() > 0.9
    assert np.median(np.abs(turned * here - there)) < 6.0
    assert 0.8 < abs(turned) < 1.4


def test_a_placement_is_found_from_every_direction() -> None:
    building = Building.of(0)
    truth = np.array([place for _, place in building.crowd_with_truth(10, 40)])
    for turn in (0.3, 1.7, 4.0):
        cos, sin = math.cos(turn), math.sin(turn)
        turned = truth @ np.array([[cos, sin], [-sin, cos]]) / 1.2 + (300.0, -40.0)
        one = np.zeros(len(truth), np.int64)
        tried, _ = register(turned, one, building.free_space)
        best, offset = min(tried, key=lambda found: found.placement.cost_m)
        assert offset == pytest.approx(0.0)
        assert np.median(np.linalg.norm(best.place(turned) - truth, axis=1)) < 3.0


def test_the_mirror_image_is_searched_as_well_as_the_crowd_itself() -> None:
    building = Building.of(0)
    truth = np.array([place for _, place in building.crowd_with_truth(10, 40)]) - MIDDLE_M
    one = np.zeros(len(truth), np.int64)
    found = register(truth, one, building.free_space, 0.1)
    mirrored = register(truth * (-1.0, 1.0), one, building.free_space, 0.1)
    assert found.best_m < mirrored.best_m - MIRRORED_M
    assert found.best_m == pytest.approx(mirrored.mirrored_m, abs=0.05)
    assert mirrored.best_m == pytest.approx(found.mirrored_m, abs=0.05)


def test_parts_that_never_hear_each_other_are_placed_together() -> None:
    building = Building.of(2)
    wings = [
        (replace(scan, walk=f"{scan.walk} {place[0] > MIDDLE_M}"), place)
        for scan, place in building.crowd_with_truth(10, 40)
        if abs(place[0] - MIDDLE_M) > 8.0
    ]
    found = register_crowd([scan for scan, _ in wings], building.free_space, rotation_sd_rad=0.1)
    truth = np.array([place for _, place in wings])[found.source]
    error = np.linalg.norm(found.xy - truth, axis=1)
    east = truth[:, 0] > MIDDLE_M
    assert 0.2 < east.mean() < 0.8
    assert found.size > 0.95 * len(wings)
    assert max(np.median(error[east]), np.median(error[~east])) < 4.0


def test_walks_that_hear_nothing_alike_are_driven_apart_and_those_that_do_are_not() -> None:
    """The first and the third walk the same way; the second is laid out beside them."""

    def heard(kind: str, x: float) -> tuple[Reading, ...]:
        return tuple(Reading(f"{kind}{at}", -50.0) for at in range(0, 60, 5) if abs(at - x) < 12.0)

    crowd = Crowd.of(
        WalkScan(str(number), 5.0 * x, x, 0.0, heard(kind, x))
        for number, kind in enumerate("aba")
        for x in np.arange(0.0, 60.0, 2.0).tolist()
    )
    beside = np.array([0.0, 2.0, 1.0])[crowd.walk]
    start = Layout(np.stack([crowd.own_xy[:, 0], beside], axis=1), np.zeros(3), np.zeros(3))
    *_, before, found = settle(crowd, likeness(crowd), start, lambda xy: Pull(xy, 30.0))
    assert np.abs(found.xy - before.xy).max() < 0.2
    first, second, third = (found.xy[crowd.walk == walk, 1].mean() for walk in range(3))
    assert abs(first - third) < 1.5
    assert min(abs(first - second), abs(second - third)) > 4.0


def test_a_part_of_a_few_scans_is_left_out() -> None:
    crowd = Crowd.of(Building.of(0).crowd(10, 12))
    like = likeness(crowd)
    kept = (crowd.walk[like.first] != 0) & (crowd.walk[like.second] != 0)
    rest = replace(
        like, first=like.first[kept], second=like.second[kept], similarity=like.similarity[kept]
    )
    assert np.array_equal(parts(crowd, rest) == -1, crowd.walk == 0)


def test_a_scan_is_best_explained_near_where_it_was_made() -> None:
    building, found = registered()
    weigh = likelihood(building, found)
    rng = np.random.default_rng(3)
    errors, ranks = [], []
    for place in building.walk(rng, 120.0):
        sighting = found.sighting(building.readings(place, rng))
        assert sighting is not None
        bits = weigh(sighting)
        assert bits.max() == 0.0
        middles = weigh.code_map.expected
        errors.append(np.linalg.norm(middles[int(bits.argmax())] - place))
        here = int(np.nanargmin(np.linalg.norm(middles - place, axis=1)))
        ranks.append((bits > bits[here]).mean())
    assert np.median(errors) < 12.0
    assert np.median(ranks) < 0.15


def test_coverage_is_by_where_the_pose_lies_and_by_what_was_heard() -> None:
    building, found = registered()
    rng = np.random.default_rng(4)
    here = found.sighting(building.readings(np.array([40.0, 40.0]), rng))
    assert here is not None
    assert here.highest == max(here.level)
    assert Sighting((), ()).highest == 0
    for share in (0.0, 0.3, 1.0):
        assert found.coverage(share, 0) < found.coverage(share, None)
        assert found.coverage(share, None) < found.coverage(share, here.highest) < 1.0
    assert found.coverage(0.3, None) == pytest.approx(0.3)
    assert found.coverage(0.0, here.highest) < 0.5 < found.coverage(1.0, here.highest)
    assert found.coverage(0.5, 0) < 0.5


def test_what_resembles_nothing_was_made_where_nobody_has_been() -> None:
    building = Building.of(0)
    west = [scan for scan, place in building.crowd_with_truth(10, 40) if place[0] < 80.0]
    found = register_crowd(west, building.free_space, rotation_sd_rad=0.1)
    weigh = likelihood(building, found)
    nothing = found.sighting([Reading(f"unknown-{number}") for number in range(5)])
    assert nothing == Sighting((), ())
    assert found.sighting([Reading("a"), Reading("b")]) is None
    bits = weigh(nothing)
    covered = found.covers(weigh.code_map.expected[1:])
    assert 0.3 < covered.mean() < 1.0
    centers = building.free_space.grid.centers()
    assert np.array_equal(weigh.covers(centers + 0.4), found.covers(centers))
    assert not weigh.covers(np.array([[1e5, 0.0]])).any()
    assert np.median(bits[1:][~covered]) > np.median(bits[1:][covered])
    for strange in (Sighting((found.size,), (1,)), Sighting((0,), (found.nats.shape[1],))):
        with pytest.raises(InvalidInputError, match="another complex"):
            weigh(strange)


def test_a_device_is_localized_by_the_crowd_with_the_same_bits_on_every_backend() -> None:
    building, found = registered()
    weigh = likelihood(building, found)
    config = LocalizerConfig(particles=2000, cell_m=1.0)
    localizer = Localizer(
        building.site_map, (), config, free_space=building.free_space, likelihood=weigh
    )
    rng = np.random.default_rng(5)
    places = building.walk(rng, 120.0)
    digests = set()
    for backend in {NUMPY, compiled() or NUMPY}:
        fast, turn = localizer.run_by(backend), 0.0
        state = fast.start(7)
        walk = np.random.default_rng(6)
        for here, there in pairwise(places):
            heading = math.atan2(*(there - here)[::-1])
            delta = Delta(*_ahead(here, there, turn), std=(0.3, 0.3, 0.1))
            turn = heading
            state, pose = fast.step(state, delta, found.sighting(building.readings(there, walk)))
        assert math.dist((pose.modes[0].x_m, pose.modes[0].y_m), places[-1]) < 10.0
        digests.add(state.digest())
    assert len(digests) == 1


def _ahead(here: np.ndarray, there: np.ndarray, before: float) -> tuple[float, float, float]:
    heading = math.atan2(*(there - here)[::-1])
    length, turn = math.dist(here, there), math.remainder(heading - before, math.tau)
    return length * math.cos(turn), length * math.sin(turn), turn


def test_counts_at_the_place_of_a_scan_tell_less_than_the_place() -> None:
    building, found = registered()
    place = likelihood(building, found)
    heights = [HeightMap.geometric(building.site_map, radius) for radius in (30.0, 60.0)]
    holes = HolesAtPlace(place, heights)
    sighting = found.sighting(building.readings(np.array([30.0, 5.0]), np.random.default_rng(1)))
    assert sighting is not None
    bits = holes(sighting)
    assert bits.max() <= 0.0
    assert bits[0] < -100.0
    by_count: dict[tuple[float, ...], set[float]] = {}
    for middle, value in zip(holes.code_map.expected[1:], bits[1:], strict=True):
        key = tuple(float(height.at(middle[None])[0]) for height in heights)
        by_count.setdefault(key, set()).add(round(float(value), 9))
    assert all(len(values) == 1 for values in by_count.values())
    assert len(by_count) < len(np.unique(place(sighting)))


def test_what_a_scan_tells_is_judged_by_walks_that_are_left_out() -> None:
    building, found = registered()
    place = likelihood(building, found)
    blocks = float(place.code_map.sizes.sum())
    assert 1.0 < place.information_bits < np.log2(blocks)
    rng = np.random.default_rng(8)
    mixed = replace(
        found, signatures=tuple(found.signatures[i] for i in rng.permutation(found.size))
    )
    assert likelihood(building, mixed).information_bits < 0.5


def test_two_sensors_are_weighed_each_at_its_own_pace() -> None:
    building, found = registered()
    place = likelihood(building, found)
    height = HeightMap.geometric(building.site_map, 30.0)
    counts = CodeLikelihood(
        CodeMap.of(building.free_space, [height]), CountNoise(correlation_m=100.0)
    )
    joint = JointLikelihood(place, counts)
    sighting = Sighting((0, 3), (5, 2))
    assert joint.correlation_m == place.correlation_m
    assert joint.blur_m == place.blur_m > counts.blur_m
    assert np.array_equal(joint(JointMeasurement(first=sighting)), place(sighting))
    both = joint(JointMeasurement(sighting, (1.0,)))
    alone = joint(JointMeasurement(second=(1.0,)))
    assert np.allclose(both, 0.5 * (place(sighting) + alone))
    assert alone.min() >= place.correlation_m / 100.0 * counts((1.0,)).min()


def test_every_sensor_of_a_crowd_runs_on_every_backend() -> None:
    building, found = registered()
    place, heights = likelihood(building, found), [HeightMap.geometric(building.site_map, 30.0)]
    counts = CodeLikelihood(CodeMap.of(building.free_space, heights), CountNoise())
    sighting = Sighting((0, 3), (5, 2))
    sensors: list[tuple[Likelihood, object]] = [
        (place, sighting),
        (HolesAtPlace(place, heights), sighting),
        (JointLikelihood(place, counts), JointMeasurement(sighting, (1.0,))),
    ]
    for sensor, measured in sensors:
        asked = Mock(side_effect=NUMPY.told)
        weighed = sensor.run_by(NUMPY._replace(told=asked))(measured)
        asked.assert_called_once()
        assert np.array_equal(weighed, sensor.run_by(compiled() or NUMPY)(measured))


def test_blocks_cover_free_space_and_are_few_enough() -> None:
    free_space = Building.of(0).free_space
    blocks = CodeMap.blocks(free_space, BLOCK_M)
    assert blocks.sizes.sum() == free_space.free.sum()
    assert (blocks.sizes[1:] <= (BLOCK_M / free_space.grid.cell_m) ** 2).all()
    assert free_space.grid.flat_index(blocks.expected[1:]).min() >= 0


def test_walls_may_be_known_to_a_tolerance() -> None:
    free_space = Building.of(0).free_space
    assert np.array_equal(free_space.widened(0.0).free, free_space.free)
    wider = free_space.widened(1.0).free
    assert (wider | ~free_space.free).all()
    assert wider.sum() > free_space.free.sum()
    with pytest.raises(InvalidConfigurationError):
        free_space.widened(-1.0)
