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

from homsense.backend import Backend, fastest
from homsense.code_map import NOWHERE, CodeMap
from homsense.errors import InvalidInputError
from homsense.exact import exp, log2
from homsense.free_space import FreeSpace
from homsense.height import HeightMap
from homsense.registered.blocks import Blocks
from homsense.registered.complex import LEVELS, RegisteredComplex, Sighting
from homsense.scalar import LN_2
from homsense.stages import cells_at

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BLOCK_SHARE = 1.0 / 6.0
INDEPENDENT = 2.0
CORRELATION_SHARE = 0.55
BLUR_M = 5.0
"""Scans of the crowd have found their places to about so much, which no likelihood tells."""

LOST = 0.0005
"""Relocation between two independent measurements, which are only a few metres apart."""

COUNT_VARIANCE = 1.0
NOTHING_BITS = -1e3
_ASKED = 200


class PlaceLikelihood:
    """How well each block of a map explains a scan.

    Where a crowd may lie in several ways, they are averaged with their probabilities until the
    data decide.

    Parameters
    ----------
    complex_ : RegisteredComplex
        The crowd.
    free_space : FreeSpace
        Where devices are looked for, in blocks of a sixth of the reach.
    backend : Backend, optional
        What adds up; the fastest by default. Results do not depend on it.
    """

    def __init__(
        self, complex_: RegisteredComplex, free_space: FreeSpace, backend: Backend | None = None
    ) -> None:
        self.complex = complex_
        self.backend = backend or fastest()
        self.code_map = CodeMap.blocks(free_space, BLOCK_SHARE * complex_.reach_m)
        self.correlation_m = CORRELATION_SHARE * complex_.reach_m
        self.blur_m = BLUR_M

    def run_by(self, backend: Backend) -> Self:
        """Return the same likelihood on another backend.

        Parameters
        ----------
        backend : Backend
            What adds up.

        Returns
        -------
        PlaceLikelihood
            Equal to this one.
        """
        same = copy.copy(self)
        same.backend = backend
        return same

    def covers(self, xy: FloatArray) -> BoolArray:
        """Tell where the crowd has been, to the cell of the map.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            What `RegisteredComplex.covers` tells of the middles of their cells, under any of the
            placements; False off the map.
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
    def _placed(self) -> tuple[Blocks, ...]:
        middles = self.code_map.expected[1:]
        return tuple(Blocks.of(placed, middles) for placed in self.complex.placed)

    @cached_property
    def _covered(self) -> BoolArray:
        centers = self.code_map.free_space.grid.centers()
        covered = np.any([placed.covers(centers) for placed in self.complex.placed], axis=0)
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
        first, last = np.searchsorted(self.complex.walk, [walk, walk + 1]).tolist()
        others = copy.copy(self)
        vars(others)["_placed"] = tuple(one.without(first, last) for one in self._placed)
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
        self.check(sighting)
        scan, level = np.array(sighting.scan, np.int64), np.array(sighting.level, np.int32)
        nats = self._averaged([blocks.nats(scan, level, self.backend) for blocks in self._placed])
        bits = (INDEPENDENT / LN_2) * (nats - nats.max())
        return np.concatenate([[NOTHING_BITS], bits])

    def check(self, sighting: Sighting) -> None:
        """Raise unless a sighting can be of this complex.

        Parameters
        ----------
        sighting : Sighting
            What a scan resembles and hears.

        Raises
        ------
        InvalidInputError
            If it names what the complex does not have.
        """
        of_complex = (
            _below(sighting.scan, self.complex.size)
            and _below(sighting.level, len(LEVELS) + 1)
            and _below(sighting.landmark, len(self.complex.index.column))
            and len(sighting.scan) == len(sighting.level)
            and len(sighting.landmark) == len(sighting.height_db)
        )
        if not of_complex:
            message = "the sighting is of another complex"
            raise InvalidInputError(message, "sighting")

    def _averaged(self, nats: list[FloatArray]) -> FloatArray:
        """Return the nats of the mean likelihood over the placements."""
        if len(nats) == 1:
            return nats[0]
        probabilities = self.complex.registration.probabilities[: len(nats)]
        best = np.max(nats, axis=0)
        mean = sum(
            probability * exp(INDEPENDENT * (each - best))
            for probability, each in zip(probabilities, nats, strict=True)
        )
        return np.asarray(best + log2(mean) * (LN_2 / INDEPENDENT))


def _below(numbers: Sequence[int], size: int) -> bool:
    return not numbers or 0 <= min(numbers) <= max(numbers) < size


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

    def run_by(self, backend: Backend) -> Self:
        """Return the same likelihood on another backend.

        Parameters
        ----------
        backend : Backend
            What adds up.

        Returns
        -------
        HolesAtPlace
            Equal to this one.
        """
        same = copy.copy(self)
        vars(same)["_place"] = self._place.run_by(backend)
        return same

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
        return np.concatenate([[NOTHING_BITS], bits])
