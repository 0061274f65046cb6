"""What a device measures on its way, and what the controls put in place of its counts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from homsense_fleet.device import OdometryNoise, drive

from homsense import Delta, Reading, Sighting
from homsense_cli.accuracy.crowd import heard
from homsense_cli.accuracy.scenario import STEP_M, STEP_S, Imu
from homsense_cli.accuracy.scene import CityScene, Scene


@dataclass(frozen=True, slots=True)
class Leg:
    """A step of a device.

    Parameters
    ----------
    truth : tuple of float
        Where it is after it, metres.
    delta : Delta
        Its own account of the motion.
    counts : tuple of float, optional
        Holes that its scan counts.
    sighting : Sighting, optional
        What its scan resembles among the crowd.
    elsewhere : Sighting, optional
        The same for a scan that somebody made elsewhere.
    is_covered : bool
        Whether the crowd has truly been there.
    """

    truth: tuple[float, float]
    delta: Delta
    counts: tuple[float, ...] | None
    sighting: Sighting | None = None
    elsewhere: Sighting | None = None
    is_covered: bool = True


def drive_through(city: CityScene, imu: Imu, run: int, length_m: float) -> list[Leg]:
    """Return what a robot measures on a random route.

    Parameters
    ----------
    city : CityScene
        Where.
    imu : Imu
        How well it knows its motion; it states these deviations itself.
    run : int
        Decides route and noise, together with the seed of the scenario.
    length_m : float
        Way to drive, metres.

    Returns
    -------
    list of Leg
        Steps of 5 m.
    """
    rng = np.random.default_rng([city.scenario.seed, 2, run])
    noise = OdometryNoise(imu.translation_m, imu.rotation_rad)
    std = (imu.translation_m, imu.translation_m, imu.rotation_rad)
    steps = drive(city.world, rng, length_m=length_m, step_m=STEP_M, noise=noise)
    seen: list[frozenset[str]] = []
    legs = []
    for step in steps:
        seen.append(frozenset(entry["id"] for entry in step.scan))
        forward, left, turn = (step.delta[axis] for axis in ("forward_m", "left_m", "turn_rad"))
        delta = Delta(forward, left, turn, dt_s=STEP_S, std=std)
        found = sightings(city.scene, heard(step.scan), rng)
        legs.append(Leg(step.truth[:2], delta, city.scene.counts(seen), *found))
    return legs


def sightings(
    scene: Scene, readings: Sequence[Reading], rng: np.random.Generator
) -> tuple[Sighting | None, Sighting | None]:
    """Return what a scan resembles among the crowd, and what a scan of any other place does.

    Parameters
    ----------
    scene : Scene
        Where.
    readings : sequence of Reading
        The scan.
    rng : numpy.random.Generator
        Chooses the other place.

    Returns
    -------
    tuple of Sighting or None
        None when the crowd has no place on the map, or too little was heard.
    """
    if scene.crowd is None:
        return None, None
    other = scene.crowd.scans[rng.integers(len(scene.crowd.scans))]
    found = scene.crowd.registered
    return found.sighting(readings), found.sighting(other.readings)


def true_counts(scene: Scene, legs: Sequence[Leg]) -> list[Leg]:
    """Return the legs with the counts that are expected where the device truly is.

    Parameters
    ----------
    scene : Scene
        What is expected where.
    legs : sequence of Leg
        What was measured.

    Returns
    -------
    list of Leg
        A measurement wherever there was one.
    """
    places = np.array([leg.truth for leg in legs])
    expected = np.array([height.at(places) for height in scene.expectation.heights])
    counts = np.maximum(np.nan_to_num(expected), 0.0).T.tolist()
    return [
        leg if leg.counts is None else replace(leg, counts=tuple(row))
        for leg, row in zip(legs, counts, strict=True)
    ]


def shuffled(legs: Sequence[Leg], seed: Sequence[int]) -> list[Leg]:
    """Return the legs with the same counts in another order.

    Parameters
    ----------
    legs : sequence of Leg
        What was measured.
    seed : sequence of int
        Decides the order.

    Returns
    -------
    list of Leg
        Each count was measured somewhere else on the way.
    """
    measured = [number for number, leg in enumerate(legs) if leg.counts is not None]
    others = np.random.default_rng(seed).permutation(measured).tolist()
    mixed = list(legs)
    for number, other in zip(measured, others, strict=True):
        mixed[number] = replace(legs[number], counts=legs[other].counts)
    return mixed
