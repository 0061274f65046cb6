"""A live session: a course that goes on only when the disk has what leads on."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from homsense.backend import Backend
from homsense_service import journaling
from homsense_service.errors import SequenceConflictError, StoreError
from homsense_service.journaling import Moved, Taken, fingerprint
from homsense_service.records import Event, SessionRecord, Snapshot, StoredReading, StoredScan
from homsense_service.runs import Course, Fix, Run, Step
from homsense_service.site import Site
from homsense_service.store import Artifacts, Committed, Store
from homsense_service.watching import Watch

REPEATABLE = 256
SNAPSHOT_EVERY = 256
_ANSWERS = 8

Answer = TypeVar("Answer")
Restore = Callable[[dict[str, Any]], Run]


class Means(NamedTuple):
    """What a session needs of the service.

    Parameters
    ----------
    store : Store
        Has its journal.
    restore : callable
        Returns the run that a document tells of.
    backend : callable
        Returns what runs the filter now.
    watch : callable
        Takes the time of a stage.
    turn : context manager
        Lets so many sessions calculate at once as is good for all.
    """

    store: Store
    restore: Restore
    backend: Callable[[], Backend]
    watch: Watch
    turn: AbstractContextManager[object]


class RestingError(Exception):
    """The session has left the memory in between; it is to be asked for again."""


class Session:
    """One device's run on a site.

    Parameters
    ----------
    record : SessionRecord
        As it was opened.
    site : Site
        Where it runs.
    course : Course
        Before the first event.
    means : Means
        What it needs of the service.
    """

    def __init__(
        self,
        record: SessionRecord,
        site: Site,
        course: Course,
        means: Means,
    ) -> None:
        self.record, self.name, self.site = record, record.name, site
        self.contributes = bool(record.document["contribute"])
        self.seed = int(record.document["seed"])
        self._store, self._means = means.store, means
        self._lock = threading.Lock()
        self._is_resting = False
        self._course = course
        self._first_run = course.fix.run
        self._snapshot_at = 0
        self._fingerprints: OrderedDict[int, bytes] = OrderedDict()
        self._answers: OrderedDict[int, Any] = OrderedDict()

    @property
    def fix(self) -> Fix:
        """The latest state that is on disk."""
        return self._course.fix

    @property
    def run(self) -> Run:
        """What it localizes with."""
        return self._course.fix.run

    def resume(self) -> None:
        """Go on from the journal, as if the session had never been interrupted.

        Raises
        ------
        StoreError
            If the journal is damaged.
        """
        self._course = self._replayed(self._store.snapshots(self.name))

    def apply(
        self, steps: list[Step], answer: Callable[[Fix], Answer], committed: Committed
    ) -> Answer:
        """Apply steps in the order of `seq`; those applied before change nothing.

        Parameters
        ----------
        steps : list of Step
            At least one.
        answer : callable
            Makes the answer from the state after the last step.
        committed : callable
            Told the scans that join the crowd of the site.

        Returns
        -------
        Answer
            The same as before when all steps were applied before. The steps are on disk.

        Raises
        ------
        SequenceConflictError
            If a step lies in the past and is unknown, forgotten or different; then none of the
            steps is applied.
        StoreError
            If the steps cannot be kept; then none is applied.
        RestingError
            If it has left the memory.
        """
        ordered = sorted(steps, key=lambda step: step.seq)
        given = {step.seq: fingerprint(step) for step in ordered}
        last = ordered[-1].seq
        with self._lock:
            self._check_awake()
            self._check(ordered, given)
            if last <= self.fix.seq:
                return self._answer_again(last, answer)
            course, events, scans = self._course, list[Event](), list[StoredScan]()
            with self._means.turn:
                for step in ordered:
                    if step.seq <= course.fix.seq:
                        continue
                    course = self._onward(course, step)
                    events.append(
                        journaling.taken(course, step, given[step.seq], told=step.seq == last)
                    )
                    if self.contributes and step.readings:
                        scans.append(self._scan(course, step))
                made = answer(course.fix)
            added = (self.site.name, scans, committed) if scans else None
            self._store.journal(self.name, events, scans=added)
            self._course = course
            self._fingerprints.update((event.seq, event.fingerprint) for event in events)
            self._answers[last] = made
            _forget_oldest(self._fingerprints, SNAPSHOT_EVERY // 8)
            _forget_oldest(self._answers, _ANSWERS)
            if course.number - self._snapshot_at >= SNAPSHOT_EVERY:
                self._snapshot_at = course.number
                self._store.put_snapshot(self.name, journaling.snapshot(course))
            return made

    def answered(self, answer: Callable[[Fix], Answer]) -> Answer:
        """Return the answer to the latest step, as it was given if it is still known.

        Parameters
        ----------
        answer : callable
            Makes the answer from the state after the step; always the same one.

        Returns
        -------
        Answer
            Nothing is applied.
        """
        fix = self.fix
        known: Answer | None = self._answers.get(fix.seq)
        return answer(fix) if known is None else known

    def apply_again(
        self, seq: int, readings: tuple[StoredReading, ...], answer: Callable[[Fix], Answer]
    ) -> Answer:
        """Answer a scan that was taken before, whatever motion it was taken with.

        Parameters
        ----------
        seq : int
            Number of its step, not beyond the latest.
        readings : tuple of StoredReading
            What was heard.
        answer : callable
            Makes the answer from the state after the step.

        Returns
        -------
        Answer
            The same as before.

        Raises
        ------
        SequenceConflictError
            If the step is unknown, forgotten or has heard something else.
        RestingError
            If it has left the memory.
        """
        event = self._store.step(self.name, seq)
        if event is None:
            raise SequenceConflictError(_unknown(seq, self.fix.seq))
        before = journaling.read(event)
        assert isinstance(before, Taken)
        step = replace(before.step, readings=readings)
        return self.apply([step], answer, lambda _added: None)

    def migrate(self, run: Run, document: dict[str, Any], artifacts: Artifacts) -> None:
        """Go on with another map: particles stay, those that it has no room for lose weight."""
        with self._lock:
            self._check_awake()
            if run.map_version.digest == self.run.map_version.digest:
                return
            course = self._course.moved(run)
            event = journaling.moved(course, document)
            self._store.journal(self.name, [event], artifacts=artifacts)
            self._course = course
            self._answers.clear()

    def rest(self) -> bool:
        """Leave the memory, unless it is at work; the journal has everything."""
        if not self._lock.acquire(blocking=False):
            return False
        self._is_resting = True
        self._lock.release()
        return True

    def _check_awake(self) -> None:
        if self._is_resting:
            raise RestingError

    def replayed_from_start(self) -> Course:
        """Return what the journal alone leads to."""
        return self._replayed(())

    def _check(self, ordered: list[Step], given: dict[int, bytes]) -> None:
        doubles: dict[int, Step] = {}
        for step in ordered:
            if doubles.setdefault(step.seq, step) != step:
                raise SequenceConflictError(_different(step.seq))
        past = [step.seq for step in ordered if step.seq <= self.fix.seq]
        if not past:
            return
        known: dict[int, bytes] = dict(self._fingerprints)
        if not known.keys() >= set(past):
            known = self._store.fingerprints(self.name, past[0], past[-1])
        for seq in past:
            if seq not in known:
                raise SequenceConflictError(_unknown(seq, self.fix.seq))
            if known[seq] != given[seq]:
                raise SequenceConflictError(_different(seq))

    def _answer_again(self, seq: int, answer: Callable[[Fix], Answer]) -> Answer:
        if seq == self.fix.seq:
            return self.answered(answer)
        known: Answer | None = self._answers.get(seq)
        if known is not None:
            return known
        if seq < self.fix.seq - REPEATABLE:
            message = f"step {seq} lies so far before step {self.fix.seq} that its answer is gone"
            raise SequenceConflictError(message)
        return answer(self._replayed(self._store.snapshots(self.name), seq).fix)

    def _onward(self, course: Course, step: Step) -> Course:
        sensor = course.fix.run.sensor
        measured = None
        if step.readings:
            with self._means.watch("measure"):
                measured = self.site.measure(step.readings, sensor, course.seen_near)
        with self._means.watch("filter"):
            return course.onward(step, measured, self._means.backend)

    def _replayed(self, snapshots: Iterable[Snapshot], through_seq: int | None = None) -> Course:
        """Return the course after a step, or after all events, from the latest snapshot before."""
        runs = self._runs()
        course = self._latest(snapshots, runs, through_seq)
        for event in self._store.events(self.name, course.number):
            if through_seq is not None and course.fix.seq >= through_seq:
                break
            if event.number != course.number + 1:
                message = f"session {self.name}: event {course.number + 1} is missing"
                raise StoreError(message)
            found = journaling.read(event)
            if isinstance(found, Moved):
                course = course.moved(runs[event.number])
                continue
            course = course.onward(found.step, found.measured, self._means.backend)
            if found.digest is not None and course.fix.digest != found.digest:
                message = f"session {self.name} does not replay: step {event.seq} differs"
                raise StoreError(message)
        return course

    def _runs(self) -> dict[int, Run]:
        """Return what the session has localized with, by the event from which on."""
        runs = {0: self._first_run}
        for event in self._store.moves(self.name):
            moved = journaling.read(event)
            assert isinstance(moved, Moved)
            runs[event.number] = self._means.restore(moved.run)
        return runs

    def _latest(
        self, snapshots: Iterable[Snapshot], runs: dict[int, Run], through_seq: int | None
    ) -> Course:
        """Return the latest snapshot that is sound and not beyond a step, or the start."""
        for kept in snapshots:
            run = runs[max(number for number in runs if number <= kept.number)]
            course = journaling.resumed(kept, run)
            if course is not None and (through_seq is None or course.fix.seq <= through_seq):
                return course
        return Course.begun(self._first_run, self.seed)

    def _scan(self, course: Course, step: Step) -> StoredScan:
        """Return the scan of a step, at the place that the device's own motion says."""
        moment_s = float(step.seq) if step.t is None else step.t
        track = {
            "id": self.name,
            "x_m": course.track.forward_m,
            "y_m": course.track.left_m,
            "heading_rad": None,
        }
        device = f"session {self.name}"
        return StoredScan(device, str(step.seq), moment_s, step.readings, track)


def _different(seq: int) -> str:
    return f"step {seq} was given before with other content"


def _unknown(seq: int, latest: int) -> str:
    return f"step {seq} lies before step {latest}, already applied"


def _forget_oldest(remembered: OrderedDict[int, Any], most: int) -> None:
    while len(remembered) > most:
        remembered.popitem(last=False)
