"""The robot's side of the stream: motion at any rate, scans that are acknowledged, poses back."""

import contextlib
import json
import queue
import secrets
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, Literal, Self

import zenoh

from homsense_client import _models as models
from homsense_client import _protocol as protocol
from homsense_client import _stream_protocol as wire
from homsense_client._network import Network
from homsense_client._retry import Retry, is_transient
from homsense_client.errors import (
    ConflictError,
    ConnectError,
    RequestTimeoutError,
    UnavailableError,
)

OPEN_TIMEOUT_S = 60.0
_TIMEOUT = "Timeout"
_RENUMBERED = 3

OnPose = Callable[[models.Pose], object]
OnEvent = Callable[[dict[str, Any]], object]


class Robot:
    """A device that streams into a session of its own.

    Inputs are numbered: a service that comes back after a crash goes on where its disk ends, and
    nothing counts twice.

    Parameters
    ----------
    network : Network
        From `connect`.
    device : str
        A name that nobody else on this network has.
    batch : int, default 10
        Motions in one message.
    encoding : {"binary", "json"}, default "binary"
        Single precision, or every bit.
    retry : Retry, optional
        When to ask again.
    timeout_s : float, default 2.0
        Longest wait for an answer, seconds.
    """

    def __init__(
        self,
        network: Network,
        device: str,
        *,
        batch: int = 10,
        encoding: Literal["binary", "json"] = "binary",
        retry: Retry | None = None,
        timeout_s: float = 2.0,
    ) -> None:
        self._network, self.device, self._prefix = network.session, device, network.prefix
        self._batch, self._encoding = batch, encoding
        self._retry, self._timeout_s = retry or Retry(attempts=8), timeout_s
        self._lock = threading.RLock()
        self._token, self._number = b"", 0
        self._has_left = False
        self._kind: Literal["deltas", "imu"] = "deltas"
        self._pending: list[Mapping[str, Any]] = []
        self._alive = network.session.liveliness().declare_token(
            wire.alive(network.prefix, device)
        )
        self._moving = network.session.declare_publisher(
            self._key("imu"), congestion_control=zenoh.CongestionControl.DROP
        )
        self._readers: list[zenoh.Subscriber[None]] = []
        self.info: models.SessionInfo | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.leave()

    def open(
        self,
        site: str,
        *,
        key: str | None = None,
        pose_hz: float = 10.0,
        **options: protocol.Json,
    ) -> models.SessionInfo:
        """Open a session on a site; options are those of REST.

        Parameters
        ----------
        site : str
            Name of the site.
        key : str, optional
            An API key of the service.
        pose_hz : float, default 10.0
            How many poses a second motion alone makes, at most.
        **options : object
            Of the session, as in ``particles=2000``.

        Returns
        -------
        SessionInfo
            The session; it can be read over REST, too.

        Raises
        ------
        ClientError
            If the service refuses, or is not there.
        """
        return self._let_in({"site": site, "options": options, "key": key, "pose_hz": pose_hz})

    def attach(
        self, session: str, *, key: str | None = None, pose_hz: float = 10.0
    ) -> models.SessionInfo:
        """Go on with a session that exists, behind its last step."""
        return self._let_in({"session": session, "key": key, "pose_hz": pose_hz})

    def move(self, delta: Mapping[str, Any], dt_s: float = 0.0) -> None:
        """Report motion in the body frame: ``forward_m``, ``left_m``, ``turn_rad``, ``std``."""
        self._collect("deltas", {**delta, "dt_s": dt_s})

    def sense(self, dt_s: float, forward: float, left: float, turn: float) -> None:
        """Report a reading of a level IMU: accelerations in m/s^2, turn rate in rad/s."""
        self._collect("imu", {"dt_s": dt_s, "forward": forward, "left": left, "turn": turn})

    def flush(self) -> None:
        """Send the motion that still waits for a full message."""
        with self._lock:
            if not self._pending:
                return
            first, pending, self._pending = (
                self._number - len(self._pending) + 1,
                self._pending,
                [],
            )
            if self._encoding == "json":
                encoding, payload = wire.JSON, wire.motion_json(self._kind, pending)
            elif self._kind == "imu":
                encoding, payload = wire.IMU, wire.imu_rows(pending)
            else:
                encoding, payload = wire.DELTA, wire.delta_rows(pending)
            self._moving.put(payload, encoding=encoding, attachment=wire.stamp(first, self._token))

    def scan(self, landmarks: protocol.Landmarks, *, t: float | None = None) -> models.Pose:
        """Report a scan; it and the motion that waits are on disk when this returns.

        Parameters
        ----------
        landmarks : iterable of str or mapping
            What is heard.
        t : float, optional
            When, seconds; else the time is that of the motion.

        Returns
        -------
        Pose
            After the scan and all motion before it. A scan that the service had given up waiting
            for, or that somebody else's steps have overtaken, is sent again as a later one.

        Raises
        ------
        ClientError
            If it was refused, or nobody has answered after all retries.
        """
        heard: dict[str, Any] = {"landmarks": list(landmarks), "t": t}
        with self._lock:
            first = self._number - len(self._pending) + 1
            body = {**heard, self._kind: self._pending}
            self._pending = []
            self._number += 1
        for _ in range(_RENUMBERED):
            try:
                return models.Pose.from_json(self._ask("scan", body, first))
            except ConflictError:
                first, body = self._next_number(), heard
        return models.Pose.from_json(self._ask("scan", body, first))

    def steps(self, steps: Iterable[Mapping[str, Any]]) -> models.Pose:
        """Post steps with numbers of their own, exactly as over REST."""
        with self._lock:
            self.flush()
            pose = models.Pose.from_json(self._ask("steps", {"steps": list(steps)}, 0))
            self._number = max(self._number, pose.seq)
            return pose

    def last(self) -> models.Pose:
        """Return the latest pose."""
        return models.Pose.from_json(self._ask("last", {}, 0))

    def close(self) -> None:
        """Close the session at the service, and leave."""
        self._ask("close", {}, 0)
        self.leave()

    def leave(self) -> None:
        """Send what waits and stop streaming; the session stays."""
        with self._lock:
            if self._has_left:
                return
            self._has_left = True
            if self._token:
                self.flush()
        for reader in self._readers:
            reader.undeclare()  # type: ignore[no-untyped-call]
        self._readers = []
        self._moving.undeclare()  # type: ignore[no-untyped-call]
        self._alive.undeclare()  # type: ignore[no-untyped-call]

    def on_pose(self, take: OnPose) -> None:
        """Call a function with each pose, in a thread of zenoh's."""
        self._read("pose", lambda sample: take(models.Pose.from_json(_json(sample))))

    def on_particles(self, take: Callable[[list[tuple[float, float, float]]], None]) -> None:
        """Call a function with particles, at most twice a second: x m, y m, heading rad."""
        self._read("particles", lambda sample: take(wire.particles(sample.payload.to_bytes())))

    def on_event(self, take: OnEvent) -> None:
        """Call a function with each event: ``code`` and ``detail`` of what went wrong."""
        self._read("event", lambda sample: take(_json(sample)))

    def poses(self, timeout_s: float = 10.0) -> Iterator[models.Pose]:
        """Yield poses as they come, the latest first when the reader is slow; end in silence."""
        latest: queue.Queue[models.Pose] = queue.Queue(1)

        def take(pose: models.Pose) -> None:
            with contextlib.suppress(queue.Empty):
                latest.get_nowait()
            latest.put(pose)

        self.on_pose(take)
        while True:
            try:
                yield latest.get(timeout=timeout_s)
            except queue.Empty:
                return

    def _next_number(self) -> int:
        """Return a number behind all that the service has taken or given up."""
        through = self.last().seq
        with self._lock:
            self.flush()
            self._number = max(self._number, through) + 1
            return self._number

    def _key(self, what: str) -> str:
        return wire.key(self._prefix, self.device, what)

    def _read(self, what: str, take: Callable[[zenoh.Sample], Any]) -> None:
        self._readers.append(self._network.declare_subscriber(self._key(what), take))

    def _let_in(self, asked: dict[str, Any]) -> models.SessionInfo:
        told = self._ask("open", {"nonce": secrets.token_hex(16), **asked}, 0, OPEN_TIMEOUT_S)
        self._token, self._number = bytes.fromhex(told["token"]), int(told["resume"])
        self.info = models.SessionInfo.from_json(told["info"])
        return self.info

    def _collect(self, kind: Literal["deltas", "imu"], motion: Mapping[str, Any]) -> None:
        with self._lock:
            if kind != self._kind:
                self.flush()
                self._kind = kind
            self._pending.append(motion)
            self._number += 1
            if len(self._pending) >= self._batch:
                self.flush()

    def _ask(
        self, method: str, body: dict[str, Any], number: int, timeout_s: float | None = None
    ) -> Any:  # noqa: ANN401 - parsed JSON
        """Ask until there is an answer; the service knows a request that it has answered."""
        payload, failed = json.dumps(body), 0
        while True:
            failed += 1
            try:
                return self._ask_once(method, payload, number, timeout_s or self._timeout_s)
            except UnavailableError as error:
                wait_s = self._retry.wait_s(failed) if is_transient(error.status) else None
                if wait_s is None:
                    raise
            except (ConnectError, RequestTimeoutError):
                wait_s = self._retry.wait_s(failed)
                if wait_s is None:
                    raise
            time.sleep(wait_s)

    def _ask_once(self, method: str, payload: str, number: int, timeout_s: float) -> Any:  # noqa: ANN401
        replies = self._network.get(
            self._key(f"rpc/{method}"),
            payload=payload,
            encoding=wire.JSON,
            attachment=wire.stamp(number, self._token.ljust(8, b"\0")),
            timeout=timeout_s,
            congestion_control=zenoh.CongestionControl.DROP,
        )
        for reply in replies:
            if reply.ok is not None:
                return json.loads(reply.ok.payload.to_bytes())
            failure = reply.err
            assert failure is not None
            text = failure.payload.to_bytes()
            if text == _TIMEOUT.encode():
                message = f"{method} was not answered in {timeout_s} s"
                raise RequestTimeoutError(message)
            raise protocol.failure(json.loads(text))
        message = f"nobody answers {method}"
        raise ConnectError(message)


def _json(sample: zenoh.Sample) -> Any:  # noqa: ANN401 - parsed JSON
    return json.loads(sample.payload.to_bytes())
