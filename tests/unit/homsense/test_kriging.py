"""What a crowd has counted where it was found corrects what is expected there, and around it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.builders import feature, local_map, square

from homsense import (
    Counted,
    Expectation,
    FreeSpace,
    HeightMap,
    LandmarkComplex,
    Profiles,
    RadioModel,
    SiteMap,
    expect,
    krige,
)
from homsense.grid import Grid
from homsense.radio import free_places, placement
from homsense.sight import in_view

SCALE_M, SIDE = 60.0, 100
ALIKE = np.array([[1.0, 0.6], [0.6, 1.0]])
PROFILES = np.array([[4.0, 8.0], [6.0, 12.0]])
"""As the expectation has them, so that counts are taken as they are."""


def plain(mean: float = 5.0, spread: float = 2.0) -> Expectation:
    """Expect the same everywhere on a square of 400 m, but for a corner where nobody can be."""
    grid = Grid(0.0, 0.0, 4.0, SIDE, SIDE)
    values = np.full((2, SIDE, SIDE), [[[mean]], [[2.0 * mean]]], np.float32)
    values[:, :5, :5] = np.nan
    heights = tuple(HeightMap(grid, level, None) for level in values)
    spreads = tuple(HeightMap(grid, level * 0.0 + spread, None) for level in values)
    correlation = tuple(map(tuple, ALIKE.tolist()))
    usual = (5.0, 1.0), (10.0, 2.0)
    return Expectation((1, 2), heights, spreads, usual, correlation, 2.0 * SCALE_M, 23, (1.0, 1.5))


def counted(seed: int, size: int, noise: float, west_m: float = 400.0) -> Counted:
    """Count on a site whose error is such a field, with noise; walks of ten scans."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform([30.0, 30.0], [west_m, 400.0], (size, 2))
    apart = np.linalg.norm(xy[:, None] - xy[None], axis=2)
    root = np.linalg.cholesky(np.exp(-apart / SCALE_M) + 1e-9 * np.eye(size))
    drawn = root @ rng.normal(size=(size, 2)) + noise * rng.normal(size=(size, 2))
    errors = drawn @ np.linalg.cholesky(ALIKE).T
    walks = [f"walk {number // 10}" for number in range(size)]
    return Counted(walks, xy, [5.0, 10.0] + 2.0 * errors)


def at(rasters: tuple[HeightMap, ...], xy: np.ndarray) -> np.ndarray:
    return np.stack([raster.at(xy) for raster in rasters], axis=1)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_is_counted_next_is_as_far_off_as_is_said(seed: int) -> None:
    scans = counted(seed, 900, 0.3)
    known, new = scans.some(np.arange(600)), scans.some(np.arange(600, 900))
    before, after = plain(), krige(plain(), known, PROFILES)
    off = new.holes - at(after.heights, new.xy)
    assert np.square(off).mean() < 0.5 * np.square(new.holes - at(before.heights, new.xy)).mean()
    scaled = off / at(after.spreads, new.xy)
    root = np.linalg.cholesky(np.array(after.correlation))
    assert 0.8 < np.square(scaled).mean() < 1.2
    assert 0.8 < np.square(scaled @ np.linalg.inv(root).T).mean() < 1.25


def test_far_from_the_crowd_nothing_becomes_surer() -> None:
    after = krige(plain(), counted(0, 200, 0.1, west_m=80.0), PROFILES)
    far = np.array([[390.0, 200.0], [395.0, 20.0]])
    assert at(after.heights, far) == pytest.approx(at(plain().heights, far), abs=0.1)
    assert (at(after.spreads, far) >= 1.99).all()
    near = np.array([[60.0, 200.0]])
    assert (at(after.spreads, near) < 1.2).all()


def test_nobody_can_be_where_nobody_could() -> None:
    after = krige(plain(), counted(0, 200, 0.1), PROFILES)
    for raster in (*after.heights, *after.spreads):
        assert np.isnan(raster.values[:5, :5]).all()
        assert np.isfinite(raster.values[5:, 5:]).all()


