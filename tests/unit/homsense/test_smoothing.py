"""A registered crowd, smoothed walk by walk within the walls."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.corridors import Building

from homsense import (
    PlaceLikelihood,
    Reading,
    RegisteredComplex,
    Sighting,
    WalkScan,
    extend,
    register_crowd,
    smooth,
)


@cache
def crowd(seed: int) -> tuple[Building, list[WalkScan], np.ndarray, RegisteredComplex]:
    building = Building.of(seed)
    pairs = list(building.crowd_with_truth(seed + 10, 40))
    scans = [scan for scan, _ in pairs]
    found = register_crowd(scans, building.free_space)
    truth = np.array([place for _, place in pairs])[found.source]
    return building, scans, truth, found


def error_m(found: RegisteredComplex, truth: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(found.xy - truth, axis=1)))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_smoothing_moves_scans_to_where_they_were_made(seed: int) -> None:
    building, scans, truth, found = crowd(seed)
    smoothed = smooth(found, scans, building.site_map, building.free_space)
    assert error_m(smoothed, truth) < 0.9 * error_m(found, truth)
    assert replace(smoothed, xy=found.xy) == found


def test_smoothing_depends_on_its_seed_alone() -> None:
    building, scans, _, found = crowd(0)
    once, again, other = (
        smooth(found, scans, building.site_map, building.free_space, seed) for seed in (3, 3, 4)
    )
    assert np.array_equal(once.xy, again.xy)
    assert not np.array_equal(once.xy, other.xy)


def test_a_walk_that_is_left_out_says_nothing() -> None:
    building, _, _, found = crowd(0)
    others = np.flatnonzero(found.walk != 5)
    smaller = found.of(found.walk != 5)
    smaller.__dict__["nats"] = found.nats
    apart = PlaceLikelihood(smaller, building.free_space)
    left_out = PlaceLikelihood(found, building.free_space).without(5)
    level = np.random.default_rng(1).integers(1, 11, found.size)
    for some in (np.arange(found.size), np.arange(0, found.size, 7), np.arange(0)):
        kept = np.flatnonzero(np.isin(others, some))
        sighting = Sighting(tuple(some.tolist()), tuple(level[some].tolist()))
        same = Sighting(tuple(kept.tolist()), tuple(level[others[kept]].tolist()))
        assert left_out(sighting) == pytest.approx(apart(same), abs=1e-9)


def test_a_walk_that_jumps_absurdly_is_smoothed_too() -> None:
    building, scans, _, found = crowd(0)
    gone = [scan if scan.t_s < 20.0 else replace(scan, x_m=scan.x_m + 1e9) for scan in scans]
    smoothed = smooth(found, gone, building.site_map, building.free_space)
    assert np.isfinite(smoothed.xy).all()


@pytest.mark.parametrize("enough", [1, 3, 10_000])
def test_a_crowd_is_thinned_only_where_it_is_dense(enough: int) -> None:
    _, _, _, found = crowd(0)
    thinner = found.thinned(enough)
    assert thinner.source.tolist() == thinner.thinned(enough).source.tolist()
    assert set(thinner.source.tolist()) <= set(found.source.tolist())
    kept = dict(zip(found.source.tolist(), found.xy.tolist(), strict=True))
    assert [kept[source] for source in thinner.source.tolist()] == thinner.xy.tolist()

    def squares(scans: RegisteredComplex) -> Counter[tuple[int, ...]]:
        return Counter(map(tuple, (scans.xy // scans.reach_m).astype(int).tolist()))

    before = squares(found)
    assert max(before.values()) > 10
    assert squares(thinner) == {at: min(count, enough) for at, count in before.items()}


@cache
def grown() -> tuple[list[WalkScan], np.ndarray, RegisteredComplex, RegisteredComplex]:
    """A crowd of 30 walks, and the same after ten more and a stranger have come."""
    building = Building.of(0)
    pairs = list(building.crowd_with_truth(10, 40))
    stranger = [
        WalkScan("stranger", t, 2.0 * t, 0.0, tuple(Reading(f"{t}-{n}", -60.0) for n in range(8)))
        for t in range(20)
    ]
    first, late = pairs[: 30 * len(pairs) // 40], pairs[30 * len(pairs) // 40 :]
    scans = [*(scan for scan, _ in (*first, *late)), *stranger]
    truth = np.array([place for _, place in pairs] + [np.full(2, np.nan)] * len(stranger))
    before = register_crowd(scans[: len(first)], building.free_space, rotation_sd_rad=0.1)
    after = extend(before, scans, building.site_map, building.free_space)
    return scans, truth, before, after


def test_new_walks_join_a_crowd_where_they_were_made() -> None:
    _, truth, before, after = grown()
    joined = after.source[before.size :]
    assert (joined > before.source.max()).sum() > 150
    apart = np.linalg.norm(after.xy[before.size :] - truth[joined], axis=1)
    assert np.median(apart) < error_m(before, truth[before.source]) + 1.0
    assert len(np.unique(after.walk)) > len(np.unique(before.walk))
    assert len(np.unique(after.source)) == after.size


def test_a_crowd_that_grows_stays_where_it_is() -> None:
    _, _, before, after = grown()
    assert after.registration is before.registration
    for array in ("walk", "xy", "source"):
        kept = getattr(after, array)[: before.size]
        assert np.array_equal(kept, getattr(before, array))
    assert after.signatures[: before.size] == before.signatures


def test_a_walk_that_resembles_nothing_does_not_join() -> None:
    scans, _, _, after = grown()
    assert "stranger" not in {scans[source].walk for source in after.source.tolist()}
