"""Poses in the plane, (x m, y m, heading rad) in the site frame, and body-frame motion."""

import math
from typing import NamedTuple

from homsense.errors import InvalidInputError

MAX_DELTA = 1e6
FARTHEST_M = 1e9
"""How far a place may be from the origin of its frame."""
_SQUARE = 9


class Delta(NamedTuple):
    """Motion since the step before, in the body frame at its start.

    Parameters
    ----------
    forward_m, left_m : float
        Translation, metres.
    turn_rad : float
        Change of heading, radians counter-clockwise.
    dt_s : float
        Duration, seconds.
    std : tuple of float, optional
        Standard deviations of the three, as the device states them.
    covariance : tuple of float, optional
        Of the three, row by row, nine numbers; it goes before `std`.
    """

    forward_m: float = 0.0
    left_m: float = 0.0
    turn_rad: float = 0.0
    dt_s: float = 1.0
    std: tuple[float, float, float] | None = None
    covariance: tuple[float, ...] | None = None

    @property
    def length_m(self) -> float:
        """Distance moved, metres."""
        return math.sqrt(self.forward_m * self.forward_m + self.left_m * self.left_m)

    def checked(self) -> "Delta":
        """Return the motion itself once it is known to be sound.

        Returns
        -------
        Delta
            This value.

        Raises
        ------
        InvalidInputError
            If a number is not finite or beyond one million, or a duration or deviation is
            negative.
        """
        for name, value in zip(("forward_m", "left_m", "turn_rad", "dt_s"), self[:4], strict=True):
            if not abs(value) <= MAX_DELTA:
                message = f"{name} must be finite and at most {MAX_DELTA:.0f}, not {value}"
                raise InvalidInputError(message, name)
        if self.dt_s < 0.0:
            message = f"dt_s must not be negative, not {self.dt_s}"
            raise InvalidInputError(message, "dt_s")
        if self.std is not None and not all(0.0 <= s <= MAX_DELTA for s in self.std):
            message = f"std must hold finite deviations that are not negative, not {self.std}"
            raise InvalidInputError(message, "std")
        if self.covariance is not None:
            _root_of(self.covariance)
        return self

    def covariance_root(self) -> tuple[float, ...] | None:
        """Return the lower triangle of the square root of the stated covariance, row by row.

        Returns
        -------
        tuple of float or None
            Six numbers; None when no covariance is stated.

        Raises
        ------
        InvalidInputError
            If the covariance is none.

        Examples
        --------
        >>> Delta(covariance=(4.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.25)).covariance_root()
        (2.0, 1.0, 1.0, 0.0, 0.0, 0.5)
        """
        return None if self.covariance is None else _root_of(self.covariance)


def _root_of(covariance: tuple[float, ...]) -> tuple[float, ...]:
    """Return Cholesky's factor; rows without variance stay zero."""
    message = "covariance must be symmetric and positive semidefinite, nine finite numbers"
    if len(covariance) != _SQUARE or not all(map(math.isfinite, covariance)):
        raise InvalidInputError(message, "covariance")
    xx, xy, xt, yx, yy, yt, tx, ty, tt = covariance
    if not (xy == yx and xt == tx and yt == ty and max(map(abs, covariance)) <= MAX_DELTA**2):
        raise InvalidInputError(message, "covariance")
    slack = -1e-9 * (1.0 + xx + yy + tt)
    r00, r10, r20 = _column(xx, xy, xt, slack)
    r11, r21, _ = _column(yy - r10 * r10, yt - r10 * r20, 0.0, slack)
    r22, _, _ = _column(tt - r20 * r20 - r21 * r21, 0.0, 0.0, slack)
    return r00, r10, r11, r20, r21, r22


def _column(pivot: float, below: float, last: float, slack: float) -> tuple[float, float, float]:
    if pivot < slack or (pivot <= 0.0 and max(abs(below), abs(last)) > -slack):
        message = "covariance must be positive semidefinite"
        raise InvalidInputError(message, "covariance")
    root = math.sqrt(max(pivot, 0.0))
    return (root, below / root, last / root) if root else (0.0, 0.0, 0.0)
