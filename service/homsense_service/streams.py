"""Live poses: each is written once, and whoever reads too slowly misses some, then all."""

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

KEPT, PATIENCE = 2, 64


class Reader:
    """One reader of a session's poses; only the event loop touches it."""

    def __init__(self) -> None:
        self._frames: asyncio.Queue[bytes | None] = asyncio.Queue(KEPT)
        self._missed = 0
        self._sending: asyncio.Task[object] | None = None
        self.is_open = True

    def offer(self, frame: bytes) -> None:
        """Take a frame in place of the oldest; after too many in vain, end."""
        if not self.is_open:
            return
        if self._frames.full():
            self._missed += 1
            self._frames.get_nowait()
            if self._missed >= PATIENCE:
                self.end()
                if self._sending is not None:
                    self._sending.cancel()
                return
        else:
            self._missed = 0
        self._frames.put_nowait(frame)

    def end(self) -> None:
        """Let the reader come to its end."""
        if self.is_open:
            self.is_open = False
            while not self._frames.empty():
                self._frames.get_nowait()
            self._frames.put_nowait(None)

    async def next(self) -> bytes | None:
        """Return the next frame; None at the end.

        The task that asks is taken for the one that sends: it is cancelled when it stands still.
        """
        self._sending = asyncio.current_task()
        return await self._frames.get()


class Streams:
    """The readers of all sessions.

    Parameters
    ----------
    most : int
        How many readers there may be.

    Attributes
    ----------
    listeners : list of callable
        Told of the poses of all sessions, in the thread that publishes them.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._readers: dict[str, set[Reader]] = {}
        self.listeners: list[Callable[[str, bytes], None]] = []

    def __len__(self) -> int:
        return sum(map(len, list(self._readers.values())))

    @contextmanager
    def reading(self, session: str) -> Iterator[Reader]:
        """Give a new reader of a session, which counts as one until it leaves."""
        reader = Reader()
        with self._lock:
            self._readers.setdefault(session, set()).add(reader)
        try:
            yield reader
        finally:
            with self._lock:
                readers = self._readers[session]
                readers.discard(reader)
                if not readers:
                    del self._readers[session]

    def publish(self, session: str, frame: bytes) -> None:
        """Give a pose to all readers and listeners of a session; from any thread."""
        for listener in self.listeners:
            listener(session, frame)
        if session in self._readers:
            self._loop.call_soon_threadsafe(self._deliver, session, frame)

    def end(self, session: str) -> None:
        """End the readers of a session; from any thread."""
        if session in self._readers:
            self._loop.call_soon_threadsafe(self._end, session)

    def end_all_soon(self) -> None:
        """End all readers; from any thread, or a signal handler."""
        for session in list(self._readers):
            self._loop.call_soon_threadsafe(self._end, session)

    def _deliver(self, session: str, frame: bytes) -> None:
        for reader in list(self._readers.get(session, ())):
            reader.offer(frame)

    def _end(self, session: str) -> None:
        for reader in list(self._readers.get(session, ())):
            reader.end()
