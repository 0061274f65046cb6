"""The engine of the hot loops: the reference until numba has compiled them, then numba's."""

import threading
from typing import Literal

from homsense.engine import PYTHON, Engine, warmed

Choice = Literal["auto", "python", "numba"]


class WarmingEngine:
    """Tells which engine to use now.

    Parameters
    ----------
    choice : {"auto", "python", "numba"}
        With ``auto`` numba compiles in the background, where it is installed.
    """

    def __init__(self, choice: Choice) -> None:
        self.now = PYTHON
        if choice == "numba":
            self._warm()
        elif choice == "auto":
            threading.Thread(target=self._warm, name="warming", daemon=True).start()

    def __call__(self) -> Engine:
        """Return the engine to use now; all give the same results."""
        return self.now

    def _warm(self) -> None:
        self.now = warmed()
