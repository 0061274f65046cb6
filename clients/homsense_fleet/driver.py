"""Devices at work: phones post their scans side by side, robots drive over REST or zenoh."""

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from homsense_client import AsyncClient, Pose, Session
from homsense_client.streaming import Robot

from homsense_fleet.device import DriveStep, phone_scans
from homsense_fleet.world import World

Report = Callable[[DriveStep], Pose]
"""Tells the service of a step of a robot, and returns where it believes the robot to be."""


@dataclass(frozen=True, slots=True)
class Crowd:
    """Phones that walk a world.

    Parameters
    ----------
    seed : int
        Decides their routes and the radio noise.
    phones : int, default 40
        How many phones post side by side.
    scans_each : int, default 130
        Scans of each phone.
    batch : int, default 50
        Scans in a request.
    """

    seed: int
    phones: int = 40
    scans_each: int = 130
    batch: int = 50

    def scans(self, world: World, number: int) -> Iterator[dict[str, Any]]:
        """Return the scans of one of the phones, as the service takes them."""
        rng = np.random.default_rng([self.seed, 1, number])
        return phone_scans(world, f"phone-{number:02d}", rng, count=self.scans_each)


async def map_site(
    client: AsyncClient,
    site: str,
    world: World,
    crowd: Crowd,
    on_posted: Callable[[int], None] = lambda _count: None,
) -> int:
    """Let phones walk the world and post what they hear.

    Parameters
    ----------
    client : AsyncClient
        The service.
    site : str
        An existing site.
    world : World
        Where the phones walk.
    crowd : Crowd
        The phones.
    on_posted : callable, optional
        Told how many scans were posted, after each request.

    Returns
    -------
    int
        Scans that the service accepted.
    """

    async def walk(number: int) -> int:
        scans = list(crowd.scans(world, number))
        accepted = 0
        for first in range(0, len(scans), crowd.batch):
            receipt = await client.post_scans(site, scans[first : first + crowd.batch])
            accepted += receipt.accepted
            on_posted(receipt.accepted)
        return accepted

    return sum(await asyncio.gather(*(walk(number) for number in range(crowd.phones))))


def over_rest(session: Session) -> Report:
    """Return how a robot reports by requests."""
    return lambda step: session.step(step.delta, step.scan, t=step.t)


def over_zenoh(robot: Robot) -> Report:
    """Return how a robot reports by streaming; the same steps give the same poses."""

    def report(step: DriveStep) -> Pose:
        robot.move(step.delta)
        return robot.scan(step.scan, t=step.t)

    return report


def drive_robot(steps: Iterable[DriveStep], report: Report) -> list[float]:
    """Drive a robot; return how far off the service was after each step, metres.

    Parameters
    ----------
    steps : iterable of DriveStep
        From `drive`.
    report : callable
        From `over_rest` or `over_zenoh`.

    Returns
    -------
    list of float
        One for each step.
    """
    return [error_m(report(step), step) for step in steps]


def error_m(pose: Pose, step: DriveStep) -> float:
    """Return how far the best pose is from the truth, metres."""
    return math.dist((pose.best.x_m, pose.best.y_m), step.truth[:2])
