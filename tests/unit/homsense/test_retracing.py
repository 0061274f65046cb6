"""A walk is known from the scans of it that have a place, and from its own motion."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.corridors import Building

from homsense import Hearing, RegisteredComplex, Retraced, WalkScan, register_crowd, retrace
from homsense.registered.matching import Placement
from homsense.registered.registration import Registration

SCANS, REACH_M = 12, 800.0
Places = list[complex]

metres = st.floats(-200.0, 200.0).map(lambda value: round(value, 3))
places = st.lists(st.builds(complex, metres, metres), min_size=SCANS, max_size=SCANS, unique=True)
chosen = st.sets(st.integers(0, SCANS - 1), min_size=2).map(sorted)


def walk(own: Places, name: str = "walk") -> list[WalkScan]:
    return [WalkScan(name, 20.0 * n, z.real, z.imag, ()) for n, z in enumerate(own)]


def complex_of(source: Sequence[int], where: Places) -> RegisteredComplex:
    xy = np.array([(z.real, z.imag) for z in where]).reshape(-1, 2)
    registration = Registration((Placement(0.0, 1.0, 0.0, 0.0, 1.0),), 1.0)
    walks = np.zeros(len(source), np.int64)
    nothing: tuple[dict[str, float], ...] = ({},) * len(source)
    return RegisteredComplex(
        Hearing(), walks, xy, nothing, REACH_M, registration, np.array(source, np.int64)
    )


@given(places, chosen, st.floats(-math.pi, math.pi), st.builds(complex, metres, metres))
def test_what_only_turns_and_shifts_is_retraced_exactly(
    own: Places, known: list[int], turn: float, shift: complex
) -> None:
    truth = [shift + complex(math.cos(turn), math.sin(turn)) * z for z in own]
    found = complex_of(known, [truth[number] for number in known])
    source, xy = retrace(found, walk(own))
    assert source.tolist() == list(range(SCANS))
    apart = np.abs(xy @ [1.0, 1.0j] - truth)
    length = min(abs(a - b) for a in own for b in own if a != b)
    assert apart.max() <= 1e-7 * (1.0 + 400.0 / length)
    assert np.array_equal(xy[known], found.xy)


@given(places, places, chosen, st.randoms(use_true_random=False))
def test_the_order_in_which_scans_come_does_not_matter(
    own: Places, there: Places, known: list[int], rng: object
) -> None:
    order = list(range(SCANS))
    rng.shuffle(order)  # type: ignore[attr-defined]
    scans = walk(own)
    _, xy = retrace(complex_of(known, [there[number] for number in known]), scans)
    rank = [order.index(number) for number in known]
    mixed = complex_of(rank, [there[number] for number in known])
    source, again = retrace(mixed, [scans[number] for number in order])
    assert [order[number] for number in source] == list(range(SCANS))
    assert np.allclose(again, xy, atol=1e-9)


@given(places, places, chosen, st.permutations(range(2 * SCANS)))
def test_the_order_in_which_walks_come_does_not_matter(
    own: Places, there: Places, known: list[int], order: list[int]
) -> None:
    scans = [*walk(own, "bob"), *walk(own[::-1], "ann")]
    place = dict(zip([*known, *(SCANS + n for n in known)], [*there, *there], strict=False))
    found = retrace(complex_of(list(place), list(place.values())), scans)
    mixed = complex_of([order.index(number) for number in place], list(place.values()))
    again = retrace(mixed, [scans[number] for number in order])
    assert [order[number] for number in again.source] == found.source.tolist()
    assert np.array_equal(again.xy, found.xy)


def test_drift_changes_linearly_between_places_that_are_known() -> None:
    own = [complex(10.0 * number) for number in range(5)]
    found = complex_of([0, 4], [0.0 + 0.0j, 48.0 + 0.0j])
    assert retrace(found, walk(own)).xy[:, 0].tolist() == [0.0, 12.0, 24.0, 36.0, 48.0]


@pytest.mark.parametrize("known", [[], [1]])
def test_a_walk_that_is_hardly_known_is_left_out(known: list[int]) -> None:
    scans = [*walk([0j, 1 + 0j, 2 + 0j], "hardly"), *walk([0j, 4 + 0j, 8 + 0j], "well")]
    found = complex_of([*known, 3, 5], [*(7j for _ in known), 1 + 0j, 9 + 0j])
    source, xy = retrace(found, scans)
    assert source.tolist() == [3, 4, 5]
    assert xy.tolist() == [[1.0, 0.0], [5.0, 0.0], [9.0, 0.0]]


def test_scans_that_hear_nothing_are_retraced_as_well_as_the_others_are_placed() -> None:
    building = Building.of(0)
    pairs = list(building.crowd_with_truth(10, 40))
    deaf = np.random.default_rng(0).random(len(pairs)) < 0.15
    scans = [
        WalkScan(scan.walk, scan.t_s, scan.x_m, scan.y_m, () if is_deaf else scan.readings)
        for (scan, _), is_deaf in zip(pairs, deaf, strict=True)
    ]
    found = register_crowd(scans, building.free_space)
    source, xy = retrace(found, scans)
    apart = np.linalg.norm(xy - np.array([place for _, place in pairs])[source], axis=1)
    placed = np.isin(source, found.source)
    assert not placed[deaf[source]].any()
    assert deaf[source].sum() > 0.9 * deaf.sum()
    assert np.median(apart[~placed]) < np.median(apart[placed]) + 0.5


@pytest.mark.parametrize(("size", "most"), [(0, 5), (5, 5), (17, 5), (5200, 1500), (1501, 1500)])
def test_some_scans_are_chosen_from_everywhere_and_three_in_a_row(size: int, most: int) -> None:
    chosen = Retraced(np.arange(size), np.zeros((size, 2))).stretches(most)
    assert min(size, most // 2) <= len(chosen) <= most
    assert len(set(chosen.tolist())) == len(chosen)
    if len(chosen) > 100:
        assert chosen[-1] > 0.9 * size
        assert (np.diff(chosen) == 1).mean() > 0.6


def test_neither_what_repeats_itself_nor_what_is_far_away_is_retraced() -> None:
    own: Places = [complex(10.0 * n, 0.0) for n in range(4)]
    crowd = walk([*own, *[own[-1]] * 30, own[-1] + 850.0])
    found = complex_of([0, 3], [own[0], own[3]])
    assert retrace(found, crowd).source.tolist() == list(range(13))
