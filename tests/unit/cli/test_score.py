"""Figures over runs are what they say."""

import math
from dataclasses import replace

import numpy as np
import pytest
from homsense_cli.accuracy.legs import Leg, shuffled
from homsense_cli.accuracy.run import Track
from homsense_cli.accuracy.score import by_walk, final_medians, score, sign_test

from homsense import Delta


def _track(errors: list[float], *, inside: bool = True) -> Track:
    count = len(errors)
    way = np.linspace(5.0, 5.0 * count, count)
    covered, told = np.full(count, True), np.full(count, False)
    return Track(np.array(errors), np.full((count, 3), inside), way, covered, told)


def test_a_run_is_scored_by_its_last_300_metres() -> None:
    lost_then_found = _track([400.0] * 240 + [10.0] * 60)
    found = score([lost_then_found])
    assert found.final_median_m == 10.0
    assert found.median_m == 400.0
    assert (found.within_15_m, found.within_25_m, found.within_50_m) == (1.0, 1.0, 1.0)
    assert found.converged_m == 241 * 5.0
    assert found.coverage_90 == 1.0


def test_a_short_run_is_scored_by_its_last_fifth() -> None:
    assert final_medians([_track([90.0] * 80 + [5.0] * 20)]).tolist() == [5.0]


def test_a_moment_below_the_bar_is_no_convergence() -> None:
    found = score([_track([400.0, 10.0, 400.0] * 100, inside=False)])
    assert found.converged_m is None
    assert found.coverage_50 == 0.0


def test_shares_and_quantiles_are_over_runs_and_steps() -> None:
    runs = [_track([error] * 300) for error in (5.0, 20.0, 40.0, 200.0)]
    found = score(runs)
    assert (found.within_15_m, found.within_25_m, found.within_50_m) == (0.25, 0.5, 0.75)
    assert found.final_median_m == 30.0
    assert found.p90_m == 200.0


def test_the_sign_test_counts_runs_that_are_better() -> None:
    better, worse = [_track([5.0] * 100)] * 5, [_track([50.0] * 100)] * 5
    assert sign_test(better, worse) == pytest.approx(0.5**5)
    assert sign_test(worse, better) == 1.0
    assert sign_test(better, better) == 1.0


def test_each_walk_counts_once_by_the_median_over_its_seeds() -> None:
    ours = [_track([error] * 50) for error in (2.0, 4.0, 90.0, 20.0, 20.0, 20.0)]
    walls = [_track([error] * 50) for error in (9.0, 9.0, 9.0, 10.0, 10.0, 10.0)]
    found = by_walk(ours, {"no homology": walls}, seeds=3)
    assert (found.walks, found.median_m, found.mean_m) == (2, 12.0, 12.0)
    assert (found.last_within_15_m, found.beats) == (1, {"no homology": 1})
    assert str(found) == "12.0 m 1 1"


def test_what_is_told_where_nobody_has_been() -> None:
    track = replace(
        _track([5.0] * 6),
        is_covered=np.array([True, False, False, True, True, True]),
        told_unmapped=np.array([True, True, False, False, False, False]),
    )
    found = score([track])
    assert (found.told_unmapped, found.wrongly_unmapped) == (0.5, 0.25)
    assert score([_track([5.0] * 4)]).told_unmapped is None


def test_shuffled_legs_have_the_same_counts_elsewhere() -> None:
    legs = [
        Leg((float(i), 0.0), Delta(5.0), None if i % 3 == 0 else (float(i),)) for i in range(60)
    ]
    mixed = shuffled(legs, [1, 2, 3])
    assert [leg.truth for leg in mixed] == [leg.truth for leg in legs]
    assert [leg.counts is None for leg in mixed] == [leg.counts is None for leg in legs]
    counts = [leg.counts for leg in legs if leg.counts]
    assert sorted(leg.counts for leg in mixed if leg.counts) == sorted(counts)
    assert sum(a.counts != b.counts for a, b in zip(legs, mixed, strict=True)) > 20
    assert not math.isclose(mixed[1].counts[0] if mixed[1].counts else -1.0, -1.0)
