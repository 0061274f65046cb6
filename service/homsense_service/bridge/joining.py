"""A bridge that comes as soon as there is a network, and goes with the service."""

import asyncio
import contextlib
import logging
from collections.abc import Callable

import zenoh

from homsense_service.bridge.bridge import Bridge

AGAIN_S = 1.0

_log = logging.getLogger(__name__)


class Joining:
    """Joins a network, whose router may come later than the service.

    Parameters
    ----------
    open_network : callable
        Raises `ConnectionError` as long as there is none.
    build : callable
        Makes the bridge from the network.
    """

    def __init__(
        self, open_network: Callable[[], zenoh.Session], build: Callable[[zenoh.Session], Bridge]
    ) -> None:
        self._open, self._build = open_network, build
        self._bridge: Bridge | None = None
        self._ending = asyncio.Event()
        self._trying = asyncio.create_task(self._try())

    @property
    def is_joined(self) -> bool:
        """Whether devices can reach the service."""
        return self._bridge is not None

    async def close(self) -> None:
        """Leave the network."""
        self._ending.set()
        await self._trying
        if self._bridge is not None:
            await asyncio.to_thread(self._bridge.close)

    async def _try(self) -> None:
        while not self._ending.is_set():
            try:
                network = await asyncio.to_thread(self._open)
            except ConnectionError as error:
                _log.warning("%s; trying again", error)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._ending.wait(), AGAIN_S)
            else:
                self._bridge = self._build(network)
                return
