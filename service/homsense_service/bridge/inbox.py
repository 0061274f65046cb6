"""Numbered inputs, as they come, become steps of a session: in order, each once.

The numbers of a device rise by one with each motion and each scan. Messages may come late, twice
or never: what is on disk already is left out; a hole is waited for, then guessed, with as much
doubt as it is long; and what piles up while the service is busy becomes one longer motion.
"""

from bisect import insort
from typing import NamedTuple

import homsense
from homsense_service.bridge.inputs import Input, Moving, Scan
from homsense_service.own_motion import Motion
from homsense_service.runs import Step

PATIENCE_S = 0.2
MOST_WAITING = 4096


class Plan(NamedTuple):
    """What is to be done.

    Parameters
    ----------
    steps : list of Step
        In order; their numbers are those of the last inputs in them.
    lost : int
        How many inputs never came.
    wake_s : float, optional
        When there may be more to do.
    """

    steps: list[Step]
    lost: int
    wake_s: float | None


class _Waiting(NamedTuple):
    came_s: float
    given: Input


class Inbox:
    """The inputs of one device that are not on disk yet.

    Parameters
    ----------
    through : int
        Number of the last input on disk.
    t : float, optional
        Its time, seconds.
    pause_s : float
        Motion alone makes a step no more often than that, seconds.
    """

    def __init__(self, through: int, t: float | None, pause_s: float) -> None:
        self.through, self._t, self._pause_s = through, t, pause_s
        self._waiting: list[_Waiting] = []
        self._scans = 0
        self._pace: Moving | None = None
        self._stepped_s = float("-inf")

    def put(self, given: Input, now_s: float) -> bool:
        """Take an input; tell whether there was room for it.

        Parameters
        ----------
        given : Input
            Nothing happens when it is on disk already.
        now_s : float
            When it came, seconds.

        Returns
        -------
        bool
            False when the oldest had to go, so that it will be missing.
        """
        if given.following > self.through + 1:
            insort(self._waiting, _Waiting(now_s, given), key=lambda w: w.given.first)
            self._scans += isinstance(given, Scan)
        if len(self._waiting) <= MOST_WAITING:
            return True
        gone = self._waiting.pop(0)
        self._scans -= isinstance(gone.given, Scan)
        return False

    @property
    def due_s(self) -> float:
        """When there is something to plan, seconds; never when nothing waits."""
        if self._scans:
            return float("-inf")
        return self._stepped_s + self._pause_s if self._waiting else float("inf")

    def plan(self, now_s: float) -> Plan:
        """Return the steps that can be taken now; they stay here until they were `taken`."""
        due_s = self.due_s
        if now_s < due_s:
            return Plan([], 0, due_s if self._waiting else None)
        walk = _Walk(self.through + 1, self._t, self._pace)
        wake_s = None
        for came_s, given in self._waiting:
            if given.following <= walk.at:
                continue
            if given.first > walk.at:
                if now_s < came_s + PATIENCE_S:
                    wake_s = came_s + PATIENCE_S
                    break
                walk.leap(given)
            walk.go(given)
        free_s = self._stepped_s + self._pause_s
        if walk.steps or now_s >= free_s:
            walk.stop()
        elif walk.moved:
            wake_s = free_s if wake_s is None else min(wake_s, free_s)
        return Plan(walk.steps, walk.lost, wake_s)

    def taken(self, steps: list[Step], now_s: float) -> None:
        """Forget what is on disk now."""
        last = steps[-1]
        self.go_on_from(last.seq, last.t)
        self._stepped_s = now_s

    def go_on_from(self, number: int, t: float | None) -> None:
        """Forget all inputs up to a number."""
        gone = [w.given for w in self._waiting if w.given.following <= number + 1]
        self._waiting = [w for w in self._waiting if w.given.following > number + 1]
        motion = [given for given in gone if not isinstance(given, Scan)]
        self._scans -= len(gone) - len(motion)
        self._pace = motion[-1] if motion else self._pace
        self.through, self._t = number, t


class _Walk:
    """From one input to the next."""

    def __init__(self, at: int, t: float | None, pace: Moving | None) -> None:
        self.at, self._t, self._pace = at, t, pace
        self.steps: list[Step] = []
        self.moved: list[Moving] = []
        self.lost = 0

    def leap(self, given: Input) -> None:
        """Cross a hole before an input."""
        self.stop()
        missing = given.first - self.at
        self.lost += missing
        self.at = given.first
        pace = self._pace if isinstance(given, Scan) else given
        if pace is not None:
            duration_s = missing * float(pace.durations_s.mean())
            self._step(pace.guessed(missing), duration_s)

    def go(self, given: Input) -> None:
        """Cross an input, as far as it is new."""
        if isinstance(given, Scan):
            motion, duration_s = self._gathered()
            self.at = given.following
            self._step(motion, duration_s, given)
            return
        fresh = given if given.first == self.at else given.from_number(self.at)
        if self.moved and not fresh.continues(self.moved):
            self.stop()
        self.moved.append(fresh)
        self._pace = fresh
        self.at = fresh.following

    def stop(self) -> None:
        """Make a step of the motion so far."""
        if self.moved:
            self._step(*self._gathered())

    def _gathered(self) -> tuple[Motion, float]:
        """Return the motion since the last step and its duration, seconds."""
        if not self.moved:
            return homsense.Delta(), 0.0
        whole = self.moved[0].joined(self.moved[1:])
        self.moved = []
        return whole.motion(), float(whole.durations_s.sum())

    def _step(self, motion: Motion, duration_s: float, scan: Scan | None = None) -> None:
        if scan is not None and scan.t is not None:
            self._t = scan.t
        elif duration_s > 0.0:
            self._t = (self._t or 0.0) + duration_s
        readings = () if scan is None else scan.readings
        self.steps.append(Step(self.at - 1, self._t, motion, readings))
