"""What runs the hot loops: the reference until numba has compiled them, then numba."""

import threading
from typing import Literal

from homsense import backend
from homsense.backend import Backend
from homsense.engine import PYTHON, Engine, warmed

Choice = Literal["auto", "python", "numba"]


class Warming:
    """Tells which engine and which backend to use now; all give the same results.

    Parameters
    ----------
    choice : {"auto", "python", "numba"}
        With ``auto`` numba compiles in the background, where it is installed.
    """

    def __init__(self, choice: Choice) -> None:
        self._engine = PYTHON
        self._backend = backend.NUMPY
        self._done = threading.Event()
        if choice == "auto":
            threading.Thread(target=self._warm, name="warming", daemon=True).start()
        elif choice == "numba":
            self._warm()
        else:
            self._done.set()

    def engine(self) -> Engine:
        """Return what senses."""
        return self._engine

    def backend(self) -> Backend:
        """Return what filters."""
        return self._backend

    def wait(self) -> None:
        """Wait until that changes no more."""
        self._done.wait()

    def _warm(self) -> None:
        self._backend = backend.warmed()
        self._engine = warmed()
        self._done.set()
