"""Group commit: one thread, one connection, one transaction for all that waits.

The more callers wait, the more of them share one synchronization of the disk.
"""

import contextlib
import queue
import sqlite3
import threading
import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeVar

from homsense_service.errors import OverloadError, ServiceError, StoreError
from homsense_service.garbage import let_go

Result = TypeVar("Result")
Job = Callable[[sqlite3.Connection], Result]

MOST_WAITING = 4096
MOST_TOGETHER = 512
_CLOSED = "the store is closed"
_BROKEN = ("SQLITE_IOERR", "SQLITE_CORRUPT", "SQLITE_NOTADB")


class _Waiting(NamedTuple):
    job: Job[Any]
    done: Callable[[Any], None]
    future: "Future[Any]"
    since_s: float


class Writer:
    """The only one that writes to a database.

    Parameters
    ----------
    connection : sqlite3.Connection
        In autocommit mode; the thread of the writer alone uses it from now on.
    clock : callable
        Returns seconds that never go back.
    on_failure : callable
        Told when a transaction was lost.
    """

    def __init__(
        self,
        connection: sqlite3.Connection,
        clock: Callable[[], float],
        on_failure: Callable[[], None],
    ) -> None:
        self._connection, self._clock = connection, clock
        self._on_failure = on_failure
        self.on_commit: Callable[[float, int], None] = lambda _seconds, _jobs: None
        self._urgent: queue.SimpleQueue[_Waiting | None] = queue.SimpleQueue()
        self._later: deque[_Waiting] = deque(maxlen=MOST_TOGETHER)
        self._oldest_s: float | None = None
        self._broken: str | None = None
        self._thread = threading.Thread(target=self._run, name="store writer", daemon=True)
        self._thread.start()

    def run(self, job: Job[Result], done: Callable[[Result], None] = lambda _: None) -> Result:
        """Run a job in the next transaction and return when that is on disk.

        Parameters
        ----------
        job : callable
            Takes the connection; whatever it raises undoes the job and no other.
        done : callable, optional
            Told the result once it is on disk, in the order of the transactions.

        Returns
        -------
        Result
            Of the job.

        Raises
        ------
        OverloadError
            If too many wait already.
        StoreError
            If it could not be written.
        """
        if self._broken is not None:
            raise StoreError(self._broken)
        if self._urgent.qsize() >= MOST_WAITING:
            message = f"{MOST_WAITING} requests wait for the disk"
            raise OverloadError(message)
        future: Future[Result] = Future()
        self._urgent.put(_Waiting(job, done, future, self._clock()))
        try:
            return future.result()
        finally:
            del future

    def run_later(self, job: Job[None]) -> None:
        """Run a job some time soon; when too many wait, the oldest is forgotten."""
        self._later.append(_Waiting(job, lambda _: None, Future(), self._clock()))

    def age_s(self) -> float:
        """Return how long the transaction at hand goes on, seconds; 0 between two."""
        since = self._oldest_s
        return 0.0 if since is None else self._clock() - since

    def check(self) -> None:
        """Raise `StoreError` when nothing can be written any more."""
        if self._broken is not None:
            raise StoreError(self._broken)

    def close(self) -> None:
        """Write what waits, then stop."""
        self._broken = _CLOSED
        self._urgent.put(None)
        self._thread.join()
        self._connection.close()

    def _run(self) -> None:
        while self._write_next():
            pass
        while self._later:
            self._write([self._later.popleft()])
        while not self._urgent.empty():
            if (late := self._urgent.get()) is not None:
                late.future.set_exception(StoreError(_CLOSED))

    def _write_next(self) -> bool:
        """Write what waits, at least one; False once the writer shall stop."""
        if (first := self._urgent.get()) is None:
            return False
        together = [first]
        stop = False
        while len(together) < MOST_TOGETHER and not self._urgent.empty():
            entry = self._urgent.get()
            if entry is None:
                stop = True
                break
            together.append(entry)
        with contextlib.suppress(IndexError):
            together.append(self._later.popleft())
        self._oldest_s = together[0].since_s
        self._write(together)
        self._oldest_s = None
        return not stop

    def _write(self, together: list[_Waiting]) -> None:
        started_s = self._clock()
        results: list[tuple[_Waiting, Any]] = []
        refused: list[tuple[_Waiting, BaseException]] = []
        try:
            self._connection.execute("BEGIN IMMEDIATE")
            for entry in together:
                try:
                    results.append((entry, self._alone(entry.job)))
                except BaseException as error:
                    refused.append((entry, _named(error)))
                    if not self._connection.in_transaction:
                        raise
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            self._give_up(together, error)
            return
        self.on_commit(self._clock() - started_s, len(together))
        for entry, result in results:
            entry.done(result)
            entry.future.set_result(result)
        for entry, failure in refused:
            entry.future.set_exception(failure)

    def _alone(self, job: Job[Result]) -> Result:
        """Run a job so that its failure undoes nothing else."""
        self._connection.execute("SAVEPOINT job")
        try:
            result = job(self._connection)
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK TO job")
                self._connection.execute("RELEASE job")
            self._on_failure()
            raise
        self._connection.execute("RELEASE job")
        return result

    def _give_up(self, together: list[_Waiting], error: sqlite3.Error) -> None:
        with contextlib.suppress(sqlite3.Error):
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
        self._on_failure()
        failure = _named(error)
        if getattr(error, "sqlite_errorname", "").startswith(_BROKEN):
            self._broken = f"{failure}; nothing more is written until a restart"
        for entry in together:
            if not entry.future.done():
                entry.future.set_exception(failure)


def _named(error: BaseException) -> BaseException:
    """Return what the caller is told: where it happened as a note, for the log.

    The frames themselves hold the list of failures and so the failure again.
    """
    if isinstance(error, sqlite3.Error):
        return StoreError(f"the store could not write: {error}")
    if not isinstance(error, ServiceError):
        error.add_note("".join(traceback.format_tb(error.__traceback__)))
    let_go(error)
    return error
