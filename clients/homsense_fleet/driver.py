"""Devices at work: phones post their scans side by side."""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from homsense_client import AsyncClient

from homsense_fleet.device import phone_scans
from homsense_fleet.world import World


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
