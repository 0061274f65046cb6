"""A session as a value: what it has been given so far decides it, to the last bit."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import homsense
from homsense.backend import Backend
from homsense_service.own_motion import Motion, OwnMotion
from homsense_service.records import StoredReading
from homsense_service.sensors import Measured, Sensor
from homsense_service.versions import MapVersion


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


@dataclass(frozen=True, eq=False)
class Run:
    """What a session localizes with; a later map of its site does not change it.

    Parameters
    ----------
    map_version : MapVersion
        The map.
    wall_tolerance_m : float
        How far behind its walls a device may be, metres.
    sensor : Sensor
        How it measures.
    localizer : homsense.Localizer
        The filter.
    """

    map_version: MapVersion
    wall_tolerance_m: float
    sensor: Sensor
    localizer: homsense.Localizer


@dataclass(frozen=True, eq=False)
class Fix:
    """The state of a session after a step.

    Parameters
    ----------
    seq : int
        Number of the step; 0 before the first.
    t : float, optional
        Time of the step as the device gave it, seconds.
    measured : Measured, optional
        The measurement that was used; none without a scan.
    level : int, optional
        How much the last scan resembles the crowd; none before the first.
    state : homsense.LocalizerState
        What the filter remembers.
    run : Run
        What it localizes with.
    """

    seq: int
    t: float | None
    measured: Measured | None
    level: int | None
    state: homsense.LocalizerState
    run: Run

    @property
    def pose(self) -> homsense.PoseDistribution:
        """What is known; made anew each time."""
        return self.run.localizer.estimate(self.state)

    @cached_property
    def digest(self) -> str:
        """Hash of the particles."""
        return self.state.digest()


@dataclass(frozen=True, eq=False)
class Course:
    """A session after some events.

    Parameters
    ----------
    fix : Fix
        Where it is.
    number : int
        How many events there were.
    own_motion : OwnMotion
        What the last motion leaves to the next.
    track : homsense.Travel
        Way since the start, by the device's own account.
    seen : tuple of frozenset of str
        What the last scans have heard, as far as the next one needs it.
    """

    fix: Fix
    number: int = 0
    own_motion: OwnMotion = field(default_factory=OwnMotion)
    track: homsense.Travel = field(default_factory=lambda: homsense.Travel(credit_m=0.0))
    seen: tuple[frozenset[str], ...] = ()

    @property
    def seen_near(self) -> tuple[frozenset[str], ...]:
        """The same; nothing when that was so far away that the error of a count is new."""
        way_m = self.fix.state.travel.length_m
        is_near = way_m <= self.fix.run.localizer.likelihood.correlation_m
        return self.seen if is_near else ()

    @classmethod
    def begun(cls, run: Run, seed: int) -> "Course":
        """Return a session before its first step."""
        return cls(Fix(0, None, None, None, run.localizer.start(seed), run))

    def onward(
        self, step: Step, measured: Measured | None, backend: Callable[[], Backend]
    ) -> "Course":
        """Return the session after one more step.

        Parameters
        ----------
        step : Step
            What the device has given.
        measured : Measured, optional
            What its scan was worth.
        backend : callable
            Returns what runs the filter now; results do not depend on it.

        Returns
        -------
        Course
            This one stays valid.
        """
        before = self.fix
        duration = 1.0
        if step.t is not None and before.t is not None:
            duration = max(0.0, step.t - before.t)
        delta, own_motion = self.own_motion.onward(step.motion, duration)
        sensor = before.run.sensor
        weighed = None if measured is None else measured.by(sensor.kind)
        localizer = before.run.localizer.run_by(backend())
        state, _ = localizer.step(before.state, delta, weighed)
        run = (
            before.run
            if localizer is before.run.localizer
            else replace(before.run, localizer=localizer)
        )
        sighting = None if measured is None else measured.sighting
        level = before.level if sighting is None else sighting.highest
        fix = Fix(step.seq, step.t, measured, level, state, run)
        seen = self.seen if measured is None else measured.seen
        return Course(fix, self.number + 1, own_motion, self.track.onward(delta), seen)

    def moved(self, run: Run) -> "Course":
        """Return the session on another map: particles that it has no room for lose weight."""
        state = run.localizer.migrate(self.fix.state)
        return replace(self, fix=replace(self.fix, state=state, run=run), number=self.number + 1)
