"""Live sessions: one device's run on a site."""

import secrets
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import homsense
from homsense.backend import Backend, fastest
from homsense_service.errors import CapacityError, SequenceConflictError, SessionNotFoundError
from homsense_service.own_motion import Motion, OwnMotion
from homsense_service.records import StoredReading, StoredScan
from homsense_service.sensors import Measured, Sensor
from homsense_service.site import Site
from homsense_service.versions import MapVersion

_REMEMBERED = 1024

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Fix:
    """The answer to a step.

    Parameters
    ----------
    seq : int
        Number of the step; 0 before the first.
    t : float, optional
        Time of the step as the device gave it, seconds.
    pose : homsense.PoseDistribution
        What is known.
    measured : Measured, optional
        The measurement that was used; none without a scan.
    state : homsense.LocalizerState
        What the filter remembers.
    """

    seq: int
    t: float | None
    pose: homsense.PoseDistribution
    measured: Measured | None
    state: homsense.LocalizerState


@dataclass(frozen=True)
class Step:
    """One input of a session.

    Parameters
    ----------
    seq : int
        Number of the step, rising, from 1.
    t : float, optional
        Time, seconds.
    motion : Motion
        Since the step before.
    readings : tuple of StoredReading
        What was heard; nothing without a scan.
    """

    seq: int
    t: float | None
    motion: Motion
    readings: tuple[StoredReading, ...] = ()


class Session:
    """The state of one run and its lock.

    Parameters
    ----------
    name : str
        Identifier.
    site : Site
        Where it runs.
    map_version : MapVersion
        The map it was opened on; a later map does not change it.
    localizer : homsense.Localizer
        The filter.
    sensor : Sensor
        How it measures.
    seed : int
        Key of its random numbers.
    contribute : bool
        Whether its scans join the crowd of the site.
    backend : callable
        Returns what runs the filter now.
    """

    def __init__(  # noqa: PLR0913 - all of a session
        self,
        name: str,
        site: Site,
        map_version: MapVersion,
        localizer: homsense.Localizer,
        sensor: Sensor,
        *,
        seed: int,
        contribute: bool,
        backend: Callable[[], Backend],
    ) -> None:
        self.name = name
        self.site = site
        self.map_version = map_version
        self.localizer = localizer
        self.sensor = sensor
        self.seed = seed
        self._backend = backend
        self._lock = threading.Lock()
        state = localizer.start(seed)
        self._fix = Fix(0, None, localizer.estimate(state), None, state)
        self._own_motion = OwnMotion()
        self._contributes = contribute
        self._track = homsense.Travel(credit_m=0.0)
        self._contributed: list[StoredScan] = []
        self._applied: OrderedDict[int, Step] = OrderedDict()
        self._answers: OrderedDict[int, Any] = OrderedDict()

    @property
    def fix(self) -> Fix:
        """The latest answer."""
        return self._fix

    def apply(self, steps: list[Step], answer: Callable[[Fix], Answer]) -> Answer:
        """Apply steps in the order of `seq`; those applied before change nothing.

        Parameters
        ----------
        steps : list of Step
            At least one.
        answer : callable
            Makes the answer from the fix after the last step.

        Returns
        -------
        Answer
            The same as before when all steps were applied before and the last one was answered.

        Raises
        ------
        SequenceConflictError
            If a step lies in the past and is unknown, forgotten or different; then none of the
            steps is applied.
        """
        ordered = sorted(steps, key=lambda step: step.seq)
        last = ordered[-1].seq
        with self._lock:
            self._check(ordered)
            if last <= self._fix.seq:
                known: Answer | None = self._answers.get(last)
                return answer(self._fix) if known is None else known
            for step in ordered:
                if step.seq > self._fix.seq:
                    self._advance(step)
            given = answer(self._fix)
            self._answers[last] = given
            _forget_oldest(self._answers)
            return given

    def migrate(self, version: MapVersion, sensor: Sensor, localizer: homsense.Localizer) -> None:
        """Go on with another map: particles stay, those that it has no room for lose weight."""
        with self._lock:
            if version.digest == self.map_version.digest:
                return
            self.map_version, self.sensor, self.localizer = version, sensor, localizer
            state = localizer.migrate(self._fix.state)
            self._fix = replace(self._fix, pose=localizer.estimate(state), state=state)
            self._answers.clear()

    def _check(self, ordered: list[Step]) -> None:
        pending: dict[int, Step] = {}
        for step in ordered:
            before = pending.get(step.seq) or self._applied.get(step.seq)
            if before is not None and before != step:
                message = f"step {step.seq} was given before with other content"
                raise SequenceConflictError(message)
            if before is None and step.seq <= self._fix.seq:
                message = f"step {step.seq} lies before step {self._fix.seq}, already applied"
                raise SequenceConflictError(message)
            pending[step.seq] = step

    def _advance(self, step: Step) -> None:
        duration = 1.0
        if step.t is not None and self._fix.t is not None:
            duration = max(0.0, step.t - self._fix.t)
        measured = self.site.measure(step.readings, self.sensor) if step.readings else None
        delta, self._own_motion = self._own_motion.onward(step.motion, duration)
        self.localizer = self.localizer.run_by(self._backend())
        weighed = None if measured is None else measured.by(self.sensor.kind)
        state, pose = self.localizer.step(self._fix.state, delta, weighed)
        self._fix = Fix(step.seq, step.t, pose, measured, state)
        self._track = self._track.onward(delta)
        if self._contributes and step.readings:
            self._contributed.append(self._scan(step))
        self._applied[step.seq] = step
        _forget_oldest(self._applied)

    def contributions(self) -> list[StoredScan]:
        """Return the scans that have come since the last call, as ones of the crowd."""
        with self._lock:
            given, self._contributed = self._contributed, []
        return given

    def _scan(self, step: Step) -> StoredScan:
        """Return the scan of a step, at the place that the device's own motion says."""
        moment_s = float(step.seq) if step.t is None else step.t
        track = {
            "id": self.name,
            "x_m": self._track.forward_m,
            "y_m": self._track.left_m,
            "heading_rad": None,
        }
        device = f"session {self.name}"
        return StoredScan(device, str(step.seq), moment_s, step.readings, track)


