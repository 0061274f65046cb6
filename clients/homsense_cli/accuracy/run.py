"""One device, localized from nothing: with its counts, and with each of the three controls."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from homsense import FieldNoise, Localizer, LocalizerConfig, Prior, UniformPrior
from homsense_cli.accuracy.legs import Leg, drive_through, shuffled, true_counts
from homsense_cli.accuracy.scenario import Imu
from homsense_cli.accuracy.scene import CityScene, Scene

FloatArray = NDArray[np.float64]
Control = Literal["homology", "no homology", "shuffled", "true counts"]

CONTROLS: tuple[Control, ...] = ("homology", "no homology", "shuffled", "true counts")
WEAKER: tuple[Control, ...] = ("no homology", "shuffled")
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
    """

    error_m: FloatArray
    inside: NDArray[np.bool_]
    way_m: FloatArray


@dataclass(frozen=True, slots=True)
class Filter:
    """How to localize.

    Parameters
    ----------
    particles : int
        Pose hypotheses.
    prior : Prior
        What is known at the start; nothing by default.
    """

    particles: int = 8000
    prior: Prior = field(default_factory=UniformPrior)


def run_city(
    city: CityScene, imu: Imu, run: int, length_m: float, how: Filter
) -> dict[Control, Track]:
    """Localize one robot in a generated world, with its counts and with each control.

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
        One for each of `CONTROLS`.
    """
    legs = drive_through(city, imu, run, length_m)
    return run_controls(city.scene, legs, (city.scenario.seed, run), how)


def run_controls(
    scene: Scene, legs: Sequence[Leg], seed: tuple[int, int], how: Filter
) -> dict[Control, Track]:
    """Localize one device with its counts and with each control.

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
        One for each of `CONTROLS`.
    """
    exact = scene.expectation.noise()
    given: dict[Control, tuple[Sequence[Leg], FieldNoise | None]] = {
        "homology": (legs, scene.noise),
        "no homology": (legs, None),
        "shuffled": (shuffled(legs, [*seed, 4]), scene.noise),
        "true counts": (true_counts(scene, legs), exact),
    }
    return {
        control: localize(scene, measured, noise, seed[1], how)
        for control, (measured, noise) in given.items()
    }


def localize(
    scene: Scene, legs: Sequence[Leg], noise: FieldNoise | None, seed: int, how: Filter
) -> Track:
    """Localize one device.

    Parameters
    ----------
    scene : Scene
        Where.
    legs : sequence of Leg
        What the device measures.
    noise : FieldNoise, optional
        Error of the counts; without it nothing is weighed.
    seed : int
        Of the particles.
    how : Filter
        How to localize.

    Returns
    -------
    Track
        Step by step.
    """
    expected = scene.expectation
    config = LocalizerConfig(particles=how.particles, noise=noise or scene.noise, prior=how.prior)
    heights = (*expected.heights, *expected.spreads)
    localizer = Localizer(scene.site_map, heights, config, free_space=scene.free_space)
    state = localizer.start(seed)
    errors, inside = [], []
    for leg in legs:
        state, pose = localizer.step(state, leg.delta, None if noise is None else leg.counts)
        best = pose.modes[0]
        errors.append(math.dist((best.x_m, best.y_m), leg.truth))
        inside.append([pose.holds(*leg.truth, level) for level in LEVELS])
    way = np.cumsum([leg.delta.length_m for leg in legs])
    return Track(np.array(errors), np.array(inside), way)