def test_the_order_of_scans_and_what_is_not_counted_do_not_matter() -> None:
    scans = counted(1, 300, 0.3)
    deaf = scans._replace(
        walk=[*scans.walk, "deaf", "lost"],
        xy=np.vstack([scans.xy, [[200.0, 200.0], [-1e6, 0.0]]]),
        holes=np.vstack([scans.holes, [[np.nan, np.nan], [5.0, 10.0]]]),
    )
    order = np.random.default_rng(0).permutation(302)
    once, again = krige(plain(), scans, PROFILES), krige(plain(), deaf.some(order), PROFILES)
    for one, other in zip(once.heights + once.spreads, again.heights + again.spreads, strict=True):
        assert np.allclose(one.values, other.values, atol=2e-4, equal_nan=True)


def test_a_crowd_that_stands_still_is_one_place() -> None:
    scans = counted(0, 100, 0.3)
    still = scans._replace(xy=np.full((100, 2), 200.0), holes=np.tile([9.0, 14.0], (100, 1)))
    after = krige(plain(), still, PROFILES)
    assert at(after.heights, still.xy[:1]) == pytest.approx(still.holes[:1], abs=0.3)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_walk_that_was_elsewhere_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scans = counted(seed, 600, 0.3)
    line = np.linspace([40.0, 60.0], [390.0, 350.0], 30)
    astray = Counted(
        [*scans.walk, *["astray"] * 30],
        np.vstack([scans.xy, line]),
        np.vstack([scans.holes, rng.normal([30.0, 60.0], size=(30, 2))]),
    )
    without, after = krige(plain(), scans, PROFILES), krige(plain(), astray, PROFILES)
    for one, other in zip(without.heights, after.heights, strict=True):
        assert np.allclose(one.values, other.values, atol=1e-3, equal_nan=True)
    assert after == replace(without, heights=after.heights, spreads=after.spreads)


@pytest.mark.parametrize(("size", "walks"), [(0, 1), (49, 5), (300, 1)])
def test_too_few_scans_or_walks_correct_nothing(size: int, walks: int) -> None:
    scans = counted(0, 300, 0.3).some(np.arange(size))
    few = scans._replace(walk=[f"walk {number % walks}" for number in range(size)])
    before = plain()
    assert krige(before, few, PROFILES) is before


@cache
def town() -> tuple[FreeSpace, RadioModel, Expectation]:
    blocks = (feature(square(70 * i, 70 * j, 45)) for i in range(4) for j in range(3))
    domain = feature(square(-20, -20, 300), role="domain")
    free = FreeSpace.of(SiteMap.from_geojson(local_map(*blocks, domain)), 2.0)
    radio = RadioModel(transmitters=90, range_m=55.0, dropout=0.05, evenness=10, scans=600)
    return free, radio, expect(free, radio, (1, 2, 3), worlds=8)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_town_counts_what_its_crowd_has_counted_there(seed: int) -> None:
    free, radio, before = town()
    rng = np.random.default_rng(seed)
    where = placement(free, rng, radio.transmitters, radio.evenness)
    xy = free_places(free, rng, 800)
    heard = radio.heard(in_view(free, where, xy, radio.range_m), rng).by_place(len(xy))
    seen = [frozenset(map(str, one.tolist())) for one in heard]
    crowd, new = seen[:600], seen[600:]
    grown = LandmarkComplex.from_observations(one for one in crowd if one)
    profiles = Profiles(grown, before.hops)
    table = profiles.table(sorted(grown.landmarks))
    walks = [f"walk {number // 20}" for number in range(600)]
    after = krige(before, Counted.of(walks, xy[:600], crowd, profiles), table)
    noise = before.noise(table)
    holes = Counted.of(walks[:200], xy[600:], new, profiles).holes
    holes = np.array(noise.offsets) + np.array(noise.gains) * holes
    off = [np.nanmean(np.square(holes - at(e.heights, xy[600:]))) for e in (before, after)]
    assert off[1] < 0.5 * off[0]
    assert after.correlation_m < 0.7 * before.correlation_m
    assert after.hops == before.hops
