"""``homsense fleet``: simulated phones map a site of a running service, and robots drive in it."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from statistics import median

import numpy as np
from homsense_client import Client, Complex
from homsense_client.streaming import Robot, connect
from homsense_fleet.device import drive
from homsense_fleet.driver import Crowd, Report, drive_robot, over_rest, over_zenoh
from homsense_fleet.world import World
from rich.console import Console
from rich.progress import Progress

from homsense_cli.demo_run import map_world, prepare_site

LAST_STEPS = 60


@dataclass(frozen=True, slots=True)
class Fleet:
    """Robots that drive.

    Parameters
    ----------
    robots : int
        How many.
    seed : int
        Decides their routes and their particles.
    zenoh : str, optional
        Where they stream; over REST when absent.
    length_m : float, default 1500.0
        Way of each, metres.
    """

    robots: int
    seed: int
    zenoh: str | None = None
    length_m: float = 1500.0


def run_fleet(
    url: str, site: str, world: World, crowd: Crowd, console: Console, *, key: str | None = None
) -> Complex:
    """Create a site for a world, let phones map it, and print what became of it.

    Parameters
    ----------
    url : str
        The service.
    site : str
        Name of the site.
    world : World
        Where the phones walk.
    crowd : Crowd
        The phones.
    console : rich.console.Console
        Where progress goes.
    key : str, optional
        An API key of the service.

    Returns
    -------
    Complex
        The landmark complex.
    """
    with Client(url, key=key, timeout_s=120.0) as client, Progress(console=console) as bars:
        prepare_site(client, site, world)
        total = crowd.phones * crowd.scans_each
        task = bars.add_task(f"{crowd.phones} phones post scans", total=total)
        map_world(url, site, world, crowd, lambda count: bars.advance(task, count))
        grown = client.get_complex(site)
    console.print(
        f"{site}: {len(world.city.buildings)} buildings, {grown.observations} observations, "
        f"{grown.landmarks} landmarks, {grown.facets} facets, "
        f"b0 = {grown.betti[0]}, b1 = {grown.betti[1]}"
    )
    return grown


def drive_fleet(
    url: str, site: str, world: World, fleet: Fleet, console: Console, *, key: str | None = None
) -> list[float]:
    """Drive robots side by side through a mapped site and print how well they were followed.

    Parameters
    ----------
    url : str
        The service.
    site : str
        A mapped site.
    world : World
        Where the robots drive.
    fleet : Fleet
        The robots.
    console : rich.console.Console
        Where numbers go.
    key : str, optional
        An API key of the service.

    Returns
    -------
    list of float
        Of each robot, the median error over the last 300 m, metres.
    """
    routes = [
        [*drive(world, np.random.default_rng([fleet.seed, 2, n]), length_m=fleet.length_m)]
        for n in range(fleet.robots)
    ]

    def follow(number: int, report: Report) -> float:
        return median(drive_robot(routes[number], report)[-LAST_STEPS:])

    def post(number: int) -> float:
        with client.open_session(site, seed=fleet.seed + number) as session:
            return follow(number, over_rest(session))

    def stream(number: int) -> float:
        assert network is not None
        with Robot(network, f"{site}-{number}", timeout_s=30.0) as robot:
            robot.open(site, key=key, seed=fleet.seed + number)
            return follow(number, over_zenoh(robot))

    with ExitStack() as stack:
        client = stack.enter_context(Client(url, key=key, timeout_s=120.0))
        network = stack.enter_context(connect(fleet.zenoh)) if fleet.zenoh else None
        pool = stack.enter_context(ThreadPoolExecutor(fleet.robots))
        ends = list(pool.map(stream if fleet.zenoh else post, range(fleet.robots)))
    for number, error_m in enumerate(ends):
        console.print(f"robot {number}: median error over the last 300 m {error_m:.1f} m")
    return ends
