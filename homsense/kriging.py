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
from scipy.spatial.distance import cdist

from homsense.correlation import DIGITS, between_levels, correlation_m, independent
from homsense.expectation import Expectation
from homsense.height import HeightMap
from homsense.noise import advantage_bits
from homsense.profiles import Profiles

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_COUNTED = 1500
FEWEST_COUNTED = 50
_MOST_ASKED = 200
_ASTRAY = 6.0
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
    """

    walk: Sequence[str]
    xy: FloatArray
    holes: FloatArray

    @classmethod
    def of(
        cls,
        walk: Sequence[str],
        xy: FloatArray,
        seen: Iterable[frozenset[str]],
        profiles: Profiles,
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

        Returns
        -------
        Counted
            What each of them measures.
        """
        nothing = (np.nan,) * len(profiles.hops)
        holes = [profiles.mean_holes(visible) or nothing for visible in seen]
        return cls(walk, xy, np.array(holes).reshape(-1, len(profiles.hops)))

    def some(self, which: IntArray) -> Self:
        """Choose some of the scans.

        Parameters
        ----------
        which : ndarray, shape (M,), int64
            Their numbers.

        Returns
        -------
        Counted
            Of these, in this order.

        Examples
        --------
        >>> Counted(["a", "b"], np.zeros((2, 2)), np.ones((2, 3))).some(np.array([1])).walk
        ['b']
        """
        walks = [self.walk[scan] for scan in which.tolist()]
        return self._replace(walk=walks, xy=self.xy[which], holes=self.holes[which])


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
        Mean and spread of what the next scan counts at each place. On walks that are left out it
        is measured whether errors are larger than they should be, how far along a walk they are
        alike, and what a scan tells about its place. A walk that errs far more than others do is
        not where it was found to be and is left out. The same as before when few scans have
        counted.
    """
    noise, correlation = expected.noise(profiles), np.array(expected.correlation)
    holes = np.array(noise.offsets) + np.array(noise.gains) * counted.holes
    mean, spread = _at(expected.heights, counted.xy), _at(expected.spreads, counted.xy)
    errors = independent((holes - mean) / spread, correlation)
    known = np.flatnonzero(np.isfinite(errors).all(axis=1))
    known = known[:: max(1, -(-len(known) // MOST_COUNTED))]
    xy, errors, holes = counted.xy[known], errors[known], holes[known]
    walk = np.unique(np.array(counted.walk)[known], return_inverse=True)[1]
    if len(known) < FEWEST_COUNTED or not walk.any():
        return expected
    scale_m = 0.5 * expected.correlation_m
    everything = _Observed.of(xy, errors, scale_m)
    process = _Process.of(everything)
    halves = [
        (asked, _Observed.of(xy[~asked], errors[~asked], scale_m))
        for asked in (walk % 2 == 0, walk % 2 == 1)
    ]
    left = np.empty_like(errors)
    for asked, others in halves:
        error, variance = process.known_from(others, xy[asked])
        left[asked] = (errors[asked] - error) / np.sqrt(variance)
    astray = _astray(left, walk)
    if astray.any():
        return krige(expected, counted.some(known[~astray]), profiles)
    process = process.of_more_variance(np.maximum(np.square(left).mean(axis=0), 1.0))
    told = [
        _told(_corrected(expected, process, others), xy[asked], holes[asked])
        for asked, others in halves
    ]
    return replace(
        _corrected(expected, process, everything),
        correlation_m=correlation_m(xy, left[None], walk),
        information_bits=tuple(np.mean(told, axis=0).tolist()),
    )


def _astray(errors: FloatArray, walk: IntArray) -> NDArray[np.bool_]:
    """Tell which scans are of the walk that errs most, if it does several times as is usual.

    One walk at a time: those around it may err because of it.
    """
    powers = np.bincount(walk, np.square(errors).mean(axis=1)) / np.bincount(walk)
    of_worst: NDArray[np.bool_] = walk == powers.argmax()
    return of_worst & bool(powers.max() > _ASTRAY * np.median(powers))


def _corrected(expected: Expectation, process: "_Process", observed: "_Observed") -> Expectation:
    """Return what is expected where it is known from some places how wrong it is."""
    places = expected.heights[0].grid.centers()
    error, variance = process.known_from(observed, places)
    root = np.linalg.cholesky(np.array(expected.correlation))
    mean, spread = _at(expected.heights, places), _at(expected.spreads, places)
    mean += spread * (error @ root.T)
    spread *= np.sqrt(variance @ np.square(root).T)
    usual = variance[np.isfinite(mean).all(axis=1)].mean(axis=0)
    return replace(
        expected,
        heights=_rasters(expected.heights[0], mean),
        spreads=_rasters(expected.heights[0], spread),
        correlation=tuple(map(tuple, between_levels((root * usual) @ root.T).tolist())),
    )


def _told(expected: Expectation, xy: FloatArray, holes: FloatArray) -> list[float]:
    """Return what scans tell about their places when so many neighborhoods are weighed, bits."""
    grid = expected.heights[0].grid
    fields = _at((*expected.heights, *expected.spreads), grid.centers())
    free = np.flatnonzero(np.isfinite(fields).all(axis=1))
    some = slice(None, None, max(1, len(xy) // _MOST_ASKED))
    rows = np.searchsorted(free, grid.flat_index(xy[some])).tolist()
    found = []
    for levels in range(1, len(expected.hops) + 1):
        columns = [*range(levels), *range(len(expected.hops), len(expected.hops) + levels)]
        noise = expected.narrowed(expected.hops[:levels]).noise()
        weigher = noise.weigher(fields[free][:, columns])
        found.append(float(np.mean([*advantage_bits(weigher, holes[some, :levels], rows)])))
    return found


class _Observed(NamedTuple):
    """Values at some places, and the kernel between these in its own axes.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Where, metres.
    scale_m : float
        Over so many metres correlation falls, exponentially.
    powers : ndarray, shape (N,), float64
        Eigenvalues of the kernel; noise adds to them alone.
    axes : ndarray, shape (N, N), float64
        Its eigenvectors.
    values : ndarray, shape (N, L), float64
        Along the eigenvectors.
    """

    xy: FloatArray
    scale_m: float
    powers: FloatArray
    axes: FloatArray
    values: FloatArray

    @classmethod
    def of(cls, xy: FloatArray, values: FloatArray, scale_m: float) -> Self:
        """Return what is known of some processes."""
        powers, axes = np.linalg.eigh(np.exp(-cdist(xy, xy) / scale_m))
        return cls(xy, scale_m, np.maximum(powers, 0.0), axes, axes.T @ values)


@dataclass(frozen=True)
class _Process:
    """Independent Gaussian processes of one kernel, measured with noise.

    Parameters
    ----------
    variance : ndarray, shape (L,), float64
        Of each process.
    noise : ndarray, shape (L,), float64
        Variance of the noise, relative to that of the process.
    """

    variance: FloatArray
    noise: FloatArray

    @classmethod
    def of(cls, observed: _Observed) -> Self:
        """Return the processes under which some values are most likely."""
        count, totals = len(observed.xy), observed.powers[:, None] + _NOISES
        variances = np.square(observed.values).T @ (1.0 / totals) / count
        variances = np.maximum(variances, np.finfo(float).tiny)
        misfit = count * np.log(variances) + np.log(totals).sum(axis=0)
        best = misfit.argmin(axis=1)
        return cls(variances[np.arange(len(best)), best], _NOISES[best])

    def of_more_variance(self, times: FloatArray) -> Self:
        """Return the processes that vary so many times as much, and so does their noise."""
        return replace(self, variance=self.variance * times)

    def known_from(self, observed: _Observed, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of what is measured next at some places.

        It is not below what is left of an error of unit size, of which the values tell a share:
        what they show of a process counts near them alone.
        """
        seen = np.exp(-cdist(places, observed.xy) / observed.scale_m) @ observed.axes
        weights = 1.0 / (observed.powers[:, None] + self.noise)
        mean = seen @ (weights * observed.values)
        unknown = np.maximum(1.0 - np.square(seen) @ weights, 0.0)
        return mean, np.maximum(self.variance * (unknown + self.noise), np.square(unknown))


def _at(rasters: Sequence[HeightMap], xy: FloatArray) -> FloatArray:
    return np.stack([raster.at(xy) for raster in rasters], axis=1)


def _rasters(like: HeightMap, values: FloatArray) -> tuple[HeightMap, ...]:
    shape = like.values.shape
    return tuple(
        HeightMap(like.grid, level.reshape(shape).astype(np.float32), None)
        for level in values.round(DIGITS).T
    )
