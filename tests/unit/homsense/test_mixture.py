"""A crowd that may lie in two ways is believed to lie in both until the data decide."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from support.corridors import TURNED_ALIKE, Building

from homsense import (
    Delta,
    HeadingPrior,
    Localizer,
    LocalizerConfig,
    LocalizerState,
    PlaceLikelihood,
    RegisteredComplex,
    UniformPrior,
    WalkScan,
    extend,
    register_crowd,
    smooth,
)

MIDDLE = np.array([60.0, 40.0])
WALKS = 30


@cache
def ambiguous() -> tuple[Building, list[WalkScan], np.ndarray, RegisteredComplex]:
    """A building that half a turn leaves as it is, a crowd without compass, its true places."""
    building = Building.of(0, corridors=TURNED_ALIKE)
    made = list(building.crowd_with_truth(10, WALKS))
    crowd = [scan for scan, _ in made]
    found = register_crowd(crowd, building.free_space)
    return building, crowd, np.array([made[n][1] for n in found.source]), found


def test_both_placements_are_kept_with_their_probabilities() -> None:
    _, _, truth, found = ambiguous()
    (rival,) = found.rivals
    assert found.registration.is_doubtful
    assert found.registration.n_plausible == 2
    assert found.registration.probabilities.sum() == pytest.approx(1.0)
    assert found.registration.probabilities[:2] == pytest.approx([0.5, 0.5], abs=0.1)
    assert np.median(np.linalg.norm(found.xy + rival - 2.0 * MIDDLE, axis=1)) < 3.0
    errors = [np.median(np.linalg.norm(one.xy - truth, axis=1)) for one in found.placed]
    assert min(errors) < 3.0
    assert max(errors) > 40.0
    some = np.arange(found.size) % 3 == 0
    assert np.array_equal(found.of(some).rivals[0], rival[some])
    assert len(found.placed[1].placed) == 1


def test_a_scan_is_likely_made_at_either_place_and_no_other() -> None:
    building, _, _, found = ambiguous()
    weigh = PlaceLikelihood(found, building.free_space)
    alone = [PlaceLikelihood(one, building.free_space) for one in found.placed]
    shares = found.registration.probabilities
    for place in ((20.0, 5.0), (100.0, 75.0)):
        readings = building.readings(np.array(place), np.random.default_rng(1))
        sighting = found.sighting(readings)
        assert sighting is not None
        mixed = np.exp2(weigh(sighting)[1:])
        parts = [np.exp2(one(sighting)[1:]) for one in alone]
        assert mixed[[int(part.argmax()) for part in parts]].min() > 0.4
        for part in parts:
            assert (mixed > 0.3 * shares.min() * part - 1e-12).all()
    everywhere = building.free_space.grid.centers()
    assert np.array_equal(
        weigh.covers(everywhere), alone[0].covers(everywhere) | alone[1].covers(everywhere)
    )


def test_what_one_walk_has_heard_can_be_left_out_of_both() -> None:
    building, _, _, found = ambiguous()
    weigh = PlaceLikelihood(found, building.free_space)
    without = weigh.without(0)
    first = found.own_sighting(0)
    assert without(first).max() == 0.0
    assert not np.allclose(without(first), weigh(first))
    assert without.complex is found


def _driven(prior: UniformPrior, seed: int) -> tuple[LocalizerState, np.ndarray]:
    """Return where a device is believed to be after a walk, and the truth."""
    building, _, _, found = ambiguous()
    weigh = PlaceLikelihood(found, building.free_space)
    config = LocalizerConfig(particles=6000, prior=prior)
    localizer = Localizer(
        building.site_map, [], config, free_space=building.free_space, likelihood=weigh
    )
    places = np.array([(10.0 + 2.0 * step, 5.0) for step in range(20)])
    rng = np.random.default_rng(seed)
    state = localizer.start(seed)
    for here, there in pairwise(places):
        delta = Delta(float(np.linalg.norm(there - here)), std=(0.3, 0.3, 0.05))
        state, _ = localizer.step(state, delta, found.sighting(building.readings(there, rng)))
    return state, places[-1]


def _share(state: LocalizerState, place: np.ndarray) -> float:
    near = np.linalg.norm(state.poses[:, :2] - place, axis=1) < 12.0
    weights = np.exp2(state.particles.log_weight / 2048.0)
    return float(weights[near].sum() / weights.sum())


def test_without_a_compass_both_places_stay() -> None:
    state, truth = _driven(UniformPrior(), 1)
    assert _share(state, truth) > 0.2
    assert _share(state, 2.0 * MIDDLE - truth) > 0.2
    assert _share(state, truth) + _share(state, 2.0 * MIDDLE - truth) > 0.9


def test_a_compass_decides() -> None:
    state, truth = _driven(UniformPrior(HeadingPrior(0.0, 0.2)), 2)
    assert _share(state, truth) > 0.9
    state, truth = _driven(UniformPrior(HeadingPrior(math.pi, 0.2)), 3)
    assert _share(state, 2.0 * MIDDLE - truth) > 0.9


def test_both_are_smoothed_and_newcomers_join_the_best() -> None:
    building, crowd, truth, found = ambiguous()
    smoothed = smooth(found, crowd, building.site_map, building.free_space)
    errors = [np.median(np.linalg.norm(one.xy - truth, axis=1)) for one in smoothed.placed]
    assert min(errors) < 3.0
    assert max(errors) > 40.0
    newcomers = [replace(scan, walk=f"new {scan.walk}") for scan in building.crowd(99, 2)]
    grown, alone = (
        extend(one, [*crowd, *newcomers], building.site_map, building.free_space)
        for one in (smoothed, smoothed.placed[0])
    )
    assert grown.rivals == ()
    assert grown.size > smoothed.size
    assert np.array_equal(grown.xy, alone.xy)
    assert np.array_equal(grown.xy[: smoothed.size], smoothed.xy)
