"""What a site learns in the background: the latest is kept while it is learnt anew."""

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooLate
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

import homsense
from homsense.backend import Backend, fastest
from homsense.engine import Engine
from homsense_service.errors import ServiceError
from homsense_service.garbage import let_go
from homsense_service.versions import MapVersion

Question = TypeVar("Question", bound="OfMap")
Known = TypeVar("Known", bound="ForMap")
Work = TypeVar("Work")

GROWN = 1.25
_STOPPED = "the service stops"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the work is."""

    state: Literal["none", "building", "ready", "failed"]
    done: int = 0
    reason: str | None = None


class Builder:
    """Does one piece of work after the other.

    Parameters
    ----------
    engine : callable
        Returns what runs the hot loops.
    backend : callable, optional
        Returns what runs the filter.
    most_waiting : int, default 128
        How many may wait for a result at once.
    """

    def __init__(
        self,
        engine: Callable[[], Engine],
        backend: Callable[[], Backend] = fastest,
        most_waiting: int = 128,
    ) -> None:
        self.engine, self.backend = engine, backend
        self.seats = threading.BoundedSemaphore(most_waiting)
        self.pool = ThreadPoolExecutor(1, thread_name_prefix="learning")
        self.stopping = threading.Event()

    def submit(self, work: Callable[[Work], None], on: Work) -> None:
        """Do something small when there is time."""
        if not self.stopping.is_set():
            self.pool.submit(work, on)

    def close(self) -> None:
        """Stop after the step at hand."""
        self.stopping.set()
        self.pool.shutdown(cancel_futures=True)


class OfMap(Protocol):
    """A question about a map and so many scans."""

    @property
    def map_version(self) -> MapVersion:
        """The map."""
        ...

    @property
    def scans(self) -> int:
        """How many there are."""
        ...

    @property
    def conditions(self) -> Hashable:
        """What else decides the answer; it is learnt anew when this changes."""
        ...


class ForMap(Protocol):
    """What is known for a map."""

    @property
    def map_digest(self) -> str:
        """The map."""
        ...


@dataclass(frozen=True, slots=True)
class Words:
    """How to tell that something is not known yet, or cannot be.

    Parameters
    ----------
    doing, cannot : str
        What goes on, and what has failed.
    steps : int
        How many the work has.
    pending, failed : type of ServiceError
        The errors.
    """

    doing: str
    cannot: str
    steps: int
    pending: type[ServiceError]
    failed: type[ServiceError]


class Asked(NamedTuple):
    """What is remembered of a question."""

    map_digest: str
    conditions: Hashable
    scans: int


class Background(ABC, Generic[Question, Known]):
    """One thing that a site learns about its map from its scans.

    What cannot be learnt from these scans is not tried again before there are more of them.

    Parameters
    ----------
    builder : Builder
        Does the work.
    words : Words
        For those who ask too early, or in vain.
    grown : float, default 1.25
        Scans, relative to those it was learnt from, from which on it is learnt anew.
    """

    def __init__(self, builder: Builder, words: Words, grown: float = GROWN) -> None:
        self._builder, self.words, self._grown = builder, words, grown
        self._lock = threading.Lock()
        self._building: Future[Known] | None = None
        self._asked: Asked | None = None
        self._in_vain: Future[Known] | None = None
        self.current: Known | None = None
        self.progress = Progress("none")

    @abstractmethod
    def _build(self, question: Question, on_step: Callable[[int], None]) -> Known:
        """Answer a question; tell a function how many steps are done."""

    def refresh(self, question: Question) -> Future[Known] | None:
        """Begin to work when map, scans or conditions have changed, unless that goes on already.

        Parameters
        ----------
        question : Question
            The site as it is now.

        Returns
        -------
        Future, optional
            None when what is known still holds; the last one when it was in vain and would be so
            again.
        """
        with self._lock:
            if self._building is not None:
                return self._building
            if self._holds(question):
                return self._in_vain
            self.progress = Progress("building")
            self._building = building = self._builder.pool.submit(self._work, question)
        building.add_done_callback(_let_go_of_failure)
        return building

    def at_hand(self, question: Question) -> Known | None:
        """Return what is known about a map, however old; begin to learn it when that is needed.

        Parameters
        ----------
        question : Question
            The site as it is now.

        Returns
        -------
        Known or None
            For the map of the question.
        """
        self.refresh(question)
        known = self.current
        is_same_map = known is not None and known.map_digest == question.map_version.digest
        return known if is_same_map else None

    def learnt(self, question: Question, wait_s: float) -> Known:
        """Return what is known about a map; an older state of the same map while it is redone.

        Parameters
        ----------
        question : Question
            The site as it is now.
        wait_s : float
            How long to wait when nothing is known about this map, seconds; not at all when too
            many wait already.

        Returns
        -------
        Known
            For the map of the question.

        Raises
        ------
        ServiceError
            Of the kinds in `words`: if it is not ready in time, or cannot be learnt.
        """
        while (known := self.at_hand(question)) is None:
            if (building := self.refresh(question)) is None:
                continue
            has_seat = self._builder.seats.acquire(blocking=False)
            try:
                error = building.exception(wait_s if has_seat else 0.0)
            except TooLate:
                message = f"{self.words.doing}: {self.progress.done} of {self.words.steps}"
                raise self.words.pending(message) from None
            finally:
                if has_seat:
                    self._builder.seats.release()
            if error is not None:
                message = f"{self.words.cannot}: {error}"
                raise self.words.failed(message)
        return known

    def _holds(self, question: Question) -> bool:
        asked = self._asked
        return (
            asked is not None
            and asked.map_digest == question.map_version.digest
            and asked.conditions == question.conditions
            and asked.scans <= question.scans <= self._grown * asked.scans
        )

    def _work(self, question: Question) -> Known:
        asked = Asked(question.map_version.digest, question.conditions, question.scans)
        try:
            known = self._build(question, self._on_step)
        except BaseException as error:
            is_lasting = isinstance(error, homsense.HomsenseError)
            if not (is_lasting or self._builder.stopping.is_set()):
                _log.exception("%s", self.words.cannot)
            with self._lock:
                self.progress = Progress("failed", reason=str(error))
                self._asked = asked if is_lasting else None
                self._in_vain, self._building = self._building, None
            raise
        with self._lock:
            self.current = known
            self.progress = Progress("ready", self.progress.done)
            self._asked, self._in_vain, self._building = asked, None, None
        return known

    def _on_step(self, done: int) -> None:
        if self._builder.stopping.is_set():
            raise RuntimeError(_STOPPED)
        self.progress = Progress("building", done)


def _let_go_of_failure(building: Future[Known]) -> None:
    """Free what a failed work was at; that it has failed is remembered for long."""
    if not building.cancelled():
        let_go(building.exception())
