"""Motion models: how uncertain a measured body-frame motion is (Algorithm 1, moveParticle)."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError
from homsense.pose import Delta, compose

FloatArray = NDArray[np.float64]
Rng = np.random.Generator


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

    Raises
    ------
    InvalidConfigurationError
        If a ratio is negative or not finite.
    """

    translation_per_m: float = 0.16
    translation_per_rad: float = 0.1
    rotation_per_m: float = 0.01
    rotation_per_rad: float = 0.05

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
        turned = abs(delta.turn_rad)
        translation = math.hypot(
            self.translation_per_m * delta.length_m, self.translation_per_rad * turned
        )
        rotation = math.hypot(self.rotation_per_m * delta.length_m, self.rotation_per_rad * turned)
        return translation, translation, rotation


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
        half_square = 0.5 * delta.dt_s**2
        linear = self.sigma_linear * half_square
        return linear, linear, self.sigma_angular * half_square


def propagate(poses: FloatArray, delta: Delta, model: MotionModel, rng: Rng) -> FloatArray:
    """Draw the poses after a measured motion.

    Parameters
    ----------
    poses : ndarray, shape (N, 3), float64
        Particles.
    delta : Delta
        The measured motion.
    model : MotionModel
        Its uncertainty.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    ndarray, shape (N, 3), float64
        Moved particles.
    """
    noise = rng.standard_normal((len(poses), 3)) * np.array(model.deviations(delta))
    return compose(poses, np.array(delta[:3]) + noise)


def _check_not_negative(name: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0.0):
        message = f"{name} must be finite and not negative, not {value}"
        raise InvalidConfigurationError(message, name)
