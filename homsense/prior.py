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
from homsense.free_space import FreeSpace

FloatArray = NDArray[np.float64]
Rng = np.random.Generator

_ATTEMPTS = 64


class Prior(Protocol):
    """What the localizer asks of a prior."""

    def draw(self, free_space: FreeSpace, count: int, rng: Rng) -> FloatArray:
        """Draw poses, shape (count, 3)."""
        ...


@dataclass(frozen=True, slots=True)
class HeadingPrior:
    """A compass at the start.

    Parameters
    ----------
    mean_rad : float, default 0.0
        Heading, radians.
    std_rad : float, default infinite
        Its deviation, radians; infinite when the heading is unknown.
    """

    mean_rad: float = 0.0
    std_rad: float = math.inf

    def draw(self, count: int, rng: Rng) -> FloatArray:
        """Draw headings.

        Parameters
        ----------
        count : int
            How many.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (count,), float64
            Radians.
        """
        if math.isinf(self.std_rad):
            return rng.uniform(-math.pi, math.pi, count)
        return rng.normal(self.mean_rad, self.std_rad, count)


@dataclass(frozen=True, slots=True)
class UniformPrior:
    """Anywhere in free space (the paper's prior).

    Parameters
    ----------
    heading : HeadingPrior, optional
        Unknown by default.
    """

    heading: HeadingPrior = HeadingPrior()

    def draw(self, free_space: FreeSpace, count: int, rng: Rng) -> FloatArray:
        """Draw poses.

        Parameters
        ----------
        free_space : FreeSpace
            Where to draw.
        count : int
            How many.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (count, 3), float64
            Poses.
        """
        return np.column_stack([free_space.draw(count, rng), self.heading.draw(count, rng)])


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
        If a number is not finite or the deviation is not positive.
    """

    x_m: float
    y_m: float
    std_m: float
    heading: HeadingPrior = HeadingPrior()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x_m) and math.isfinite(self.y_m)):
            message = "the middle of a Gaussian prior must be finite"
            raise InvalidConfigurationError(message, "prior")
        if not (math.isfinite(self.std_m) and self.std_m > 0.0):
            message = f"std_m must be positive, not {self.std_m}"
            raise InvalidConfigurationError(message, "prior.std_m")

    def draw(self, free_space: FreeSpace, count: int, rng: Rng) -> FloatArray:
        """Draw poses; those that fall on a structure are drawn again.

        Parameters
        ----------
        free_space : FreeSpace
            Where a pose can be.
        count : int
            How many.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (count, 3), float64
            Poses.

        Raises
        ------
        InvalidConfigurationError
            If hardly any draw is free.
        """

        def candidates() -> FloatArray:
            return rng.normal((self.x_m, self.y_m), self.std_m, (count, 2))

        places = _until_free(candidates, free_space.contains, count)
        return np.column_stack([places, self.heading.draw(count, rng)])


@dataclass(frozen=True, slots=True)
class PolygonPrior:
    """Anywhere in free space within a polygon.

    Parameters
    ----------
    polygon : shapely.Polygon
        Metres.
    heading : HeadingPrior, optional
        Unknown by default.
    """

    polygon: Polygon
    heading: HeadingPrior = HeadingPrior()

    def draw(self, free_space: FreeSpace, count: int, rng: Rng) -> FloatArray:
        """Draw poses.

        Parameters
        ----------
        free_space : FreeSpace
            Where a pose can be.
        count : int
            How many.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (count, 3), float64
            Poses.

        Raises
        ------
        InvalidConfigurationError
            If hardly any of the polygon is free.
        """
        west, south, east, north = self.polygon.bounds

        def candidates() -> FloatArray:
            return rng.uniform((west, south), (east, north), (count, 2))

        def accepted(xy: FloatArray) -> NDArray[np.bool_]:
            inside = shapely.contains_xy(self.polygon, xy[:, 0], xy[:, 1])
            return np.asarray(inside & free_space.contains(xy))

        return np.column_stack(
            [_until_free(candidates, accepted, count), self.heading.draw(count, rng)]
        )


def _until_free(
    candidates: Callable[[], FloatArray],
    accepted: Callable[[FloatArray], NDArray[np.bool_]],
    count: int,
) -> FloatArray:
    found: list[FloatArray] = []
    missing = count
    for _ in range(_ATTEMPTS):
        drawn = candidates()
        found.append(drawn[accepted(drawn)][:missing])
        missing -= len(found[-1])
        if not missing:
            return np.concatenate(found)
    message = "the prior leaves hardly any free space"
    raise InvalidConfigurationError(message, "prior")
