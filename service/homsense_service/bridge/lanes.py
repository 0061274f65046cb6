"""Work in turns: what belongs together one after the other, the rest side by side."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue

_log = logging.getLogger(__name__)

MOST_JOBS = 1024
AT_A_TIME = 32

Job = Callable[[], None]


class Workers:
    """Threads that do jobs; leaner than an executor, since nobody waits for a result.

    Who was idle last is called first: what it needs is still close to its processor.

    Parameters
    ----------
    count : int
        How many.
    name : str
        Of the threads.
    """

    def __init__(self, count: int, name: str) -> None:
        self._lock = threading.Lock()
        self._jobs: deque[Job] = deque()
        self._idle: list[SimpleQueue[Job]] = []
        self._is_open = True
        self._threads = [
            threading.Thread(target=self._work, name=f"{name}-{number}") for number in range(count)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, job: Job) -> None:
        """Do something soon."""
        with self._lock:
            if not self._idle:
                self._jobs.append(job)
                return
            idle = self._idle.pop()
        idle.put(job)

    def close(self) -> None:
        """Finish what is being done, and leave the rest undone."""
        with self._lock:
            self._is_open = False
            for idle in self._idle:
                idle.put(_nothing)
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        given: SimpleQueue[Job] = SimpleQueue()
        while True:
            with self._lock:
                if not self._is_open:
                    return
                job = self._jobs.popleft() if self._jobs else None
                if job is None:
                    self._idle.append(given)
            do(job or given.get())


class Lane:
    """Jobs that are done one at a time, in order, by any thread of a pool.

    Parameters
    ----------
    workers : Workers
        Shared by all lanes; after some jobs a lane lets others go first.
    after : callable, optional
        Done whenever jobs were done.
    """

    def __init__(self, workers: Workers, after: Job = lambda: None) -> None:
        self._workers, self._after = workers, after
        self._jobs: deque[Job] = deque()
        self._lock = threading.Lock()
        self._is_running = False

    def post(self, job: Job) -> bool:
        """Do something soon; tell whether there is room for it."""
        with self._lock:
            if len(self._jobs) >= MOST_JOBS:
                return False
            self._jobs.append(job)
            if self._is_running:
                return True
            self._is_running = True
        self._workers.submit(self._run)
        return True

    def _run(self) -> None:
        for _ in range(AT_A_TIME):
            if not self._jobs:
                break
            do(self._jobs.popleft())
        do(self._after)
        with self._lock:
            self._is_running = bool(self._jobs)
            if not self._is_running:
                return
        self._workers.submit(self._run)


def do(job: Job) -> None:
    """Do something; a failure is logged."""
    try:
        job()
    except Exception:  # noqa: BLE001 - the next job has a right to be done
        _log.exception("a message of a device failed")


def _nothing() -> None:
    """Let a thread see that it is to end."""
