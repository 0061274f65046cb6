"""The robot's side of the stream for asyncio; requests wait in threads, poses come to the loop."""

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping
from types import TracebackType
from typing import Any, Self

from homsense_client import _models as models
from homsense_client import _protocol as protocol
from homsense_client._robot import Robot


class AsyncRobot:
    """A device that streams into a session of its own.

    Parameters
    ----------
    robot : Robot
        Does the work; `move`, `sense` and `flush` never wait and are its own.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.move, self.sense, self.flush = robot.move, robot.sense, robot.flush

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await asyncio.to_thread(self._robot.leave)

    async def open(self, site: str, **options: protocol.Json) -> models.SessionInfo:
        """Open a session on a site; options are those of `Robot.open`."""
        return await asyncio.to_thread(self._robot.open, site, **options)

    async def attach(self, session: str, **options: protocol.Json) -> models.SessionInfo:
        """Go on with a session that exists, behind its last step."""
        return await asyncio.to_thread(self._robot.attach, session, **options)

    async def scan(self, landmarks: protocol.Landmarks, *, t: float | None = None) -> models.Pose:
        """Report a scan; it and the motion that waits are on disk when this returns."""
        return await asyncio.to_thread(self._robot.scan, landmarks, t=t)

    async def steps(self, steps: Iterable[Mapping[str, Any]]) -> models.Pose:
        """Post steps with numbers of their own, exactly as over REST."""
        return await asyncio.to_thread(self._robot.steps, steps)

    async def last(self) -> models.Pose:
        """Return the latest pose."""
        return await asyncio.to_thread(self._robot.last)

    async def close(self) -> None:
        """Close the session at the service, and leave."""
        await asyncio.to_thread(self._robot.close)

    async def poses(self) -> AsyncIterator[models.Pose]:
        """Yield poses as they come, the latest first when the reader is slow."""
        loop = asyncio.get_running_loop()
        latest: asyncio.Queue[models.Pose] = asyncio.Queue(1)

        def take(pose: models.Pose) -> None:
            if latest.full():
                latest.get_nowait()
            latest.put_nowait(pose)

        self._robot.on_pose(lambda pose: loop.call_soon_threadsafe(take, pose))
        while True:
            yield await latest.get()
