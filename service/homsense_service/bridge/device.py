"""One device: its messages become steps of its session, and the poses go back."""

import hmac
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import homsense
from homsense_service import schemas
from homsense_service.bridge.encodings import (
    ScanBody,
    Stamp,
    motion_before,
    motion_of,
    particles_of,
)
from homsense_service.bridge.inbox import Inbox
from homsense_service.bridge.inputs import FloatArray, Input, Scan
from homsense_service.bridge.lanes import Job, Lane, Workers
from homsense_service.bridge.outputs import PARTICLES_AT_ONCE, Output
from homsense_service.bridge.presence import Presence
from homsense_service.bridge.requests import Expected, Request
from homsense_service.errors import (
    OverloadError,
    SequenceConflictError,
    ServiceError,
    SessionNotFoundError,
    TokenError,
)
from homsense_service.operations import Operations
from homsense_service.records import Binding, StoredReading
from homsense_service.rendering_poses import pose_json
from homsense_service.runs import Step
from homsense_service.schemas.wire import Landmarks, unix_seconds

RETRY_S = 1.0


class Desk(NamedTuple):
    """What devices share.

    Parameters
    ----------
    operations : Operations
        What the service does.
    workers : Workers
        Do what waits in the lanes.
    clock : callable
        Returns seconds.
    later : callable
        Does something after some seconds.
    took : callable
        Told the session, how many steps it took, and the pose after them.
    lost : callable
        Told how many inputs never came.
    tell : callable
        Told device, code and detail of what went wrong.
    forget : callable
        Told a device whose session is no more.
    """

    operations: Operations
    workers: Workers
    clock: Callable[[], float]
    later: Callable[[float, Job], None]
    took: Callable[[str, int, bytes], None]
    lost: Callable[[str, int], None]
    tell: Callable[[str, str, str], None]
    forget: Callable[[str], None]


