"""What is known about the pose before the first step."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from homsense.errors import InvalidConfigurationError
from homsense.exact import standard_normals, unit_interval, wrap_turns
from homsense.free_space import FreeSpace
from homsense.pose import FARTHEST_M, MAX_DELTA
from homsense.scalar import TURN

FloatArray = NDArray[np.float64]
Singles = NDArray[np.float32]
Drawn = tuple[Singles, Singles, Singles]
Bits = Callable[[int], NDArray[np.uint32]]

_ATTEMPTS = 256


class Prior(Protocol):
    """What the localizer asks of a prior."""

    def draw(self, free_space: FreeSpace, bits: Bits) -> Drawn:
        """Draw x m, y m and turns, as many as `bits` gives at a call."""
        ...


@dataclass(frozen=True, slots=True)
class HeadingPrior:
    """A compass at the start.

    Parameters
    ----------
    mean_rad : float, default 0.0
        Heading, radians.
    std_rad : float, default infinite
        Its deviation, radians, positive; from a full turn on the heading is unknown.

    Raises
    ------
    InvalidConfigurationError
        If the mean is beyond a million or the deviation is not positive.
    """

    mean_rad: float = 0.0
    std_rad: float = math.inf

    def __post_init__(self) -> None:
        if not abs(self.mean_rad) <= MAX_DELTA:
            message = f"mean_rad must be at most {MAX_DELTA:.0f}, not {self.mean_rad}"
            raise InvalidConfigurationError(message, "prior.heading.mean_rad")
        if not self.std_rad > 0.0:
            message = f"std_rad must be positive, not {self.std_rad}"
            raise InvalidConfigurationError(message, "prior.heading.std_rad")

    def draw(self, words: NDArray[np.uint32]) -> Singles:
        """Draw headings.

        Parameters
        ----------
        words : ndarray, shape (4, N), uint32
            Random bits.

        Returns
        -------
        ndarray, shape (N,), float32
            Turns, in [-1/2, 1/2).
        """
        if self.std_rad >= TURN:
            return wrap_turns(unit_interval(words[0]))
        normal, *_ = standard_normals(words)
        mean = np.float32(math.remainder(self.mean_rad / TURN, 1.0))
        std = np.float32(self.std_rad / TURN)
        return wrap_turns(mean + std * normal)


@dataclass(frozen=True, slots=True)
class UniformPrior:
    """Anywhere in free space (the paper's prior).

    Parameters
    ----------
    heading : HeadingPrior, optional
        Unknown by default.
    """

    heading: HeadingPrior = HeadingPrior()

    def draw(self, free_space: FreeSpace, bits: Bits) -> Drawn:
        """Draw poses.

        Parameters
        ----------
        free_space : FreeSpace
            Where a pose can be.
        bits : callable
            Gives fresh random bits, shape (4, N), whenever it is called with a number.

        Returns
        -------
        x_m, y_m, turns : ndarray, shape (N,), float32
            Poses.
        """
        return *free_space.draw(bits(0)[:3]), self.heading.draw(bits(1))


@dataclass(frozen=True, slots=True)
class GaussianPrior:
    """Around a place.

    Parameters
    ----------
    x_m, y_m : float
        Middle, metres.
    std_m : float
        Deviation along each axis, metres, positive.
    heading : HeadingPrior, optional
        Unknown by default.

    Raises
    ------
    InvalidConfigurationError
        If a number is beyond `FARTHEST_M` or the deviation is not positive.
    """

    x_m: float
    y_m: float
    std_m: float
    heading: HeadingPrior = HeadingPrior()

    def __post_init__(self) -> None:
        if not (abs(self.x_m) <= FARTHEST_M and abs(self.y_m) <= FARTHEST_M):
            message = f"the middle of a Gaussian prior must lie within {FARTHEST_M:g} m"
            raise InvalidConfigurationError(message, "prior")
        if not 0.0 < self.std_m <= FARTHEST_M:
            message = f"std_m must be positive, at most {FARTHEST_M:g}, not {self.std_m}"
            raise InvalidConfigurationError(message, "prior.std_m")

    def draw(self, free_space: FreeSpace, bits: Bits) -> Drawn:
        """Draw poses; those that fall on a structure are drawn again.

        Parameters
        ----------
        free_space : FreeSpace
            Where a pose can be.
        bits : callable
            Gives fresh random bits, shape (4, N), whenever it is called with a number.

        Returns
        -------
        x_m, y_m, turns : ndarray, shape (N,), float32
            Poses.

        Raises
        ------
        InvalidConfigurationError
            If hardly any draw is free.
        """

        def candidates(words: NDArray[np.uint32]) -> tuple[Singles, Singles]:
            right, up, *_ = standard_normals(words)
            std = np.float32(self.std_m)
            return np.float32(self.x_m) + std * right, np.float32(self.y_m) + std * up

        return *_until_free(candidates, free_space.contains, bits), self.heading.draw(bits(1))


@dataclass(frozen=True, slots=True)
class PolygonPrior:
    """Anywhere in free space within a polygon.

    Parameters
    ----------
    polygon : shapely.Polygon
        Metres.
    heading : HeadingPrior, optional
        Unknown by default.

    Raises
    ------
    InvalidConfigurationError
        If a corner is beyond `FARTHEST_M`, or there is none.
    """

    polygon: Polygon
    heading: HeadingPrior = HeadingPrior()

    def __post_init__(self) -> None:
        if not all(abs(end) <= FARTHEST_M for end in self.polygon.bounds):
            message = f"the corners of a polygon prior must lie within {FARTHEST_M:g} m"
            raise InvalidConfigurationError(message, "prior.ring")

    def draw(self, free_space: FreeSpace, bits: Bits) -> Drawn:
        """Draw poses.

        Parameters
        ----------
        free_space : FreeSpace
            Where a pose can be.
        bits : callable
            Gives fresh random bits, shape (4, N), whenever it is called with a number.

        Returns
        -------
        x_m, y_m, turns : ndarray, shape (N,), float32
            Poses.

        Raises
        ------
        InvalidConfigurationError
            If hardly any draw is free.
        """
        west, south, east, north = self.polygon.bounds

        def candidates(words: NDArray[np.uint32]) -> tuple[Singles, Singles]:
            right, up = unit_interval(words[0]), unit_interval(words[1])
            return (
                np.float32(west) + np.float32(east - west) * right,
                np.float32(south) + np.float32(north - south) * up,
            )

        def accepted(xy: FloatArray) -> NDArray[np.bool_]:
            inside = shapely.contains_xy(self.polygon, xy[:, 0], xy[:, 1])
            return np.asarray(inside & free_space.contains(xy))

        return *_until_free(candidates, accepted, bits), self.heading.draw(bits(1))


def _until_free(
    candidates: Callable[[NDArray[np.uint32]], tuple[Singles, Singles]],
    accepted: Callable[[FloatArray], NDArray[np.bool_]],
    bits: Bits,
) -> tuple[Singles, Singles]:
    x, y = candidates(bits(0))
    missing = np.arange(len(x))
    for attempt in range(_ATTEMPTS):
        places = np.stack([x[missing], y[missing]], axis=1, dtype=np.float64)
        missing = missing[~accepted(places)]
        if not len(missing):
            return x, y
        again_x, again_y = candidates(bits(2 + attempt)[:, missing])
        x[missing], y[missing] = again_x, again_y
    message = "the prior leaves hardly any free space"
    raise InvalidConfigurationError(message, "prior")
