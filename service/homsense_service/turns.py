"""Who asks at the same time takes turns, and some share an answer."""

import itertools
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar, cast
from weakref import WeakValueDictionary

from homsense_service.errors import OverloadError

Answer = TypeVar("Answer")

MOST_WAITING = 8


class Turns:
    """A lock for each name, there as long as somebody holds it or waits for it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._turns: WeakValueDictionary[str, threading.Lock] = WeakValueDictionary()

    def of(self, name: str) -> threading.Lock:
        """Return the lock of a name."""
        with self._lock:
            return self._turns.setdefault(name, threading.Lock())


class Questions:
    """Questions that take seconds: few wait, one is answered at a time, and the same one once."""

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._seats = threading.BoundedSemaphore(MOST_WAITING)
        self._ticks = itertools.count()
        self._latest: OrderedDict[Hashable, tuple[int, Any]] = OrderedDict()

    def answer(self, question: Hashable, find: Callable[[], Answer]) -> Answer:
        """Return an answer that was looked for after it was asked for.

        Parameters
        ----------
        question : hashable
            Names it.
        find : callable
            Looks for the answer, when nobody who waited has done so.

        Returns
        -------
        Answer
            That of `find`, or of the one that somebody else gave for the same question.

        Raises
        ------
        OverloadError
            If too many wait already.
        """
        asked = next(self._ticks)
        if not self._seats.acquire(blocking=False):
            message = f"{MOST_WAITING} questions that take long wait already"
            raise OverloadError(message)
        try:
            with self._turn:
                begun, shared = self._latest.get(question, (-1, None))
                if begun > asked:
                    return cast(Answer, shared)
                begun, found = next(self._ticks), find()
                self._latest[question] = begun, found
                self._latest.move_to_end(question)
                if len(self._latest) > MOST_WAITING:
                    self._latest.popitem(last=False)
                return found
        finally:
            self._seats.release()
