"""Transmitters that move in a simulated town, and those that do not."""

from dataclasses import replace

import numpy as np
import pytest
from homsense_fleet.device import phone_scans
from homsense_fleet.world import World, downtown_44

from homsense import Displaced, LandmarkComplex, displaced


def _crowd(world: World, seed: int) -> list[frozenset[str]]:
    return [
        frozenset(entry["id"] for entry in scan["landmarks"])
        for phone in range(40)
        for scan in phone_scans(world, str(phone), np.random.default_rng([seed, phone]), count=130)
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_hardly_anybody_is_accused_in_a_well_mapped_town(seed: int) -> None:
    crowd = _crowd(downtown_44(seed), seed)
    assert len(displaced(LandmarkComplex.from_observations(crowd))) <= 2


def test_those_that_move_at_the_same_time_do_not_hide_each_other() -> None:
    """Twenty of them: the false short-cuts of the others make the way between its places short."""
    before = downtown_44(1)
    rng = np.random.default_rng(4)
    moved = rng.choice(len(before.ids), 20, replace=False)
    places = before.transmitters.copy()
    places[moved] = places[np.roll(moved, 1)]
    far = np.hypot(*(places - before.transmitters).T) > 200.0
    crowds = (_crowd(world, 1) for world in (before, replace(before, transmitters=places)))
    mixed = [pair[number % 2] for number, pair in enumerate(zip(*crowds, strict=True))]
    found = {one.landmark for one in displaced(LandmarkComplex.from_observations(mixed))}
    guilty = {before.ids[number] for number in np.flatnonzero(far)}
    assert len(found & guilty) >= 0.5 * len(guilty) > 5
    assert len(found - guilty) <= 2


@pytest.mark.parametrize("companions", [0, 3])
def test_a_transmitter_that_moves_across_the_town_is_found(companions: int) -> None:
    """With the other identifiers of the same box, which move with it."""
    world = downtown_44(1)
    crowd = _crowd(world, 1)
    heard = LandmarkComplex.from_observations(crowd)
    west, east = (world.transmitters[:, 0] < limit for limit in (200.0, 650.0))
    box, there = (
        max(
            (name for name, inside in zip(world.ids, side, strict=True) if inside),
            key=lambda name: sum(name in facet for facet in heard.facets),
        )
        for side in (west, ~east)
    )
    boxes = {box, *(f"{box}-{n}" for n in range(companions))}
    moved = [
        scan - {box} | (boxes if (there if number % 2 else box) in scan else set())
        for number, scan in enumerate(crowd)
    ]
    found = displaced(LandmarkComplex.from_observations(moved))
    assert {one.landmark for one in found} == boxes
    assert all(one.hops_apart is not None and one.hops_apart >= 4 for one in found)


def test_two_places_that_nothing_else_joins_are_told_apart() -> None:
    town = [{f"{name}{n}", f"{name}{n + 1}"} for name in "ab" for n in range(8)]
    bus = [{"bus", f"{name}{n}", f"{name}{n + 1}"} for name in "ab" for n in (2, 3, 4)]
    k = LandmarkComplex.from_observations([*town, *bus])
    beside = [tuple(f"{name}{n}" for n in range(2, 6)) for name in "ab"]
    assert displaced(k, ["bus", "a1", "stranger"]) == [
        Displaced("bus", None, beside[0], beside[1])
    ]
    assert not displaced(k, ["bus"], support=4)
