"""What a site learns from its scans alone, and what it expects its sensor to count."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from scipy.stats import multivariate_t
from support.builders import SITE_MAP, feature, local_map, square

from homsense import (
    CodeMap,
    Expectation,
    FieldNoise,
    FreeSpace,
    InvalidConfigurationError,
    InvalidInputError,
    LandmarkComplex,
    Profiles,
    RadioModel,
    SiteMap,
    estimate_radio,
    expect,
    sense_local_homology,
)
from homsense.likelihood import CodeLikelihood
from homsense.radio import crowd_places, free_places, placement
from homsense.sight import in_view
from homsense.simulation import Stage, World, simulate

TOWN = SiteMap.from_geojson(
    local_map(
        *(feature(square(70 * i, 70 * j, 45)) for i in range(4) for j in range(3)),
        feature(square(-20, -20, 300), role="domain"),
    )
)
FREE = FreeSpace.of(TOWN, 2.0)
RADIO = RadioModel(transmitters=90, range_m=55.0, dropout=0.05, evenness=10, scans=600)
WORLDS = 8


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@cache
def _expected() -> Expectation:
    return expect(FREE, RADIO, (1, 2, 3, 4), worlds=WORLDS)


def _crowd(radio: RadioModel, seed: int, count: int) -> list[frozenset[str]]:
    rng = _rng(seed)
    where = placement(FREE, rng, radio.transmitters, radio.evenness)
    seen = radio.heard(in_view(FREE, where, free_places(FREE, rng, count), radio.range_m), rng)
    return [frozenset(map(str, heard.tolist())) for heard in seen.by_place(count)]


def test_a_line_of_sight_is_free_of_walls_within_the_range() -> None:
    """Against shapely, but for lines that come within a cell of a wall."""
    rng = _rng(1)
    here, there = free_places(FREE, rng, 60), free_places(FREE, rng, 50)
    seen = in_view(FREE, there, here, 80.0)
    found = set(zip(seen.place.tolist(), seen.transmitter.tolist(), strict=True))
    walls = shapely.MultiPolygon(list(TOWN.structures))
    inner, outer = walls.buffer(-3.0), walls.buffer(3.0)
    for i, a in enumerate(here):
        for j, b in enumerate(there):
            line = shapely.LineString([a, b])
            if line.length > 80.0 or shapely.intersects(line, inner):
                assert (i, j) not in found
            elif not shapely.intersects(line, outer):
                assert (i, j) in found
    assert seen.distance_m.max() <= 80.0
    assert len(found) > 100


def test_transmitters_are_placed_in_free_space_and_as_evenly_as_asked() -> None:
    nearest = []
    for evenness in (1, 30):
        places = placement(FREE, _rng(2), 80, evenness)
        assert places.shape == (80, 2)
        assert FREE.contains(places).all()
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.diag([np.inf] * 80)
        nearest.append(np.median(apart.min(axis=1)))
    assert nearest[1] > 1.5 * nearest[0]


def test_each_transmitter_is_the_candidate_farthest_from_all_before_it() -> None:
    count, evenness = 1200, 3
    tried = free_places(FREE, _rng(2), count * evenness).reshape(count, evenness, 2)
    expected = [tried[0, 0]]
    for candidates in tried[1:]:
        apart = np.square(candidates[:, None] - np.array(expected)).sum(axis=2).min(axis=1)
        expected.append(candidates[apart.argmax()])
    assert np.array_equal(placement(FREE, _rng(2), count, evenness), expected)


@pytest.mark.parametrize(
    "truth",
    [
        RadioModel(transmitters=90, range_m=55.0, dropout=0.05, evenness=40),
        RadioModel(transmitters=120, range_m=45.0, dropout=0.3, evenness=1),
        RadioModel(transmitters=60, range_m=80.0, dropout=0.0, evenness=10),
    ],
    ids=str,
)
def test_range_and_dropout_are_learnt_without_a_position(truth: RadioModel) -> None:
    found = estimate_radio(FREE, _crowd(truth, 3, 1200))
    assert found.transmitters <= truth.transmitters
    assert found.range_m == pytest.approx(truth.range_m, rel=0.15)
    assert found.dropout == pytest.approx(truth.dropout, abs=0.11)


def test_a_crowd_walks_where_it_is_known_to_have_walked() -> None:
    walked = np.concatenate([free_places(FREE, _rng(1), 30), [[22.0, 22.0], [-900.0, 0.0]]])
    drawn = crowd_places(FREE, _rng(2), 75, walked)
    assert FREE.contains(drawn).all()
    places, times = np.unique(drawn, axis=0, return_counts=True)
    assert len(places) == 30
    assert {*times} == {2, 3}
    for unknown in (None, walked[30:]):
        anywhere = crowd_places(FREE, _rng(2), 75, unknown)
        np.testing.assert_array_equal(anywhere, free_places(FREE, _rng(2), 75))


def test_a_crowd_that_keeps_to_a_few_lanes_tells_the_range_by_where_it_walks() -> None:
    """Who walks in the lanes between buildings hears less than one who may be anywhere."""
    everywhere = free_places(FREE, _rng(3), 20_000)
    west_of_blocks = (everywhere[:, 0] + 25.0) % 70.0 < 25.0
    south_of_blocks = (everywhere[:, 1] + 25.0) % 70.0 < 25.0
    walked = everywhere[west_of_blocks ^ south_of_blocks][:1200]
    errors = []
    for seed in range(3):
        rng = _rng(seed)
        where = placement(FREE, rng, RADIO.transmitters, RADIO.evenness)
        seen = RADIO.heard(in_view(FREE, where, walked, RADIO.range_m), rng)
        crowd = [frozenset(map(str, heard.tolist())) for heard in seen.by_place(len(walked))]
        found = [estimate_radio(FREE, crowd, walked=known, seed=seed) for known in (None, walked)]
        errors.append([abs(radio.range_m - RADIO.range_m) for radio in found])
    blind, knowing = np.mean(errors, axis=0)
    assert knowing < 2.5
    assert knowing < 0.5 * blind


def test_a_crowd_that_has_walked_in_one_part_finds_the_holes_of_that_part() -> None:
    everywhere, there = free_places(FREE, _rng(4), 4000), np.array([[55.0, 55.0], [125.0, 55.0]])
    walked = everywhere[everywhere[:, 0] < 60.0]
    found = expect(FREE, RADIO, (1, 2, 3), worlds=4, walked=walked)
    holes, usual = (height.at(there) for height in (found.heights[2], _expected().heights[2]))
    assert (holes > 1.0).all()
    assert (holes < 0.5 * usual).all()


def test_nothing_is_learnt_from_no_scans() -> None:
    with pytest.raises(InvalidInputError) as caught:
        estimate_radio(FREE, [frozenset()])
    assert caught.value.field == "observations"


@pytest.mark.parametrize(
    ("name", "value"),
    [("transmitters", 0), ("range_m", 0.0), ("range_m", np.nan), ("dropout", 1.0), ("scans", 0)],
)
def test_a_radio_model_out_of_range_is_refused(name: str, value: float) -> None:
    good = {"transmitters": 5, "range_m": 10.0}
    with pytest.raises(InvalidInputError) as caught:
        RadioModel(**{**good, name: value})  # type: ignore[arg-type]
    assert caught.value.field == name


def test_every_free_cell_has_a_place_that_speaks_for_it() -> None:
    stage = Stage.of(FREE)
    centers = FREE.grid.centers()[FREE.free[:-1]]
    known = stage.raster(np.arange(len(stage.places), dtype=np.float64)).at(centers)
    assert not np.isnan(known).any()
    assert FREE.contains(stage.places).all()


def test_the_same_seed_simulates_the_same_worlds() -> None:
    stage = Stage.of(FREE)
    once, again = (list(simulate(stage, RADIO, (1, 2), worlds=2, seed=5)) for _ in range(2))
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one.holes, other.holes)
    assert not np.array_equal(once[0].holes, once[1].holes, equal_nan=True)


def test_a_site_measures_as_it_is_expected_to_whatever_its_gain_and_offset() -> None:
    expected = _expected()
    usual = np.array(expected.usual)
    profiles = _rng(4).normal(usual[:, 0], usual[:, 1], (5000, len(usual)))
    noise = expected.noise(profiles * 1.7 + 3.0)
    measured = np.array(noise.offsets) + np.array(noise.gains) * (profiles * 1.7 + 3.0)
    np.testing.assert_allclose(measured.mean(axis=0), usual[:, 0], atol=2e-3)
    np.testing.assert_allclose(measured.std(axis=0), usual[:, 1], atol=2e-3)
    assert expected.noise().gains == (1.0,) * 4


def test_what_is_expected_explains_a_world_that_it_has_not_seen() -> None:
    """Standardized errors of a fresh world have about unit power, and counts tell places apart."""
    expected, stage = _expected(), Stage.of(FREE)
    (world,) = simulate(stage, RADIO, expected.hops, worlds=1, seed=99)
    noise = expected.noise(world.profiles)
    measured = np.array(noise.offsets) + np.array(noise.gains) * world.holes
    mean = np.array([height.at(stage.places) for height in expected.heights]).T
    spread = np.array([height.at(stage.places) for height in expected.spreads]).T
    power = np.nanmean(np.square((measured - mean) / spread))
    assert 0.1 < power < 2.0
    heard = ~np.isnan(measured[:, 2])
    assert np.corrcoef(measured[heard, 2], mean[heard, 2])[0, 1] > 0.8
    assert expected.information_bits[-1] > expected.information_bits[0]
    assert 10.0 < expected.correlation_m < 400.0


def test_a_narrowed_expectation_is_of_some_neighborhoods_alone() -> None:
    expected = _expected()
    two = expected.narrowed((2, 3))
    assert two.heights == expected.heights[1:3]
    assert two.correlation[0][1] == expected.correlation[1][2]
    assert expected.best_hops == expected.hops[: len(expected.best_hops)]
    assert expected.narrowed((1, 2)).information_bits == expected.information_bits[:2]


def test_worlds_in_which_nothing_is_heard_are_refused() -> None:
    stage, deaf = Stage.of(FREE), replace(RADIO, range_m=0.01)
    worlds = list(simulate(stage, deaf, (1,), worlds=3))
    with pytest.raises(InvalidInputError, match="nothing is heard"):
        Expectation.of(stage, (1,), worlds)


def test_worlds_in_which_nothing_is_heard_from_any_place_tell_nothing() -> None:
    stage = Stage.of(FREE)
    unheard = np.full((len(stage.places), 1), np.nan)
    expected = Expectation.of(stage, (1,), [World(unheard, np.ones((2, 1)))] * 3)
    assert expected.information_bits == (0.0,)
    assert expected.heights[0].at(stage.places).tolist() == [1.0] * len(stage.places)


def test_too_few_worlds_are_refused() -> None:
    stage = Stage.of(FREE)
    worlds = list(simulate(stage, RADIO, (1,), worlds=2))
    with pytest.raises(InvalidInputError, match="three worlds"):
        Expectation.of(stage, (1,), worlds)


def test_the_likelihood_is_students_t() -> None:
    rng = _rng(6)
    root = rng.normal(size=(3, 3))
    covariance = root @ root.T + np.eye(3)
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    noise = FieldNoise(
        tuple(map(tuple, correlation.tolist())), (1.0, 2.0, 1.0), (0.0, 1.0, 0.0), 12.0, 80.0
    )
    mean, spread = rng.uniform(0, 10, (40, 3)), rng.uniform(0.6, 3.0, (40, 3))
    counts = [3.0, 2.0, 7.5]
    measured = np.array([3.0, 5.0, 7.5])
    due = [
        multivariate_t(m, correlation * np.outer(s, s), df=12).logpdf(measured)
        for m, s in zip(mean, spread, strict=True)
    ]
    found = noise.weigher(np.concatenate([mean, spread], axis=1))(counts) * np.log(2.0)
    np.testing.assert_allclose(found - found[0], np.array(due) - due[0], atol=1e-9)
    assert found.max() <= 0.0


def test_a_place_where_nobody_can_be_explains_nothing() -> None:
    expected = _expected()
    code_map = CodeMap.of(FREE, (*expected.heights, *expected.spreads))
    bits = CodeLikelihood(code_map, expected.noise())([0.2, 1.0, 3.5, 6.0])
    assert bits[0] == -1000.0
    assert bits[1:].min() > -200.0
    with pytest.raises(InvalidInputError, match="4 counts"):
        CodeLikelihood(code_map, expected.noise())([1.0, 2.0])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"freedom": 0.0}, "freedom"),
        ({"correlation_m": -1.0}, "correlation_m"),
        ({"gains": (1.0,)}, "correlation"),
        ({"correlation": ((1.0, 1.0), (1.0, 1.0))}, "correlation"),
    ],
    ids=str,
)
def test_an_error_model_out_of_range_is_refused(change: dict[str, object], field: str) -> None:
    good = {
        "correlation": ((1.0, 0.2), (0.2, 1.0)),
        "gains": (1.0, 1.0),
        "offsets": (0.0, 0.0),
        "freedom": 9.0,
        "correlation_m": 50.0,
    }
    with pytest.raises(InvalidConfigurationError) as caught:
        FieldNoise(**{**good, **change})  # type: ignore[arg-type]
    assert caught.value.field == field


def test_profiles_of_a_growing_complex_are_those_of_a_fresh_one() -> None:
    crowd = [seen for seen in _crowd(RADIO, 7, 300) if seen]
    kept = Profiles(LandmarkComplex.from_observations(crowd[:50]), (1, 2))
    grown = LandmarkComplex.from_observations(crowd[:50])
    for end in (100, 200, 300):
        grown = grown.with_observations(crowd[end - 100 : end])
        kept = kept.onward(grown)
        fresh = Profiles(LandmarkComplex.from_observations(grown.facets), (1, 2))
        for seen in crowd[:end:23]:
            assert kept.mean_holes(seen) == fresh.mean_holes(seen)


def test_a_scan_measures_the_mean_over_its_landmarks() -> None:
    crowd = [seen for seen in _crowd(RADIO, 8, 200) if seen]
    grown = LandmarkComplex.from_observations(crowd)
    profiles = Profiles(grown, (1, 2, 3))
    seen = max(crowd, key=len)
    due = np.mean(
        [
            [level.holes for level in sense_local_homology(grown, [name], (1, 2, 3))]
            for name in seen
        ],
        axis=0,
    )
    found = profiles.mean_holes(seen | {"nobody knows me"})
    assert found is not None
    np.testing.assert_allclose(found, due)
    assert profiles.mean_holes({"nobody knows me"}) is None
    left_out = Profiles(grown, (1,), frozenset(seen))
    assert left_out.mean_holes(seen) is None
    assert np.isnan(left_out.table(sorted(seen))).all()
    assert len(profiles.sampled(10)) <= 10


@pytest.mark.parametrize("seed", range(12))
def test_a_single_scan_of_one_landmark_is_enough_to_learn_something(seed: int) -> None:
    space = FreeSpace.of(SiteMap.from_geojson(SITE_MAP), 2.0)
    radio = estimate_radio(space, [frozenset({"a"})], seed=seed)
    assert radio.range_m > 0.0
