"""What a site learns in the background: the latest is kept while it is learnt anew."""

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as TooLate
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import homsense
from homsense.engine import Engine

Question = TypeVar("Question")
Known = TypeVar("Known")

_STOPPED = "the service stops"


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
    """

    def __init__(self, engine: Callable[[], Engine]) -> None:
        self.engine = engine
        self.pool = ThreadPoolExecutor(1, thread_name_prefix="learning")
        self.stopping = threading.Event()

    def close(self) -> None:
        """Stop after the step at hand."""
        self.stopping.set()
        self.pool.shutdown(cancel_futures=True)


class NotReadyError(Exception):
    """The work goes on."""


class CannotError(Exception):
    """The work has failed."""


class Background(Generic[Question, Known]):
    """One thing that a site learns.

    Parameters
    ----------
    builder : Builder
        Does the work.
    build : callable
        Answers a question; tells a function how many steps are done.
    holds : callable
        Whether what is known still answers a question well enough.
    """

    def __init__(
        self,
        builder: Builder,
        build: Callable[[Question, Callable[[int], None]], Known],
        holds: Callable[[Known, Question], bool],
    ) -> None:
        self._builder, self._build, self._holds = builder, build, holds
        self._lock = threading.Lock()
        self._building: Future[Known] | None = None
        self.current: Known | None = None
        self.progress = Progress("none")

    def refresh(self, question: Question) -> Future[Known] | None:
        """Begin to work when what is known does not hold, unless that goes on already.

        Parameters
        ----------
        question : Question
            The site as it is now.

        Returns
        -------
        Future, optional
            None when what is known still holds.
        """
        with self._lock:
            known = self.current
            if self._building is None and (known is None or not self._holds(known, question)):
                self.progress = Progress("building")
                self._building = self._builder.pool.submit(self._work, question)
            return self._building

    def found(self, question: Question, wait_s: float) -> Known:
        """Return the answer to a question, however old, if there is none yet after a while.

        Parameters
        ----------
        question : Question
            The site as it is now.
        wait_s : float
            How long to wait, seconds.

        Returns
        -------
        Known
            What the work in progress gives, or what is known.

        Raises
        ------
        NotReadyError
            If it takes longer.
        CannotError
            If it cannot be told.
        """
        building = self.refresh(question)
        if building is None:
            assert self.current is not None
            return self.current
        try:
            return building.result(wait_s)
        except TooLate:
            raise NotReadyError from None
        except (homsense.HomsenseError, RuntimeError) as error:
            raise CannotError(str(error)) from error

    def _work(self, question: Question) -> Known:
        try:
            known = self._build(question, self._on_step)
        except BaseException as error:
            self._finish(Progress("failed", reason=str(error)))
            raise
        self.current = known
        self._finish(Progress("ready", self.progress.done))
        return known

    def _finish(self, progress: Progress) -> None:
        with self._lock:
            self.progress, self._building = progress, None

    def _on_step(self, done: int) -> None:
        if self._builder.stopping.is_set():
            raise RuntimeError(_STOPPED)
        self.progress = Progress("building", done)
