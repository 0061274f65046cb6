"""Work in turns: what belongs together one after the other, the rest side by side."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor

_log = logging.getLogger(__name__)

MOST_JOBS = 1024
AT_A_TIME = 32

Job = Callable[[], None]


class Lane:
    """Jobs that are done one at a time, in order, by any thread of a pool.

    Parameters
    ----------
    pool : concurrent.futures.Executor
        Shared by all lanes; after some jobs a lane lets others go first.
    after : callable, optional
        Done whenever jobs were done.
    """

    def __init__(self, pool: Executor, after: Job = lambda: None) -> None:
        self._pool, self._after = pool, after
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
        self._submit()
        return True

    def _submit(self) -> None:
        try:
            self._pool.submit(self._run)
        except RuntimeError:
            _log.debug("the service stops; a device's last messages are left undone")

    def _run(self) -> None:
        for _ in range(AT_A_TIME):
            if not self._jobs:
                break
            self._do(self._jobs.popleft())
        self._do(self._after)
        with self._lock:
            self._is_running = bool(self._jobs)
            if not self._is_running:
                return
        self._submit()

    @staticmethod
    def _do(job: Job) -> None:
        try:
            job()
        except Exception:  # noqa: BLE001 - the lane goes on
            _log.exception("a message of a device failed")
