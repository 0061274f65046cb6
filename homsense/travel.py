"""How far a device has come since the last weighing, by its own account."""

import math
from typing import NamedTuple, Self

from homsense.pose import Delta
from homsense.scalar import TURN, cosine, sine

FIRST_M = 30.0


class Travel(NamedTuple):
    """Displacement in the frame of the place where the count began; jitter does not add up.

    Parameters
    ----------
    forward_m, left_m : float, default 0.0
        Displacement, metres.
    turns : float, default 0.0
        Change of heading, turns.
    credit_m : float, default 30.0
        Counts as way before the first weighing, metres: the first scan is weighed at once, but not
        so much that an unlucky one rules out the true place.
    """

    forward_m: float = 0.0
    left_m: float = 0.0
    turns: float = 0.0
    credit_m: float = FIRST_M

    @property
    def length_m(self) -> float:
        """Distance that counts, metres."""
        square = self.forward_m * self.forward_m + self.left_m * self.left_m
        return math.sqrt(square) + self.credit_m

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
        >>> there = Travel(credit_m=0.0).onward(Delta(3.0, 0.0, math.pi))
        >>> round(there.onward(Delta(3.0)).length_m, 5)
        0.0
        """
        right, up = cosine(self.turns), sine(self.turns)
        return type(self)(
            self.forward_m + right * delta.forward_m - up * delta.left_m,
            self.left_m + up * delta.forward_m + right * delta.left_m,
            (self.turns + delta.turn_rad / TURN) % 1.0,
            self.credit_m,
        )
