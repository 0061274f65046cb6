"""The range self-check on worlds whose number of structures is known."""

import numpy as np
import pytest
from homsense_fleet.device import phone_scans
from homsense_fleet.world import Radio, downtown_44
from support.oracles import gudhi_rank

from homsense import InvalidInputError, LandmarkComplex, Reading, choose_cut, range_curve


@pytest.mark.parametrize(("seed", "transmitters"), [(1, 600), (2, 500)])
def test_the_chosen_cut_restores_buildings_that_a_long_range_filled(
    seed: int, transmitters: int
) -> None:
    world = downtown_44(seed, n_transmitters=transmitters, radio=Radio(s_max_m=120.0))
    scans = [
        [Reading(entry["id"], entry["rssi"]) for entry in scan["landmarks"]]
        for phone in range(30)
        for scan in phone_scans(world, str(phone), np.random.default_rng([seed, phone]), count=100)
    ]
    everything = LandmarkComplex.from_observations([r.landmark for r in scan] for scan in scans)
    assert everything.betti_numbers()[1] <= 5
    chosen = choose_cut(range_curve(scans))
    assert chosen is not None
    assert abs(chosen.stable - 44) <= 5


def test_stable_holes_are_the_rank_between_the_neighbor_cuts() -> None:
    world = downtown_44(3)
    rng = np.random.default_rng(1)
    scans = [
        [Reading(entry["id"], entry["rssi"]) for entry in scan["landmarks"]]
        for scan in phone_scans(world, "p", rng, count=60)
    ]
    cuts = [-70.0, -76.0, -82.0, -88.0]
    complexes = [
        LandmarkComplex.from_observations(
            [r.landmark for r in scan if r.rssi_dbm is not None and r.rssi_dbm >= cut]
            for scan in scans
        )
        for cut in cuts
    ]
    curve = range_curve(scans, cuts)
    for at in (1, 2):
        assert curve[at].betti == complexes[at].betti_numbers()
        assert curve[at].stable == gudhi_rank(complexes[at - 1].facets, complexes[at + 1].facets)


def test_cuts_must_fall_and_readings_without_strength_have_no_curve() -> None:
    with pytest.raises(InvalidInputError, match="fall"):
        range_curve([], [-60.0, -50.0])
    assert choose_cut([]) is None
    (point,) = range_curve([[Reading("a"), Reading("b")]])
    assert (point.landmarks, point.stable, point.alarm) == (2, 0, False)
