"""What a registered crowd has counted corrects what its site is expected to count.

How wrong an expectation is at a place is a random field over space, alike at places that are
close together. Where scans have found their place on the map without any label, that error is
known, with noise, and so it is known around them, by regression of a Gaussian process [1]_, which
geostatistics calls kriging. Far from the crowd nothing becomes surer.

.. [1] Rasmussen and Williams, "Gaussian Processes for Machine Learning", MIT Press 2006,
   sections 2.2 and 5.4.1.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.spatial.distance import cdist

from homsense.correlation import DIGITS, between_levels, correlation_m, independent
from homsense.expectation import Expectation
from homsense.height import HeightMap
from homsense.profiles import Profiles

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MOST_COUNTED = 1500
FEWEST_COUNTED = 50
_NOISES = np.geomspace(0.001, 30.0, 32)


class Counted(NamedTuple):
    """What a crowd has counted where it was found to have been.

    Parameters
    ----------
    walk : sequence of str
        Walk of each scan.
    xy : ndarray, shape (N, 2), float64
        Where it was made, metres.
    holes : ndarray, shape (N, L), float64
        What it counts; not a number where it counts nothing.
    alike_m : float
        How far the errors of these places are alike, metres.
    """

    walk: Sequence[str]
    xy: FloatArray
    holes: FloatArray
    alike_m: float

    @classmethod
    def of(
        cls,
        walk: Sequence[str],
        xy: FloatArray,
        seen: Iterable[frozenset[str]],
        profiles: Profiles,
        alike_m: float,
    ) -> Self:
        """Count what some scans have in view.

        Parameters
        ----------
        walk : sequence of str
            Walk of each scan.
        xy : ndarray, shape (N, 2), float64
            Where it was made, metres.
        seen : iterable of frozenset of str
            What it has in view.
        profiles : Profiles
            Holes near each landmark.
        alike_m : float
            How far the errors of these places are alike, metres: the correlation length of
            `PlaceLikelihood`.

        Returns
        -------
        Counted
            What each of them measures.
        """
        nothing = (np.nan,) * len(profiles.hops)
        holes = [profiles.mean_holes(visible) or nothing for visible in seen]
        return cls(walk, xy, np.array(holes).reshape(-1, len(profiles.hops)), alike_m)


def krige(expected: Expectation, counted: Counted, profiles: FloatArray) -> Expectation:
    """Correct what is expected by what has been counted.

    Parameters
    ----------
    expected : Expectation
        Of sites like this one.
    counted : Counted
        On this site.
    profiles : ndarray, shape (T, L), float64
        Holes near each landmark of this site, which decide gain and offset of what it counts.

    Returns
    -------
    Expectation
        Mean and spread of what the next scan counts at each place. How far its errors are alike is
        measured on walks that are left out, and no less than those of the places are. The same as
        before when few scans have counted.
    """
    noise, correlation = expected.noise(profiles), np.array(expected.correlation)
    holes = np.array(noise.offsets) + np.array(noise.gains) * counted.holes
    mean, spread = _at(expected.heights, counted.xy), _at(expected.spreads, counted.xy)
    errors = independent((holes - mean) / spread, correlation)
    known = np.flatnonzero(np.isfinite(errors).all(axis=1))
    known = known[:: max(1, -(-len(known) // MOST_COUNTED))]
    xy, errors = counted.xy[known], errors[known]
    is_odd = np.unique(np.array(counted.walk)[known], return_inverse=True)[1] % 2 == 1
    if len(known) < FEWEST_COUNTED or not is_odd.any():
        return expected
    process = _Process.of(xy, errors, 0.5 * expected.correlation_m)
    alike_m = [process.left_correlation_m(xy, errors, half) for half in (is_odd, ~is_odd)]
    grid = expected.heights[0].grid
    places = grid.centers()
    error, variance = process.known_from(xy, errors, places)
    root = np.linalg.cholesky(correlation)
    mean, spread = _at(expected.heights, places), _at(expected.spreads, places)
    mean += spread * (error @ root.T)
    spread *= np.sqrt(variance @ np.square(root).T)
    usual = variance[np.isfinite(mean).all(axis=1)].mean(axis=0)
    return replace(
        expected,
        heights=_rasters(expected.heights[0], mean),
        spreads=_rasters(expected.heights[0], spread),
        correlation=tuple(map(tuple, between_levels((root * usual) @ root.T).tolist())),
        correlation_m=max(float(np.mean(alike_m).round(1)), round(counted.alike_m, 1)),
    )


@dataclass(frozen=True)
class _Process:
    """Independent Gaussian processes of one kernel, measured with noise.

    Parameters
    ----------
    scale_m : float
        Over so many metres their correlation falls, exponentially.
    variance : ndarray, shape (L,), float64
        Of each process.
    noise : ndarray, shape (L,), float64
        Variance of the noise, relative to that of the process.
    """

    scale_m: float
    variance: FloatArray
    noise: FloatArray

    @classmethod
    def of(cls, xy: FloatArray, values: FloatArray, scale_m: float) -> Self:
        """Return the processes under which some values are most likely."""
        powers, axes = _eigen(xy, scale_m)
        totals = powers[:, None] + _NOISES
        variances = np.square(axes.T @ values).T @ (1.0 / totals) / len(xy)
        variances = np.maximum(variances, np.finfo(float).tiny)
        misfit = len(xy) * np.log(variances) + np.log(totals).sum(axis=0)
        best = misfit.argmin(axis=1)
        return cls(scale_m, variances[np.arange(len(best)), best], _NOISES[best])

    def known_from(
        self, xy: FloatArray, values: FloatArray, places: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of what is measured next at some places.

        The variance of a process is what the values show near them, and no less than 1 elsewhere.
        """
        powers, axes = _eigen(xy, self.scale_m)
        seen = np.exp(-cdist(places, xy) / self.scale_m) @ axes
        weights = 1.0 / (powers[:, None] + self.noise)
        mean = seen @ (weights * (axes.T @ values))
        known = np.minimum(np.square(seen) @ weights, 1.0)
        variance = known * self.variance + (1.0 - known) * np.maximum(self.variance, 1.0)
        return mean, variance * (1.0 - known + self.noise)

    def left_correlation_m(self, xy: FloatArray, values: FloatArray, out: BoolArray) -> float:
        """Return how far errors are alike at places that are left out, metres."""
        mean, variance = self.known_from(xy[~out], values[~out], xy[out])
        return correlation_m(xy[out], ((values[out] - mean) / np.sqrt(variance))[None])


def _eigen(xy: FloatArray, scale_m: float) -> tuple[FloatArray, FloatArray]:
    """Return values and vectors of the kernel; noise adds to the values alone."""
    powers, axes = eigh(np.exp(-cdist(xy, xy) / scale_m))
    return np.maximum(powers, 0.0), axes


def _at(rasters: Sequence[HeightMap], xy: FloatArray) -> FloatArray:
    return np.stack([raster.at(xy) for raster in rasters], axis=1)


def _rasters(like: HeightMap, values: FloatArray) -> tuple[HeightMap, ...]:
    shape = like.values.shape
    return tuple(
        HeightMap(like.grid, level.reshape(shape).astype(np.float32), None)
        for level in values.round(DIGITS).T
    )
