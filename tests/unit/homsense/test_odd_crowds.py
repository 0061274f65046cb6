"""Crowds as they also come: they are placed as far as they can be, or refused with a reason."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.corridors import Building

from homsense import (
    FreeSpace,
    InvalidInputError,
    Reading,
    WalkScan,
    rank_floors,
    register_crowd,
)
from homsense.registered.crowd import Crowd, likeness
from homsense.registered.layout import lay_out

FAR_M = 30_000.0
BUILDING = Building.of(3)


@cache
def crowd() -> list[WalkScan]:
    return BUILDING.crowd(1, walks=14)


def test_a_phone_that_leaves_by_taxi_is_placed_as_long_as_it_is_there() -> None:
    there = crowd()
    gone = [
        replace(scan, x_m=scan.x_m + FAR_M, readings=(Reading("at home", -50), *scan.readings[:2]))
        if scan.walk == "walk-003" and scan.t_s > 30.0
        else scan
        for scan in there
    ]
    left = {number for number, scan in enumerate(gone) if scan is not there[number]}
    assert len(left) > 3
    found = register_crowd(gone, BUILDING.free_space)
    assert not left & set(found.source.tolist())
    assert (
        set(found.source.tolist())
        == set(register_crowd(there, BUILDING.free_space).source.tolist()) - left
    )


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda scan: replace(scan, x_m=20.0 * scan.x_m, y_m=20.0 * scan.y_m), "in metres"),
        (lambda scan: replace(scan, x_m=1e3 * scan.x_m, y_m=1e3 * scan.y_m), "too short"),
        (lambda scan: replace(scan, x_m=1e-3 * scan.x_m, y_m=1e-3 * scan.y_m), "too short"),
        (lambda scan: replace(scan, x_m=7.0, y_m=7.0), "too short"),
    ],
)
def test_steps_that_are_no_metres_are_refused(
    change: Callable[[WalkScan], WalkScan], reason: str
) -> None:
    with pytest.raises(InvalidInputError, match=reason) as refused:
        register_crowd(map(change, crowd()), BUILDING.free_space)
    assert refused.value.field == "scans"


@pytest.mark.parametrize(
    "change",
    [
        lambda scan: replace(scan, x_m=1e3 * scan.x_m, y_m=1e3 * scan.y_m),
        lambda scan: replace(scan, x_m=scan.x_m - 1e5 * (scan.t_s > 20.0)),
        lambda scan: replace(scan, x_m=1e300 * scan.x_m),
    ],
    ids=["millimetres", "a new origin", "absurd"],
)
def test_one_phone_that_errs_does_not_spoil_the_crowd(
    change: Callable[[WalkScan], WalkScan],
) -> None:
    walks = list(BUILDING.crowd_with_truth(1, 24))
    others = [scan for scan, _ in walks if scan.walk != "walk-003"]
    found = register_crowd(
        [change(scan) if scan.walk == "walk-003" else scan for scan, _ in walks],
        BUILDING.free_space,
    )
    truth = np.array([walks[number][1] for number in found.source.tolist()])
    assert np.median(np.linalg.norm(found.xy - truth, axis=1)) < 4.0
    without = likeness(Crowd.of(others)).radio.reach_m
    assert found.reach_m == pytest.approx(without, rel=0.1)


def test_a_phone_that_begins_anew_under_the_same_name_walks_twice() -> None:
    walks = BUILDING.crowd(1, 24)
    renamed = [
        replace(scan, walk=f"phone-{number // 2:03d}", t_s=scan.t_s + 3600.0 * (number % 2))
        for scan in walks
        for number in [int(scan.walk.removeprefix("walk-"))]
    ]
    apart, together = (register_crowd(crowd, BUILDING.free_space) for crowd in (walks, renamed))
    assert np.array_equal(apart.source, together.source)
    assert np.array_equal(apart.xy, together.xy)


def test_scans_of_phones_that_stand_still_do_not_claim_to_be_at_one_point() -> None:
    crowd = Crowd.of(
        WalkScan(f"walk {walk}", 8.0 * place + pause, 10.0 * place, 0.0, tuple(
            Reading(f"{place} {number}", -50.0) for number in range(4)
        ))
        for walk in range(4)
        for place in range(8)
        for pause in (0, 4)
    )  # fmt: skip
    like = likeness(crowd)
    assert like.radio.rms_m[-1] == 1.0
    assert np.isfinite(lay_out(crowd, like).xy).all()


def test_a_phone_on_a_desk_counts_as_ten_scans() -> None:
    rng = np.random.default_rng(0)
    place = np.array([40.0, 40.0])
    desk = [
        WalkScan("desk", 5.0 * number, 0.01 * (number % 7), 0.0, BUILDING.readings(place, rng))
        for number in range(200)
    ]
    there = Crowd.of(crowd())
    both = Crowd.of([*desk, *crowd()])
    assert both.size == there.size + 10
    assert both.source[:10].tolist() == list(range(10))


def test_a_walk_without_end_is_laid_out_in_parts() -> None:
    readings = tuple(Reading(f"tx {number}", -50.0) for number in range(4))
    patrol = [WalkScan("robot", 5.0 * n, 4.0 * n, 0.0, readings) for n in range(2500)]
    found = Crowd.of([*patrol, WalkScan("x", 0.0, 0.0, 0.0, readings)])
    assert np.bincount(found.walk).tolist() == [1000, 1000, 500, 1]
    assert found.few(1300).size == 1500
    assert found.n_walks == 4


def test_a_floor_that_is_too_small_for_a_crowd_is_not_among_its_floors() -> None:
    own = BUILDING.free_space
    kiosk = FreeSpace(
        replace(own.grid, rows=4, columns=5), np.append(np.ones(20, np.bool_), False)
    )
    grounds = {"kiosk": kiosk, "own": own}
    (fit,) = rank_floors(crowd(), grounds)
    assert (fit.name, fit.probability) == ("own", 1.0)
    with pytest.raises(InvalidInputError, match="in metres"):
        rank_floors(crowd(), {"kiosk": kiosk})
