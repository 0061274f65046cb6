"""The radio map of a registered crowd, and what a scan tells among it."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.corridors import Building

from homsense import (
    Hearing,
    InvalidInputError,
    PlaceLikelihood,
    RadioMapLikelihood,
    Reading,
    RegisteredComplex,
    Sighting,
    register_crowd,
)
from homsense.backend import NUMPY, compiled
from homsense.registered.radio_likelihood import SHARES, UNLEARNT_SHARE
from homsense.registered.radio_map import (
    CUT_SHARE,
    EVENNESS,
    LEAST_VARIANCE_DB2,
    NOBODY,
    WIDTH_SHARE,
    RadioMap,
)
from homsense.stages import cells_at


@cache
def crowded() -> tuple[Building, RegisteredComplex, RadioMapLikelihood]:
    building = Building.of(0)
    found = register_crowd(building.crowd(10, 40), building.free_space)
    return building, found, RadioMapLikelihood(found, building.free_space)


def gains(place: PlaceLikelihood, building: Building) -> list[float]:
    """Return how much scans of a new crowd tell about their places, bits."""
    share = place.code_map.sizes / place.code_map.sizes.sum()
    raster, told = place.code_map.free_space.grid.raster, []
    for scan, xy in list(building.crowd_with_truth(99, 4))[::3]:
        sighting = place.complex.sighting(scan.readings)
        if sighting is not None:
            bits = place(sighting)
            x_m, y_m = np.array([xy], np.float32).T
            (cell,) = cells_at(raster, x_m, y_m)
            told.append(bits[place.code_map.codes[cell]] - np.log2(share @ np.exp2(bits)))
    return told


def test_it_is_what_the_scans_near_a_block_hear() -> None:
    _, found, place = crowded()
    middles = place.code_map.expected[1:]
    radio = RadioMap.of(found, middles)
    names = list(found.index.column)
    height_db = np.full((found.size, len(names)), np.nan)
    for scan, signature in enumerate(found.signatures):
        for name, amount in signature.items():
            height_db[scan, names.index(name)] = round(amount ** (1.0 / found.hearing.exponent))
    hears = np.isfinite(height_db)
    apart = np.linalg.norm(middles[:, None] - found.xy, axis=2) / found.reach_m
    weight = np.where(apart <= CUT_SHARE, np.exp(-apart / WIDTH_SHARE), 0.0)
    loud, square = np.nan_to_num(height_db), np.nan_to_num(height_db) ** 2
    usual_db = loud.sum(axis=0) / hears.sum(axis=0)
    usual_db2 = np.maximum(
        square.sum(axis=0) / hears.sum(axis=0) - usual_db**2, LEAST_VARIANCE_DB2
    )
    n = weight @ hears
    mean_db = (weight @ loud + NOBODY * usual_db) / (n + NOBODY)
    mean_db2 = (weight @ square + NOBODY * (usual_db2 + usual_db**2)) / (n + NOBODY)
    variance = np.maximum(mean_db2 - mean_db**2, LEAST_VARIANCE_DB2)
    rate = (n + NOBODY * hears.mean()) / (weight.sum(axis=1) + NOBODY)[:, None]
    sighting = found.own_sighting(17)
    landmark, heard_db = np.array(sighting.landmark), np.array(sighting.height_db)
    nats = (
        np.log(rate[:, landmark])
        - 0.5
        * (np.log(variance) + (np.nan_to_num(height_db[17]) - mean_db) ** 2 / variance)[
            :, landmark
        ]
    )
    expected = nats.sum(axis=1) - (len(landmark) + EVENNESS) * np.log(rate.sum(axis=1) + EVENNESS)
    bits = radio.bits(sighting, NUMPY)
    near = radio.near > 1.0
    assert heard_db.min() >= 1
    assert np.ptp(bits[near]) > 50.0
    off = (bits - expected / math.log(2.0))[near]
    assert np.ptp(off) < 0.02


def test_it_tells_more_than_resemblance() -> None:
    building, found, place = crowded()
    ours, theirs = (
        gains(place, building),
        gains(PlaceLikelihood(found, building.free_space), building),
    )
    assert np.mean(ours) > np.mean(theirs)
    assert np.mean(ours) > 2.0
    assert place.information_bits == pytest.approx(np.mean(ours), abs=1.5)
    assert place.share in SHARES


def test_backends_give_the_same_bits() -> None:
    _, found, place = crowded()
    backend = compiled()
    assert backend is not None
    for scan in range(0, found.size, 97):
        sighting = found.own_sighting(scan)
        assert np.array_equal(place.run_by(NUMPY)(sighting), place.run_by(backend)(sighting))


@pytest.mark.parametrize("apart_m", [0.0, 9.0])
def test_of_two_placements_each_has_its_probability(apart_m: float) -> None:
    building, found, place = crowded()
    best, *_ = found.registration.placements
    shifted = found.xy + np.array([apart_m, 0.0])
    either = replace(
        found,
        registration=replace(found.registration, placements=(best, best)),
        rivals=(shifted,),
    )
    sighting = found.own_sighting(40)
    mixed, one, other = (
        RadioMapLikelihood(crowd, building.free_space, share=place.share)(sighting)[1:]
        for crowd in (either, found, replace(found, xy=shifted))
    )
    if apart_m:
        assert mixed[other.argmax()] > one[other.argmax()]
        assert mixed[one.argmax()] > other[one.argmax()]
    else:
        assert mixed == pytest.approx(one, abs=1e-9)


def test_a_scan_that_resembles_nothing_was_made_where_nobody_has_been() -> None:
    building, found, _ = crowded()
    half = found.of(found.xy[:, 0] < np.median(found.xy[:, 0]))
    place = RadioMapLikelihood(half, building.free_space)
    covered = place.covers(place.code_map.expected[1:])
    stranger = half.sighting([Reading(f"new-{number}", -50.0) for number in range(6)])
    assert stranger == Sighting((), ())
    known = half.own_sighting(17)
    bits = [np.exp2(place(sighting))[1:] for sighting in (stranger, known)]
    elsewhere = [float(of[~covered].mean() / of.mean()) for of in bits]
    assert elsewhere[0] > 1.0 > elsewhere[1]


def test_a_sighting_from_before_there_were_radio_maps_is_weighed_by_resemblance() -> None:
    building, found, place = crowded()
    now = found.own_sighting(17)
    then = Sighting(now.scan, now.level)
    by_resemblance = PlaceLikelihood(found, building.free_space)
    assert np.array_equal(place(then), by_resemblance(then))
    assert not np.array_equal(place(now), by_resemblance(now))


@pytest.mark.parametrize(
    "foreign",
    [
        Sighting((), (), (10**6,), (3,)),
        Sighting((), (), (-1,), (3,)),
        Sighting((), (), (0, 1), (3,)),
        Sighting((10**6,), (3,), (0,), (3,)),
        Sighting((0, 1), (3,), (0,), (3,)),
        Sighting((0,), (99,), (0,), (3,)),
    ],
)
def test_a_sighting_of_another_complex_is_refused(foreign: Sighting) -> None:
    _, _, place = crowded()
    with pytest.raises(InvalidInputError, match="of another complex"):
        place(foreign)


def test_a_walk_alone_teaches_nothing_and_a_share_that_is_given_is_not_learnt() -> None:
    building, found, _ = crowded()
    alone = found.of(found.walk == found.walk[0])
    place = RadioMapLikelihood(alone, building.free_space)
    assert (place.share, place.information_bits) == (UNLEARNT_SHARE, 0.0)
    assert place(alone.own_sighting(0)).max() == 0.0
    assert RadioMapLikelihood(found, building.free_space, share=0.25).share == 0.25


def test_the_binary_sensor_has_a_radio_map_without_heights() -> None:
    building = Building.of(0)
    hearing = Hearing(weakest_dbm=-70.0, exponent=0.0)
    found = register_crowd(building.crowd(10, 40), building.free_space, hearing=hearing)
    place = RadioMapLikelihood(found, building.free_space)
    assert set(found.own_sighting(3).height_db) == {1}
    assert np.mean(gains(place, building)) > 1.0
