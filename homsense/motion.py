"""Motion models: how uncertain a measured body-frame motion is (Algorithm 1, moveParticle)."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from homsense.errors import InvalidConfigurationError
from homsense.pose import Delta
from homsense.scalar import TURN
from homsense.stages import Move

Triple = tuple[float, float, float]


class MotionModel(Protocol):
    """What the localizer asks of a motion model."""

    def deviations(self, delta: Delta) -> tuple[float, float, float]:
        """Return the standard deviations of forward (m), left (m) and turn (rad)."""
        ...


@dataclass(frozen=True, slots=True)
class OdometryMotion:
    """Deviations that grow with the motion, as ratios of standard deviations.

    Parameters
    ----------
    translation_per_m : float, default 0.16
        Metres of error for each metre moved.
    translation_per_rad : float, default 0.1
        Metres of error for each radian turned.
    rotation_per_m : float, default 0.01
        Radians of error for each metre moved.
    rotation_per_rad : float, default 0.05
        Radians of error for each radian turned.
    translation_drift : float, default 0.0
        Metres of error for each square root of a second, also at rest.
    rotation_drift : float, default 0.0
        Radians of error for each square root of a second.

    Raises
    ------
    InvalidConfigurationError
        If a ratio is negative or not finite.
    """

    translation_per_m: float = 0.16
    translation_per_rad: float = 0.1
    rotation_per_m: float = 0.01
    rotation_per_rad: float = 0.05
    translation_drift: float = 0.0
    rotation_drift: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            _check_not_negative(name, getattr(self, name))

    def deviations(self, delta: Delta) -> tuple[float, float, float]:
        """Return the standard deviations of forward (m), left (m) and turn (rad).

        Parameters
        ----------
        delta : Delta
            The measured motion.

        Returns
        -------
        tuple of float
            Not negative; the device's own deviations when it states them.
        """
        if delta.std is not None:
            return delta.std
        way, turn = delta.length_m, delta.turn_rad
        squares = way * way, turn * turn, delta.dt_s
        translation = self.translation_per_m, self.translation_per_rad, self.translation_drift
        rotation = self.rotation_per_m, self.rotation_per_rad, self.rotation_drift
        along, around = _root_of_sum(translation, squares), _root_of_sum(rotation, squares)
        return along, along, around


@dataclass(frozen=True, slots=True)
class ImuMotion:
    """Additive Gaussian noise on accelerations, as in section VI of the paper.

    An acceleration that is wrong by sigma during dt moves the end by ``sigma * dt**2 / 2``.

    Parameters
    ----------
    sigma_linear : float, default 10.0
        Metres per square second.
    sigma_angular : float, default 0.435
        Radians per square second.

    Raises
    ------
    InvalidConfigurationError
        If a deviation is negative or not finite.
    """

    sigma_linear: float = 10.0
    sigma_angular: float = 0.435

    def __post_init__(self) -> None:
        for name in self.__slots__:
            _check_not_negative(name, getattr(self, name))

    def deviations(self, delta: Delta) -> tuple[float, float, float]:
        """Return the standard deviations of forward (m), left (m) and turn (rad).

        Parameters
        ----------
        delta : Delta
            The measured motion; its duration decides.

        Returns
        -------
        tuple of float
            Not negative.

        Examples
        --------
        >>> ImuMotion().deviations(Delta(forward_m=5.0, dt_s=0.5))
        (1.25, 1.25, 0.054375)
        """
        half_square = 0.5 * delta.dt_s * delta.dt_s
        linear = self.sigma_linear * half_square
        return linear, linear, self.sigma_angular * half_square


def measured_move(delta: Delta, model: MotionModel) -> Move:
    """Return a measured motion as the filter draws it (Algorithm 1, moveParticle).

    Parameters
    ----------
    delta : Delta
        The measured motion; its own covariance goes before the model.
    model : MotionModel
        Its uncertainty.

    Returns
    -------
    Move
        In single precision, the turn in turns.

    Raises
    ------
    InvalidInputError
        If a stated covariance is none.
    """
    root = delta.covariance_root()
    if root is None:
        forward, left, turn = model.deviations(delta)
        root = (forward, 0.0, left, 0.0, 0.0, turn)
    mean = (delta.forward_m, delta.left_m, delta.turn_rad / TURN)
    r00, r10, r11, r20, r21, r22 = root
    rows = np.array((*mean, r00, r10, r11, r20 / TURN, r21 / TURN, r22 / TURN), np.float32)
    return Move(rows[:3], rows[3:])


def _root_of_sum(factors: Triple, squares: Triple) -> float:
    (a, b, c), (x, y, z) = factors, squares
    return math.sqrt(a * a * x + b * b * y + c * c * z)


def _check_not_negative(name: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0.0):
        message = f"{name} must be finite and not negative, not {value}"
        raise InvalidConfigurationError(message, name)