class Device:
    """A device that streams into a session.

    Parameters
    ----------
    binding : Binding
        Which session, and what shows that it is this device.
    desk : Desk
        What it shares with others.
    output : Output
        Its streams out.
    presence : Presence
        Its signs of life.
    """

    def __init__(self, binding: Binding, desk: Desk, output: Output, presence: Presence) -> None:
        self.binding, self.presence = binding, presence
        self.name, self.session = binding.device, binding.session
        self._desk, self._output = desk, output
        self._lane = Lane(desk.workers, self._step)
        self._inbox: Inbox | None = None
        self._changing = threading.Lock()
        self._wakes_s = float("inf")
        self._asked: dict[int, list[Request]] = {}
        self._handlers = {"scan": self._scan, "steps": self._steps, "last": self._last}

    def check(self, stamp: Stamp | None) -> Stamp:
        """Return the stamp of a message, or raise `TokenError`."""
        if stamp is None or not hmac.compare_digest(stamp.token, self.binding.token):
            message = "the attachment is not a number below 2**52 and the token of the session"
            raise TokenError(message)
        return stamp

    def move(self, number: int, encoding: str, payload: bytes) -> None:
        """Take motion; the lane has nothing to do before a step is due."""
        try:
            moving = motion_of(encoding, payload, number)
        except Expected as error:
            self._desk.tell(self.name, "decode", str(error))
            return
        self.take(moving)

    def hear(self, number: int, payload: bytes) -> None:
        """Take a scan that nobody waits for."""
        self._post(partial(self._hear, number, payload))

    def check_session(self) -> None:
        """Take note of a sign of life; raise `SessionNotFoundError` if the session has gone."""
        self._desk.operations.sessions.site_of(self.session)
        self.presence.heard(self._desk.clock())

    def take(self, *given: Input) -> None:
        """Take inputs that are values already."""
        inbox = self._inbox
        if inbox is None:
            self._post(partial(self._put_first, *given))
            return
        self._put(inbox, *given)
        wait_s = inbox.due_s - self._desk.clock()
        if wait_s <= 0.0:
            self._post(_nothing)
        else:
            self._wake_in(wait_s)

    def heard(self, landmarks: Landmarks) -> tuple[StoredReading, ...]:
        """Return what was heard as the site of the session keeps it."""
        return self._desk.operations.heard(self.session, landmarks)

    def some_particles(self) -> FloatArray:
        """Return some particles of equal weight: x m, y m, heading rad."""
        pose = self._desk.operations.sessions.get(self.session).fix.pose
        return pose.poses[pose.thinned(PARTICLES_AT_ONCE)]

    def ask(self, request: Request, number: int) -> None:
        """Take a request, or raise `OverloadError`."""
        handle = self._handlers[request.method]
        if not self._lane.post(partial(self._guarded, request, partial(handle, request, number))):
            message = "too many messages of this device wait"
            raise OverloadError(message)

    def publish(self, frame: bytes) -> None:
        """Send the pose after a step, whoever has posted it, and particles if they are read."""
        self._output.pose(frame)
        self._output.particles(self._desk.clock(), lambda: particles_of(self.some_particles()))

    def close(self) -> None:
        """Send no more."""
        self._output.close()

    def _post(self, job: Job) -> None:
        if not self._lane.post(job):
            self._desk.tell(self.name, "overflow", "too many messages wait")

    def _open_inbox(self) -> Inbox:
        if self._inbox is None:
            fix = self._desk.operations.sessions.get(self.session).fix
            self._inbox = Inbox(fix.seq, fix.t, 1.0 / self.binding.pose_hz)
        return self._inbox

    def _hear(self, number: int, payload: bytes) -> None:
        try:
            self._put(self._open_inbox(), *self._read(number, payload))
        except SessionNotFoundError as error:
            self._end(error)
        except Expected as error:
            self._desk.tell(self.name, "decode", str(error))

    def _put_first(self, *given: Input) -> None:
        try:
            self._put(self._open_inbox(), *given)
        except SessionNotFoundError as error:
            self._end(error)

    def _put(self, inbox: Inbox, *given: Input) -> None:
        with self._changing:
            has_room = [inbox.put(each, self._desk.clock()) for each in given]
        if not all(has_room):
            self._desk.tell(self.name, "overflow", "too many inputs wait; the oldest are missing")

    def _read(self, number: int, payload: bytes) -> tuple[*tuple[Input, ...], Scan]:
        """Return the motion of a message, if it has any, and its scan."""
        body = ScanBody.model_validate_json(payload)
        readings = self._desk.operations.heard(self.session, body.landmarks)
        t = None if body.t is None else unix_seconds(body.t)
        moving = motion_before(body, number)
        if moving is None:
            return (Scan(number, readings, t),)
        return moving, Scan(moving.following, readings, t)

    def _guarded(self, request: Request, handle: Callable[[], None]) -> None:
        try:
            handle()
        except Exception as error:  # noqa: BLE001 - whoever asks is answered
            request.refuse(error)
            if isinstance(error, SessionNotFoundError):
                self._end(error)

    def _scan(self, request: Request, number: int) -> None:
        *before, scan = self._read(number, request.payload)
        inbox = self._open_inbox()
        if scan.first > inbox.through:
            self._put(inbox, *before, scan)
            self._asked.setdefault(scan.first, []).append(request)
            return
        operations = self._desk.operations
        request.answer(operations.take_again(self.session, scan.first, scan.readings, pose_json))

    def _steps(self, request: Request, _number: int) -> None:
        batch = schemas.StepsIn.model_validate_json(request.payload)
        operations = self._desk.operations
        frame = operations.take_steps(self.session, batch.steps, pose_json)
        self._catch_up()
        self._desk.took(self.session, len(batch.steps), frame)
        request.answer(frame)

    def _last(self, request: Request, _number: int) -> None:
        request.answer(self._desk.operations.answer(self.session, pose_json))

    def _step(self) -> None:
        """Take the steps that can be taken now."""
        if self._inbox is None:
            return
        with self._changing:
            plan = self._inbox.plan(self._desk.clock())
        for steps in _up_to_scans(plan.steps, self._asked):
            if not self._take(steps):
                return
        if plan.lost:
            self._desk.lost(self.name, plan.lost)
        if plan.wake_s is not None:
            self._wake_in(plan.wake_s - self._desk.clock())

    def _take(self, steps: list[Step]) -> bool:
        assert self._inbox is not None
        try:
            frame = self._desk.operations.take(self.session, steps, pose_json)
        except SessionNotFoundError as error:
            self._end(error)
        except SequenceConflictError as error:
            self._catch_up()
            self._refuse(error, self._inbox.through)
            self._desk.tell(self.name, "sequence_conflict", str(error))
            self._wake_in(0.0)
        except ServiceError as error:
            self._refuse(error, steps[-1].seq)
            self._desk.tell(self.name, "unavailable", str(error))
            self._wake_in(RETRY_S)
        except homsense.HomsenseError as error:
            with self._changing:
                self._inbox.go_on_from(steps[-1].seq, steps[-1].t)
            self._refuse(error, steps[-1].seq)
            self._desk.tell(self.name, "decode", str(error))
            self._wake_in(0.0)
        else:
            with self._changing:
                self._inbox.taken(steps, self._desk.clock())
            for request in self._asked.pop(steps[-1].seq, ()):
                request.answer(frame)
            self._desk.took(self.session, len(steps), frame)
            return True
        return False

    def _catch_up(self) -> None:
        """Go on behind the steps that were posted another way."""
        fix = self._desk.operations.sessions.get(self.session).fix
        inbox = self._open_inbox()
        with self._changing:
            inbox.go_on_from(fix.seq, fix.t)

    def _refuse(self, error: Exception, through: int) -> None:
        for number in [number for number in self._asked if number <= through]:
            for request in self._asked.pop(number):
                request.refuse(error)

    def _end(self, error: SessionNotFoundError) -> None:
        """Let the device go: its session is no more."""
        self._inbox = None
        self._refuse(error, max(self._asked, default=0))
        self._desk.tell(self.name, "no_session", str(error))
        self._desk.forget(self.name)

    def _wake_in(self, seconds: float) -> None:
        """Look at the inbox after some time, unless that will be done before anyway."""
        at_s = self._desk.clock() + max(0.0, seconds)
        if at_s < self._wakes_s:
            self._wakes_s = at_s
            self._desk.later(max(0.0, seconds), lambda: self._post(self._wake))

    def _wake(self) -> None:
        self._wakes_s = float("inf")


def _nothing() -> None:
    """Let the lane look at its inbox."""


def _up_to_scans(steps: list[Step], asked: dict[int, list[Request]]) -> Iterator[list[Step]]:
    """Yield the steps in parts that end with a scan that somebody waits for."""
    part: list[Step] = []
    for step in steps:
        part.append(step)
        if step.seq in asked:
            yield part
            part = []
    if part:
        yield part