def _forget_oldest(remembered: OrderedDict[int, Any]) -> None:
    while len(remembered) > _REMEMBERED:
        remembered.popitem(last=False)


class SessionTable:
    """All live sessions.

    Parameters
    ----------
    capacity : int
        How many there may be.
    backend : callable
        Returns what runs the filters now.
    """

    def __init__(self, capacity: int, backend: Callable[[], Backend] = fastest) -> None:
        self._capacity = capacity
        self._backend = backend
        self._lock = threading.Lock()
        self._sessions: dict[str, Session] = {}

    def open(
        self,
        site: Site,
        map_version: MapVersion,
        localizer: homsense.Localizer,
        sensor: Sensor,
        seed: int | None,
        *,
        contribute: bool,
    ) -> Session:
        """Start a session; draw a seed when none is given."""
        chosen = secrets.randbits(64) if seed is None else seed
        name = secrets.token_urlsafe(12)
        session = Session(
            name,
            site,
            map_version,
            localizer,
            sensor,
            seed=chosen,
            contribute=contribute,
            backend=self._backend,
        )
        with self._lock:
            if len(self._sessions) >= self._capacity:
                message = f"there are {self._capacity} sessions already"
                raise CapacityError(message)
            self._sessions[name] = session
        return session

    def get(self, name: str) -> Session:
        """Return a session or raise `SessionNotFoundError`."""
        try:
            return self._sessions[name]
        except KeyError:
            message = f"there is no session {name!r}"
            raise SessionNotFoundError(message) from None

    def close(self, name: str) -> None:
        """Forget a session."""
        with self._lock:
            self.get(name)
            del self._sessions[name]

    def close_site(self, site: Site) -> None:
        """Forget all sessions of a site."""
        with self._lock:
            gone = [name for name, session in self._sessions.items() if session.site is site]
            for name in gone:
                del self._sessions[name]

    def __len__(self) -> int:
        return len(self._sessions)
