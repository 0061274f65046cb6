"""From what a scan resembles to how likely it was made at each place.

Each scan of the crowd near a place says how likely its similarity is if the new scan was made
there. They are not independent, so their mean counts for a few. Where the crowd has not been there
is nothing to say, and a scan that resembles nothing is best explained there.
"""

import copy
from collections.abc import Sequence
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.code_map import NOWHERE, CodeMap
from homsense.errors import InvalidInputError
from homsense.exact import exp
from homsense.free_space import FreeSpace
from homsense.height import HeightMap
from homsense.ragged import spread
from homsense.registered.complex import RegisteredComplex, Sighting
from homsense.scalar import LN_2
from homsense.stages import cells_at

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK_SHARE = 1.0 / 6.0
KERNEL_SHARE, KERNEL_CUT = 1.0, 2.5
NOBODY = 2.0
INDEPENDENT = 2.0
CORRELATION_SHARE = 0.55
BLUR_M = 5.0
"""Scans of the crowd have found their places to about so much, which no likelihood tells."""

LOST = 0.0005
"""Relocation between two independent measurements, which are only a few metres apart."""

COUNT_VARIANCE = 1.0
_NOTHING_BITS = -1e3
_ASKED = 200


class PlaceLikelihood:
    """How well each block of a map explains a scan.

    Parameters
    ----------
    complex_ : RegisteredComplex
        The crowd.
    free_space : FreeSpace
        Where devices are looked for, in blocks of a sixth of the reach.
    """

    def __init__(self, complex_: RegisteredComplex, free_space: FreeSpace) -> None:
        self.complex = complex_
        self.code_map = CodeMap.blocks(free_space, BLOCK_SHARE * complex_.reach_m)
        self.correlation_m = CORRELATION_SHARE * complex_.reach_m
        self.blur_m = BLUR_M
        width = KERNEL_SHARE * complex_.reach_m
        middles = self.code_map.expected[1:]
        near = cKDTree(complex_.xy).sparse_distance_matrix(
            cKDTree(middles), KERNEL_CUT * width, output_type="ndarray"
        )
        near = near[np.argsort(near["i"] * len(middles) + near["j"])]
        scan, self._block = near["i"], near["j"].astype(np.intp)
        self._start = np.searchsorted(scan, np.arange(complex_.size + 1))
        apart = np.sqrt(np.square(middles[self._block] - complex_.xy[scan]).sum(axis=1))
        self._kernel = exp(-0.5 * np.square(apart / width))
        self._total = NOBODY + np.bincount(self._block, self._kernel, len(middles))
        ring = complex_.ring(apart)
        silent = complex_.nats[:, 0]
        self._silent = np.bincount(self._block, self._kernel * silent[ring], len(middles))
        self._gain = (complex_.nats - silent[:, None]).ravel()
        self._gain_of = (ring * complex_.nats.shape[1]).astype(np.int32)

    def covers(self, xy: FloatArray) -> BoolArray:
        """Tell where the crowd has been, to the cell of the map.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            What `RegisteredComplex.covers` tells of the middles of their cells; False off the map.
        """
        return self._covered[self.code_map.free_space.grid.flat_index(xy)]

    def coverage(self, xy: FloatArray, level: int | None) -> float:
        """Return how likely the crowd has been where a device is.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places of equal weight where it may be, metres.
        level : int or None
            The highest one of its last `Sighting`; None before the first.

        Returns
        -------
        float
            `RegisteredComplex.coverage` of the share of them that `covers` tells.
        """
        return self.complex.coverage(float(self.covers(xy).mean()), level)

    @cached_property
    def _covered(self) -> BoolArray:
        covered = self.complex.covers(self.code_map.free_space.grid.centers())
        return np.append(covered, False)

    @cached_property
    def information_bits(self) -> float:
        """What a scan tells about its place, bits above the mean over the map.

        The mean over some scans of the crowd, each compared with the other walks alone.
        """
        share = self.code_map.sizes / self.code_map.sizes.sum()
        raster, told = self.code_map.free_space.grid.raster, []
        codes = self.code_map.codes[cells_at(raster, *self.complex.xy.astype(np.float32).T)]
        for scan in range(0, self.complex.size, max(1, self.complex.size // _ASKED)):
            if codes[scan] != NOWHERE:
                others = self.without(int(self.complex.walk[scan]))
                bits = others(self.complex.own_sighting(scan))
                told.append(bits[codes[scan]] - np.log2(share @ np.exp2(bits)))
        return float(np.mean(told)) if told else 0.0

    def without(self, walk: int) -> Self:
        """Return what the other walks say.

        Parameters
        ----------
        walk : int
            Number of a walk of the complex.

        Returns
        -------
        PlaceLikelihood
            As if this walk had not been made; it takes the same sightings.
        """
        begin, end = self._start[np.searchsorted(self.complex.walk, [walk, walk + 1])]
        block, kernel = self._block[begin:end], self._kernel[begin:end]
        ring = self._gain_of[begin:end] // self.complex.nats.shape[1]
        silent = kernel * self.complex.nats[ring, 0]
        left = self._kernel.copy()
        left[begin:end] = 0.0
        others = copy.copy(self)
        vars(others).update(
            _kernel=left,
            _total=self._total - np.bincount(block, kernel, len(self._total)),
            _silent=self._silent - np.bincount(block, silent, len(self._silent)),
        )
        return others

    def __call__(self, sighting: Sighting) -> FloatArray:
        """Weigh a scan once for each block.

        Parameters
        ----------
        sighting : Sighting
            What it resembles, of the same complex.

        Returns
        -------
        ndarray, shape (n_codes,), float64
            Binary logarithms, 0 for the best block; a place that is not free explains nothing.

        Raises
        ------
        InvalidInputError
            If the sighting is of another complex.
        """
        scan, level = np.array(sighting.scan, np.int64), np.array(sighting.level, np.int32)
        if len(scan) and not 0 <= scan.min() <= scan.max() < self.complex.size:
            message = "the sighting is of another complex"
            raise InvalidInputError(message, "sighting")
        size = self._start[scan + 1] - self._start[scan]
        _, entry = spread(self._start[scan], size)
        gain_of = self._gain_of.take(entry)
        gain_of += np.repeat(level, size)
        gain = self._gain.take(gain_of)
        gain *= self._kernel.take(entry)
        heard = np.bincount(self._block.take(entry), gain, len(self._silent))
        nats = (self._silent + heard) / self._total
        bits = (INDEPENDENT / LN_2) * (nats - nats.max())
        return np.concatenate([[_NOTHING_BITS], bits])


class HolesAtPlace:
    """The paper's measurement, read where a scan seems to have been made.

    The number of structures near the place is known with a mean and a spread; every block is
    weighed by its own number. Less is told than by the place itself: it shows how much a count is
    worth when it is right.

    Parameters
    ----------
    place : PlaceLikelihood
        Where a scan was made.
    heights : sequence of HeightMap
        Structures within some radii.
    """

    def __init__(self, place: PlaceLikelihood, heights: Sequence[HeightMap]) -> None:
        self.code_map = place.code_map
        self.correlation_m, self.blur_m = place.correlation_m, place.blur_m
        self._place = place
        middles = self.code_map.expected[1:]
        self._counts = np.array([np.nan_to_num(height.at(middles)) for height in heights])

    def __call__(self, sighting: Sighting) -> FloatArray:
        """Weigh a scan once for each block.

        Parameters
        ----------
        sighting : Sighting
            What it resembles.

        Returns
        -------
        ndarray, shape (n_codes,), float64
            Binary logarithms, at most 0; a place that is not free explains nothing.
        """
        mass = self.code_map.sizes[1:] * exp(LN_2 * self._place(sighting)[1:])
        share = mass / mass.sum()
        bits = np.zeros(len(share))
        for counts in self._counts:
            mean = float((share * counts).sum())
            variance = float((share * np.square(counts - mean)).sum()) + COUNT_VARIANCE
            bits -= np.square(counts - mean) / (2.0 * variance * LN_2)
        return np.concatenate([[_NOTHING_BITS], bits])
