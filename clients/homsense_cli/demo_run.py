"""The demo as data: map a world, drive a robot through it, and record what happened."""

import asyncio
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from homsense_client import AsyncClient, Client, Complex, Expectation, Session
from homsense_client.streaming import Network, Robot
from homsense_fleet.device import DriveStep, drive
from homsense_fleet.driver import Crowd, Report, error_m, map_site, over_rest, over_zenoh
from homsense_fleet.world import World

LAST_M = 300.0
SNAPSHOTS = 4
HOMOLOGY = {"type": "homology"}
NEAR_AND_FAR = (2, 3)
POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class Moment:
    """What was true and what was estimated after a step.

    Parameters
    ----------
    travelled_m : float
        Way so far, metres.
    truth : tuple of float
        True (x, y, heading).
    holes : tuple of float, optional
        The measurement.
    error_m : float
        Distance from the top mode to the truth, metres.
    baseline_m : float
        The same without homology: motion and walls only.
    is_same : bool
        Whether the particles are the same over REST and zenoh, to the last bit.
    """

    travelled_m: float
    truth: tuple[float, float, float]
    holes: tuple[float, ...] | None
    error_m: float
    baseline_m: float
    is_same: bool

    def showing(self, levels: Sequence[int]) -> "Moment":
        """Return the moment with some of its counts."""
        if self.holes is None:
            return self
        return replace(self, holes=tuple(self.holes[level] for level in levels))


class Ways(NamedTuple):
    """Both ways to one service."""

    rest: Client
    zenoh: Network


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The distribution at one moment of the drive."""

    travelled_m: float
    truth: tuple[float, float, float]
    visible: list[str]
    particles: list[tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class Run:
    """Everything that the report and the figures need."""

    scenario: str
    seed: int
    buildings: int
    complex: Complex
    hops: tuple[int, ...]
    map_document: dict[str, Any]
    transmitters: dict[str, tuple[float, float]]
    facets: list[list[str]]
    height_maps: list[dict[str, Any]]
    moments: list[Moment]
    snapshots: list[Snapshot]

    def as_json(self) -> dict[str, Any]:
        """Return the run as JSON data."""
        return asdict(self)


def prepare_site(client: Client, site: str, world: World) -> None:
    """Create the site of a world with its unlabeled map."""
    origin = None if world.origin is None else dict(zip(("lat", "lon"), world.origin, strict=True))
    client.put_site(site, name=world.name, s_max_m=world.radio.s_max_m, origin=origin)
    client.put_map(site, world.map_document())


def map_world(
    url: str, site: str, world: World, crowd: Crowd, on_posted: Callable[[int], None]
) -> int:
    """Post the scans of a fleet of phones; return how many were accepted."""

    async def post() -> int:
        async with AsyncClient(url) as client:
            return await map_site(client, site, world, crowd, on_posted)

    return asyncio.run(post())


def drive_robot(
    ways: Ways,
    site: str,
    world: World,
    *,
    seed: int,
    length_m: float,
    on_moment: Callable[[Moment], None],
) -> tuple[list[Moment], list[Snapshot], tuple[int, ...]]:
    """Drive a robot from an unknown start, over REST and, side by side, over zenoh.

    Another session runs without homology.

    Parameters
    ----------
    ways : Ways
        To the service.
    site : str
        A mapped site.
    world : World
        Where the robot drives.
    seed : int
        Decides route, noise and particles.
    length_m : float
        Way to drive, metres.
    on_moment : callable
        Told of each step.

    Returns
    -------
    moments : list of Moment
        One for each step.
    snapshots : list of Snapshot
        Spread evenly over the drive.
    hops : tuple of int
        Neighborhoods that the moments tell of.
    """
    steps = list(drive(world, np.random.default_rng([seed, 2]), length_m=length_m))
    pictured = {round((i + 1) * len(steps) / SNAPSHOTS) for i in range(SNAPSHOTS)} | {1}
    moments: list[Moment] = []
    snapshots: list[Snapshot] = []
    with (
        ways.rest.open_session(site, seed=seed, sensor=HOMOLOGY) as robot,
        ways.rest.open_session(site, seed=seed, sensor=HOMOLOGY) as blind,
        Robot(ways.zenoh, f"{site}-robot", encoding="json") as streaming,
    ):
        streaming.open(site, seed=seed, sensor=HOMOLOGY)
        reports = over_rest(robot), over_zenoh(streaming)
        for step in steps:
            moments.append(_advance(reports, blind, step))
            on_moment(moments[-1])
            if step.seq in pictured:
                visible = [entry["id"] for entry in step.scan]
                particles = robot.particles(2000)
                snapshots.append(Snapshot(step.travelled_m, step.truth, visible, particles))
        shown = near_and_far(robot.info.hops)
        at = [robot.info.hops.index(radius) for radius in shown]
        return [moment.showing(at) for moment in moments], snapshots, shown


def near_and_far(hops: tuple[int, ...]) -> tuple[int, ...]:
    """Return the paper's near and far where both are counted, else the first two."""
    return NEAR_AND_FAR if {*NEAR_AND_FAR} <= {*hops} else hops[:2]


def learn(client: Client, site: str, on_step: Callable[[int, int], None]) -> Expectation:
    """Wait until a site has placed its crowd and learnt what its sensor counts; return that."""
    placed = client.register(site)
    while placed.state == "building":
        on_step(placed.done, placed.of)
        time.sleep(POLL_S)
        placed = client.registration(site)
    told = client.expect(site)
    while told.state == "building":
        on_step(placed.of + told.done, placed.of + told.of)
        time.sleep(POLL_S)
        told = client.expectation(site)
    on_step(placed.of + told.done, placed.of + told.of)
    return told


def _advance(reports: tuple[Report, Report], blind: Session, step: DriveStep) -> Moment:
    posted, streamed = (report(step) for report in reports)
    other = blind.step(step.delta, t=step.t)
    return Moment(
        step.travelled_m,
        step.truth,
        posted.holes,
        error_m(posted, step),
        error_m(other, step),
        streamed.digest == posted.digest,
    )


def final_median(moments: list[Moment], read: Callable[[Moment], float]) -> float:
    """Return the median of a quantity over the last 300 m."""
    end = moments[-1].travelled_m
    return median(read(moment) for moment in moments if moment.travelled_m > end - LAST_M)


def every(moments: list[Moment], way_m: float) -> list[Moment]:
    """Return the moments at which another stretch was completed."""
    ways = [0.0, *(moment.travelled_m for moment in moments)]
    return [
        moment
        for before, moment in zip(ways, moments, strict=False)
        if moment.travelled_m // way_m > before // way_m
    ]
