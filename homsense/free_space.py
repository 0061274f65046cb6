"""Where particles may be: draws from free space, and walls that stop a step."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidMapError
from homsense.grid import Grid
from homsense.site_map import SiteMap

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]

_MAX_SAMPLES = 64


@dataclass(frozen=True)
class FreeSpace:
    """Free cells of a map.

    Parameters
    ----------
    grid : Grid
        The raster.
    free : ndarray, shape (rows * columns + 1,), bool
        Whether the middle of a cell is free; the last entry, for outside, is not.
    """

    grid: Grid
    free: BoolArray

    @classmethod
    def of(cls, site_map: SiteMap, cell_m: float) -> Self:
        """Return the free cells of a map.

        Parameters
        ----------
        site_map : SiteMap
            The map.
        cell_m : float
            Side of a cell, metres.

        Returns
        -------
        FreeSpace
            At least one free cell.

        Raises
        ------
        InvalidMapError
            If no cell is free.
        """
        grid = Grid.covering(site_map, cell_m)
        free = site_map.is_free(grid.centers())
        if not free.any():
            message = f"no cell of {cell_m} m is free"
            raise InvalidMapError(message, "features")
        return cls(grid, np.append(free, False))

    def contains(self, xy: FloatArray) -> BoolArray:
        """Tell which places are free.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            True in a free cell.
        """
        return self.free[self.grid.flat_index(xy)]

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw places uniformly over free space (Algorithm 1, initRandParticles).

        Parameters
        ----------
        count : int
            How many.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (count, 2), float64
            Places, metres.
        """
        cells = np.flatnonzero(self.free[:-1])
        chosen = cells[rng.integers(len(cells), size=count)]
        row, column = np.divmod(chosen, self.grid.columns)
        corner = np.stack([column, row], axis=1) + rng.random((count, 2))
        places: FloatArray = corner * self.grid.cell_m + (self.grid.west_m, self.grid.south_m)
        return places

    def blocked(self, start: FloatArray, end: FloatArray) -> BoolArray:
        """Tell which straight moves touch a structure or leave the domain.

        Parameters
        ----------
        start, end : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), bool
            True where a sample of the move is not free; a start inside a structure is forgiven.
        """
        longest = float(np.abs(end - start).max(initial=0.0))
        samples = int(np.clip(np.ceil(longest / self.grid.cell_m), 1, _MAX_SAMPLES))
        passed = np.ones(len(end), dtype=bool)
        for part in range(1, samples + 1):
            passed &= self.contains(start + (end - start) * (part / samples))
        return ~passed
