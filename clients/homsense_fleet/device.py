"""Devices that move through the world: phones on foot and a robot on the roads. Pure."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense_fleet.routes import walk_positions, wander
from homsense_fleet.world import World

Rng = np.random.Generator
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Errors of a robot's own motion estimate.

    Parameters
    ----------
    translation_m : float
        Standard deviation along each body axis for a step, metres.
    rotation_rad : float
        Standard deviation of the turn for a step, radians.
    """

    translation_m: float = 0.8
    rotation_rad: float = 0.05


@dataclass(frozen=True, slots=True)
class StepErrors:
    """Errors of a phone that counts steps and has a compass.

    Parameters
    ----------
    scale : float
        Standard deviation of the error of its step length, as a share; the same all the way.
    bias_rad : float
        Of the error of its compass; the same all the way.
    share : float
        Of what it measures for a leg, as a share of the leg.
    heading_rad : float
        Of the heading of a leg.
    """

    scale: float = 0.05
    bias_rad: float = 0.05
    share: float = 0.1
    heading_rad: float = 0.15


@dataclass(frozen=True, slots=True)
class DriveStep:
    """One step of a robot: what is true, what it measures, what it hears.

    Parameters
    ----------
    seq : int
        Number of the step, from 1.
    t : float
        Time since the start, seconds.
    truth : tuple of float
        True (x, y, heading) after the step; metres and radians.
    travelled_m : float
        True length driven so far, metres.
    delta : dict
        Measured body-frame motion: ``forward_m``, ``left_m``, ``turn_rad``.
    scan : list of dict
        Transmitters heard after the step.
    """

    seq: int
    t: float
    truth: tuple[float, float, float]
    travelled_m: float
    delta: dict[str, float]
    scan: list[dict[str, Any]]


def phone_scans(
    world: World, device: str, rng: Rng, *, count: int, spacing_m: float = 10.0
) -> Iterator[dict[str, Any]]:
    """Yield the scans of a phone carried on foot, without any position.

    Parameters
    ----------
    world : World
        Where it walks.
    device : str
        Name of the phone.
    rng : numpy.random.Generator
        Route, sideways steps and radio noise.
    count : int
        How many scans.
    spacing_m : float, default 10.0
        Way between two scans, metres.

    Yields
    ------
    dict
        A scan as the service takes it; empty ones are left out.
    """
    length = count * spacing_m
    (steps,) = rng.spawn(1)
    places = walk_positions(wander(world, rng, length), spacing_m, length)[:count]
    reckoning = _Reckoning(steps, StepErrors())
    for number, place in enumerate(places):
        beside = _aside(world, rng, place)
        heard = world.scan(beside, rng)
        x, y = reckoning.onward(beside)
        if heard:
            yield {
                "device": device,
                "scan_id": f"{device}-{number}",
                "observed_at": 1.7e9 + number * spacing_m / 1.4,
                "landmarks": heard,
                "track": {"id": "walk", "x_m": x, "y_m": y},
            }


class _Reckoning:
    """Where a phone believes to be, from where it began."""

    def __init__(self, rng: Rng, errors: StepErrors) -> None:
        self._rng, self._errors = rng, errors
        self._scale = 1.0 + errors.scale * rng.standard_normal()
        self._bias_rad = errors.bias_rad * rng.standard_normal()
        self._before: FloatArray | None = None
        self._x = self._y = 0.0

    def onward(self, place: FloatArray) -> tuple[float, float]:
        """Go straight to a place; return where that is believed to be."""
        if self._before is not None:
            east, north = place - self._before
            length, heading = math.hypot(east, north), math.atan2(north, east)
            wrong = self._rng.standard_normal(2)
            length *= self._scale + self._errors.share * wrong[0]
            heading += self._bias_rad + self._errors.heading_rad * wrong[1]
            self._x += length * math.cos(heading)
            self._y += length * math.sin(heading)
        self._before = place
        return round(self._x, 3), round(self._y, 3)


def _aside(world: World, rng: Rng, place: FloatArray, spread_m: float = 6.0) -> FloatArray:
    """Return a free place near the middle of the road."""
    for _ in range(8):
        candidate = place + rng.normal(0.0, spread_m, 2)
        if world.is_free(candidate):
            return candidate
    return place


def drive(
    world: World,
    rng: Rng,
    *,
    length_m: float = 1500.0,
    step_m: float = 5.0,
    speed_mps: float = 5.0,
    noise: OdometryNoise | None = None,
) -> Iterator[DriveStep]:
    """Yield the steps of a robot on the roads.

    Parameters
    ----------
    world : World
        Where it drives.
    rng : numpy.random.Generator
        Route and all noise.
    length_m : float, default 1500.0
        Way to drive, metres.
    step_m : float, default 5.0
        Length of a step, metres.
    speed_mps : float, default 5.0
        Speed, metres a second.
    noise : OdometryNoise, optional
        Errors of the motion estimate.

    Yields
    ------
    DriveStep
        Steps in order.
    """
    errors = noise or OdometryNoise()
    places = walk_positions(wander(world, rng, length_m + step_m), step_m, length_m)
    ahead = np.diff(places, axis=0)
    headings = np.arctan2(ahead[:, 1], ahead[:, 0])
    heading = float(headings[0])
    for number, (move, new_heading) in enumerate(zip(ahead, headings, strict=True), start=1):
        cosine, sine = math.cos(heading), math.sin(heading)
        turn = math.remainder(float(new_heading) - heading, math.tau)
        wrong = rng.normal(0.0, 1.0, 3)
        delta = {
            "forward_m": float(
                cosine * move[0] + sine * move[1] + errors.translation_m * wrong[0]
            ),
            "left_m": float(-sine * move[0] + cosine * move[1] + errors.translation_m * wrong[1]),
            "turn_rad": turn + errors.rotation_rad * float(wrong[2]),
        }
        heading = float(new_heading)
        place = places[number]
        yield DriveStep(
            seq=number,
            t=number * step_m / speed_mps,
            truth=(float(place[0]), float(place[1]), heading),
            travelled_m=number * step_m,
            delta=delta,
            scan=world.scan(place, rng),
        )
