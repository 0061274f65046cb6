"""Poses in the plane, (x m, y m, heading rad) in the site frame, and body-frame motion."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidInputError

FloatArray = NDArray[np.float64]

MAX_DELTA = 1e6


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
    """

    forward_m: float = 0.0
    left_m: float = 0.0
    turn_rad: float = 0.0
    dt_s: float = 1.0
    std: tuple[float, float, float] | None = None

    @property
    def length_m(self) -> float:
        """Distance moved, metres."""
        return math.hypot(self.forward_m, self.left_m)

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
            if not (math.isfinite(value) and abs(value) <= MAX_DELTA):
                message = f"{name} must be finite and at most {MAX_DELTA:.0f}, not {value}"
                raise InvalidInputError(message, name)
        if self.dt_s < 0.0:
            message = f"dt_s must not be negative, not {self.dt_s}"
            raise InvalidInputError(message, "dt_s")
        if self.std is not None and not all(0.0 <= s <= MAX_DELTA for s in self.std):
            message = f"std must hold finite deviations that are not negative, not {self.std}"
            raise InvalidInputError(message, "std")
        return self


def wrap_angle(angle: FloatArray) -> FloatArray:
    """Return angles in (-pi, pi].

    Parameters
    ----------
    angle : ndarray, float64
        Radians.

    Returns
    -------
    ndarray, float64
        The same directions.

    Examples
    --------
    >>> wrap_angle(np.array([0.0, 3 * np.pi])).round(3).tolist()
    [0.0, 3.142]
    """
    return np.pi - (np.pi - angle) % (2.0 * np.pi)


def compose(poses: FloatArray, moves: FloatArray) -> FloatArray:
    """Return poses moved by body-frame motions.

    Parameters
    ----------
    poses : ndarray, shape (N, 3), float64
        Start poses.
    moves : ndarray, shape (N, 3), float64
        Forward, left and turn of each.

    Returns
    -------
    ndarray, shape (N, 3), float64
        End poses.

    Examples
    --------
    >>> north = np.array([[0.0, 0.0, np.pi / 2]])
    >>> compose(north, np.array([[2.0, 1.0, 0.0]])).round(3).tolist()
    [[-1.0, 2.0, 1.571]]
    """
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack(
        [
            poses[:, 0] + cosine * moves[:, 0] - sine * moves[:, 1],
            poses[:, 1] + sine * moves[:, 0] + cosine * moves[:, 1],
            wrap_angle(poses[:, 2] + moves[:, 2]),
        ],
        axis=1,
    )
