"""How far a device has come since the last weighing, by its own account."""

import math
from typing import NamedTuple, Self

from homsense.pose import Delta
from homsense.scalar import TURN, cosine, sine


class Travel(NamedTuple):
    """Displacement in the frame of the place where the count began; jitter does not add up.

    Parameters
    ----------
    forward_m, left_m : float, default infinite and 0
        Displacement, metres; infinite before the first weighing.
    turns : float
        Change of heading, turns.
    """

    forward_m: float = math.inf
    left_m: float = 0.0
    turns: float = 0.0

    @property
    def length_m(self) -> float:
        """Distance, metres."""
        return math.sqrt(self.forward_m**2 + self.left_m**2)

    def onward(self, delta: Delta) -> Self:
        """Return the travel after another motion.

        Parameters
        ----------
        delta : Delta
            In the body frame at its start.

        Returns
        -------
        Travel
            The sum.

        Examples
        --------
        >>> there = Travel(0.0).onward(Delta(3.0, 0.0, math.pi))
        >>> round(there.onward(Delta(3.0)).length_m, 5)
        0.0
        """
        right, up = cosine(self.turns), sine(self.turns)
        return type(self)(
            self.forward_m + right * delta.forward_m - up * delta.left_m,
            self.left_m + up * delta.forward_m + right * delta.left_m,
            (self.turns + delta.turn_rad / TURN) % 1.0,
        )
