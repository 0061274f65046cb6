"""One code for each cell: cells with the same code expect the same counts.

So a measurement is weighed once for each code, however many particles and neighborhoods there
are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from homsense.free_space import FreeSpace
from homsense.height import HeightMap

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NOWHERE = 0
_STEPS_PER_HOLE = 16


@dataclass(frozen=True)
class CodeMap:
    """Expected counts over free space, by code.

    Parameters
    ----------
    free_space : FreeSpace
        The cells.
    codes : ndarray, shape (rows * columns + 1,), int32
        Code of each cell; 0 where it is not free, and outside.
    expected : ndarray, shape (n_codes, n_levels), float64
        Counts that a code expects in each neighborhood; not a number for code 0.
    """

    free_space: FreeSpace
    codes: NDArray[np.int32]
    expected: FloatArray

    @classmethod
    def of(cls, free_space: FreeSpace, heights: Sequence[HeightMap]) -> Self:
        """Return the code map of some height maps.

        Parameters
        ----------
        free_space : FreeSpace
            The cells.
        heights : sequence of HeightMap
            Expected counts, one map for each neighborhood.

        Returns
        -------
        CodeMap
            Counts are kept to a sixteenth.
        """
        free = np.flatnonzero(free_space.free[:-1])
        centers = free_space.grid.centers()[free]
        steps = [
            np.rint(np.nan_to_num(height.at(centers)) * _STEPS_PER_HOLE).astype(np.int64)
            for height in heights
        ]
        combined = np.zeros(len(free), np.int64)
        for level in steps:
            combined = np.unique(
                combined * (level.max(initial=0) + 1) + level, return_inverse=True
            )[1]
        _, first, code = np.unique(combined, return_index=True, return_inverse=True)
        codes = np.full(free_space.free.size, NOWHERE, np.int32)
        codes[free] = code + 1
        nowhere = np.full((1, len(heights)), np.nan)
        known = np.array(steps, np.float64).reshape(len(heights), len(free)).T[first]
        return cls(free_space, codes, np.concatenate([nowhere, known / _STEPS_PER_HOLE]))

    @property
    def n_levels(self) -> int:
        """How many neighborhoods there are."""
        return int(self.expected.shape[1])

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """How many free cells have each code; none has code 0."""
        sizes = np.bincount(self.codes, minlength=len(self.expected))
        sizes[NOWHERE] = 0
        return sizes

    @cached_property
    def cells(self) -> IntArray:
        """The free cells, sorted by code."""
        order = np.argsort(self.codes, kind="stable")
        return order[len(order) - int(self.sizes.sum()) :]

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Where the cells of each code begin in `cells`."""
        return np.cumsum(self.sizes) - self.sizes
