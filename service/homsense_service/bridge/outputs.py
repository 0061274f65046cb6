"""What goes out to devices: poses, particles while somebody reads them, and events."""

import json
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from homsense_service.bridge.encodings import JSON, PARTICLES
from homsense_service.bridge.keyspace import KeySpace

PARTICLES_EVERY_S = 0.5
EVENTS_EVERY_S = 1.0
PARTICLES_AT_ONCE = 500
_KEPT_EVENTS = 4096


class Output:
    """The streams out to one device; what nobody takes in time is dropped.

    Parameters
    ----------
    session : zenoh.Session
        The network.
    keys : KeySpace
        All keys.
    device : str
        Its name.
    """

    def __init__(self, session: zenoh.Session, keys: KeySpace, device: str) -> None:
        drop = zenoh.CongestionControl.DROP
        self._pose = session.declare_publisher(
            keys.of_device(device, "pose"), encoding=JSON, congestion_control=drop
        )
        self._particles = session.declare_publisher(
            keys.of_device(device, "particles"), encoding=PARTICLES, congestion_control=drop
        )
        self._next_s = float("-inf")

    def pose(self, frame: bytes) -> None:
        """Send a pose."""
        self._pose.put(frame)

    def particles(self, now_s: float, made: Callable[[], bytes]) -> None:
        """Send particles when somebody reads them, but not too often."""
        status: Any = self._particles.matching_status
        if now_s >= self._next_s and status.matching:
            self._next_s = now_s + PARTICLES_EVERY_S
            self._particles.put(made())

    def close(self) -> None:
        """Send no more."""
        for publisher in (self._pose, self._particles):
            publisher.undeclare()  # type: ignore[no-untyped-call]


class Events:
    """Tells devices what went wrong; the same at most once a second.

    Parameters
    ----------
    session : zenoh.Session
        The network.
    keys : KeySpace
        All keys.
    clock : callable
        Returns seconds.
    """

    def __init__(self, session: zenoh.Session, keys: KeySpace, clock: Callable[[], float]) -> None:
        self._session, self._keys, self._clock = session, keys, clock
        self._lock = threading.Lock()
        self._told_s: dict[tuple[str, str], float] = {}

    def tell(self, device: str, code: str, detail: str, **more: Any) -> None:  # noqa: ANN401 - JSON
        """Tell a device something."""
        now_s = self._clock()
        with self._lock:
            if now_s < self._told_s.get((device, code), float("-inf")) + EVENTS_EVERY_S:
                return
            if len(self._told_s) >= _KEPT_EVENTS:
                self._told_s.clear()
            self._told_s[device, code] = now_s
        body = json.dumps({"code": code, "detail": detail, **more})
        self._session.put(
            self._keys.of_device(device, "event"),
            body,
            encoding=JSON,
            congestion_control=zenoh.CongestionControl.DROP,
        )
