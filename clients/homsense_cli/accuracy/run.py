"""One device, localized from nothing: with each sensor, and with each control."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense import (
    HeightMap,
    HolesAtPlace,
    JointLikelihood,
    JointMeasurement,
    Likelihood,
    Localizer,
    LocalizerConfig,
    PoseDistribution,
    Prior,
    Relocation,
    UniformPrior,
)
from homsense.likelihood import CodeLikelihood
from homsense.registered.complex import EVEN_ODDS
from homsense.registered.place import LOST
from homsense_cli.accuracy.legs import Leg, drive_through, shuffled, true_counts
from homsense_cli.accuracy.scenario import Imu
from homsense_cli.accuracy.scene import CityScene, Scene

FloatArray = NDArray[np.float64]
Control = Literal[
    "homology",
    "no homology",
    "shuffled",
    "true counts",
    "registered",
    "elsewhere",
    "both",
    "holes at place",
]

WEAKER: dict[Control, tuple[Control, ...]] = {
    "homology": ("no homology", "shuffled"),
    "registered": ("no homology", "elsewhere"),
    "holes at place": ("no homology",),
}
HOLES_REACHES, HEIGHT_CELL_M = (2.5, 5.0), 4.0
COVERAGE_SAMPLE = 200
LEVELS = (0.5, 0.9, 0.95)


@dataclass(frozen=True)
class Track:
    """How one run went, step by step.

    Parameters
    ----------
    error_m : ndarray, shape (S,), float64
        From the top mode to the truth, metres.
    inside : ndarray, shape (S, 3), bool
        Whether the truth was in the 50, 90 and 95 % region.
    way_m : ndarray, shape (S,), float64
        Way so far, metres.
    is_covered : ndarray, shape (S,), bool
        Whether the crowd has truly been there.
    told_unmapped : ndarray, shape (S,), bool
        Whether the status says that it has not.
    """

    error_m: FloatArray
    inside: NDArray[np.bool_]
    way_m: FloatArray
    is_covered: NDArray[np.bool_]
    told_unmapped: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Filter:
    """How to localize.

    Parameters
    ----------
    particles : int
        Pose hypotheses.
    prior : Prior
        What is known at the start; nothing by default.
    only : tuple of str
        Sensors and controls to run; all when empty.
    """

    particles: int = 8000
    prior: Prior = field(default_factory=UniformPrior)
    only: tuple[Control, ...] = ()


def run_city(
    city: CityScene, imu: Imu, run: int, length_m: float, how: Filter
) -> dict[Control, Track]:
    """Localize one robot in a generated world, with each sensor and with each control.

    Parameters
    ----------
    city : CityScene
        Where.
    imu : Imu
        How well the robot knows its motion.
    run : int
        Decides route, noise and particles.
    length_m : float
        Way to drive, metres.
    how : Filter
        How to localize.

    Returns
    -------
    dict of str to Track
        As `run_controls` returns them.
    """
    legs = drive_through(city, imu, run, length_m)
    return run_controls(city.scene, legs, (city.scenario.seed, run), how)


def run_controls(
    scene: Scene, legs: Sequence[Leg], seed: tuple[int, int], how: Filter
) -> dict[Control, Track]:
    """Localize one device with each sensor and with each control.

    Parameters
    ----------
    scene : Scene
        Where.
    legs : sequence of Leg
        What the device measures.
    seed : tuple of int
        Of the world and of the run.
    how : Filter
        How to localize.

    Returns
    -------
    dict of str to Track
        ``homology`` counts holes, ``no homology`` knows motion and walls alone, ``shuffled`` has
        the counts in another order, ``true counts`` those that are expected where the device is.
        ``registered`` looks a scan up among the crowd, ``elsewhere`` does so with scans of other
        places, ``both`` has counts and crowd together, and ``holes at place`` the counts that are
        read where a scan seems to have been made; a crowd that has found no place tells nothing.
    """
    counting = CodeLikelihood(scene.code_map, scene.noise)
    exact = CodeLikelihood(scene.code_map, scene.expectation.noise())

    def counted() -> Sensed:
        return Sensed(counting, [leg.counts for leg in legs])

    def nothing() -> Sensed:
        return Sensed(counting, [None for _ in legs])

    given: dict[Control, Callable[[], Sensed]] = {
        "homology": counted,
        "no homology": nothing,
        "shuffled": lambda: Sensed(counting, [leg.counts for leg in shuffled(legs, [*seed, 4])]),
        "true counts": lambda: Sensed(exact, [leg.counts for leg in true_counts(scene, legs)]),
        "registered": nothing,
        "elsewhere": nothing,
        "both": counted,
        "holes at place": nothing,
    }
    if scene.crowd is not None:
        place, sightings = scene.crowd.likelihood, [leg.sighting for leg in legs]
        reach_m = scene.crowd.registered.reach_m
        given |= {
            "registered": lambda: Sensed(place, sightings),
            "elsewhere": lambda: Sensed(place, [leg.elsewhere for leg in legs]),
            "both": lambda: Sensed(JointLikelihood(place, counting), [_both(leg) for leg in legs]),
            "holes at place": lambda: Sensed(
                HolesAtPlace(place, _heights(scene, reach_m)), sightings
            ),
        }
    return {
        control: localize(scene, legs, sensed(), seed[1], how)
        for control, sensed in given.items()
        if control in how.only or not how.only
    }


def _heights(scene: Scene, reach_m: float) -> list[HeightMap]:
    return [
        HeightMap.geometric(scene.site_map, reaches * reach_m, cell_m=HEIGHT_CELL_M)
        for reaches in HOLES_REACHES
    ]


def _both(leg: Leg) -> JointMeasurement | None:
    if leg.sighting is None and leg.counts is None:
        return None
    return JointMeasurement(leg.sighting, leg.counts)


class Sensed(NamedTuple):
    """A sensor model, and what was measured on each leg.

    Parameters
    ----------
    likelihood : Likelihood
        The model.
    measured : sequence
        One for each leg; None where there is nothing to weigh.
    """

    likelihood: Likelihood
    measured: Sequence[object | None]


def localize(scene: Scene, legs: Sequence[Leg], sensed: Sensed, seed: int, how: Filter) -> Track:
    """Localize one device.

    Parameters
    ----------
    scene : Scene
        Where.
    legs : sequence of Leg
        How the device moves.
    sensed : Sensed
        What it measures on the way.
    seed : int
        Of the particles.
    how : Filter
        How to localize.

    Returns
    -------
    Track
        Step by step.
    """
    counts = isinstance(sensed.likelihood, CodeLikelihood)
    config = LocalizerConfig(
        particles=how.particles,
        prior=how.prior,
        recovery=Relocation() if counts else Relocation(LOST),
    )
    localizer = Localizer(
        scene.site_map, (), config, free_space=scene.free_space, likelihood=sensed.likelihood
    )
    state = localizer.start(seed)
    errors, inside, told = [], [], []
    heard = None
    for leg, measured in zip(legs, sensed.measured, strict=True):
        state, pose = localizer.step(state, leg.delta, measured)
        best = pose.modes[0]
        errors.append(math.dist((best.x_m, best.y_m), leg.truth))
        inside.append([pose.holds(*leg.truth, level) for level in LEVELS])
        heard = heard if leg.sighting is None else leg.sighting.highest
        told.append(_told_unmapped(scene, pose, heard))
    way = np.cumsum([leg.delta.length_m for leg in legs])
    covered = np.array([leg.is_covered for leg in legs])
    return Track(np.array(errors), np.array(inside), way, covered, np.array(told))


def _told_unmapped(scene: Scene, pose: PoseDistribution, level: int | None) -> bool:
    if scene.crowd is None:
        return False
    some = pose.poses[pose.thinned(COVERAGE_SAMPLE), :2]
    return scene.crowd.likelihood.coverage(some, level) < EVEN_ODDS
