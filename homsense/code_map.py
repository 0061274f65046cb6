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
from homsense.resetting import CodedCells

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NOWHERE = 0
MAX_CODES = 2**16 - 1
_STEPS_PER_HOLE = 16.0


@dataclass(frozen=True)
class CodeMap:
    """Expected counts over free space, by code.

    Parameters
    ----------
    free_space : FreeSpace
        The cells.
    codes : ndarray, uint16
        Code of each cell of the raster, by flat index; 0 where it is not free.
    expected : ndarray, shape (n_codes, n_fields), float64
        What a code expects: the value of each height map; not a number for code 0.
    """

    free_space: FreeSpace
    codes: NDArray[np.uint16]
    expected: FloatArray

    @classmethod
    def of(cls, free_space: FreeSpace, heights: Sequence[HeightMap]) -> Self:
        """Return the code map of some height maps.

        Parameters
        ----------
        free_space : FreeSpace
            The cells.
        heights : sequence of HeightMap
            Expected counts, one map for each neighborhood, and whatever else the error model asks
            for.

        Returns
        -------
        CodeMap
            Values are kept to a sixteenth, or less where there would be too many codes.
        """
        free = np.flatnonzero(free_space.free[:-1])
        centers = free_space.grid.centers()[free]
        expected = np.array([np.nan_to_num(height.at(centers)) for height in heights])
        steps_per_hole = _STEPS_PER_HOLE
        while True:
            steps = np.rint(expected * steps_per_hole).astype(np.int64).reshape(-1, len(free))
            first, code = _codes(steps)
            if len(first) <= MAX_CODES:
                break
            steps_per_hole /= 2.0
        codes = np.full(free_space.grid.shape, NOWHERE, np.uint16)
        codes.ravel()[free] = code + 1
        ringed = np.pad(codes, 1).ravel()
        nowhere = np.full((1, len(steps)), np.nan)
        known_by = np.concatenate([nowhere, steps.T[first] / steps_per_hole])
        return cls(free_space, ringed, np.asfortranarray(known_by))  # weighed column by column

    @classmethod
    def blocks(cls, free_space: FreeSpace, block_m: float) -> Self:
        """Return a code map of square blocks.

        Parameters
        ----------
        free_space : FreeSpace
            The cells.
        block_m : float
            Side of a block, metres; doubled until there are few enough.

        Returns
        -------
        CodeMap
            A code for each block with a free cell; it is known by its middle, x and y in metres.
        """
        grid = free_space.grid
        free = np.flatnonzero(free_space.free[:-1])
        row, column = np.divmod(free, grid.columns)
        step = max(1, round(block_m / grid.cell_m))
        while True:
            blocks = row // step * grid.columns + column // step
            _, code, size = np.unique(blocks, return_inverse=True, return_counts=True)
            if len(size) <= MAX_CODES:
                break
            step *= 2
        middles = [np.bincount(code, axis) / size for axis in grid.centers()[free].T]
        codes = np.full(grid.shape, NOWHERE, np.uint16)
        codes.ravel()[free] = code + 1
        known_by = np.concatenate([np.full((1, 2), np.nan), np.stack(middles, axis=1)])
        return cls(free_space, np.pad(codes, 1).ravel(), known_by)

    @property
    def n_fields(self) -> int:
        """How many height maps there are."""
        return int(self.expected.shape[1])

    @cached_property
    def sizes(self) -> FloatArray:
        """How many free cells have each code; none has code 0."""
        sizes = np.bincount(self.codes, minlength=len(self.expected)).astype(np.float64)
        sizes[NOWHERE] = 0.0
        return sizes

    @cached_property
    def coded_cells(self) -> CodedCells:
        """The free cells, sorted by code."""
        grid = self.free_space.grid
        codes = self.codes.reshape(grid.raster.rows, grid.raster.columns)[1:-1, 1:-1].ravel()
        order = np.argsort(codes, kind="stable")
        starts = (np.cumsum(self.sizes) - self.sizes).astype(np.intp)
        return CodedCells(grid, self.sizes, order[len(order) - int(self.sizes.sum()) :], starts)


def _codes(steps: NDArray[np.int64]) -> tuple[IntArray, IntArray]:
    """Return the first cell of each code, and the code of each cell, from 0."""
    combined = np.zeros(steps.shape[1], np.int64)
    for level in steps:
        wide = combined * (level.max(initial=0) + 1) + level
        combined = np.unique(wide, return_inverse=True)[1]
    _, first, code = np.unique(combined, return_index=True, return_inverse=True)
    return first, code
