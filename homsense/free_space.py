"""Where particles may be: draws from free space, and walls that stop a step."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from homsense.errors import InvalidConfigurationError, InvalidMapError
from homsense.grid import Grid, Raster
from homsense.site_map import SiteMap

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Singles = NDArray[np.float32]
Words = NDArray[np.uint32]

_MOST_HALVES = 254.0
_WORD = np.uint64(32)


class Walls(NamedTuple):
    """How far a particle can go from each cell without meeting anything.

    Parameters
    ----------
    raster : Raster
        The cells.
    half_cell_m : float32
        Half the side of a cell, metres.
    clearance : ndarray, shape (rows * columns,), uint8
        From anywhere in a cell to the nearest cell that is not free, at least, in half cells and
        one more; 0 where the cell itself is not free.
    """

    raster: Raster
    half_cell_m: np.float32
    clearance: NDArray[np.uint8]


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

    def widened(self, by_m: float) -> Self:
        """Return what is free when walls are drawn no better than to a tolerance.

        Parameters
        ----------
        by_m : float
            How far behind a wall one may still be, metres, not negative.

        Returns
        -------
        FreeSpace
            With every cell whose middle is so close to that of a free one.

        Raises
        ------
        InvalidConfigurationError
            If the tolerance is negative.
        """
        if not by_m >= 0.0:
            message = f"wall_tolerance_m must not be negative, not {by_m}"
            raise InvalidConfigurationError(message, "wall_tolerance_m")
        free = self.free[:-1].reshape(self.grid.shape)
        apart = ndimage.distance_transform_edt(~free) * self.grid.cell_m
        return type(self)(self.grid, np.append(apart <= by_m, False))

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

    def draw(self, words: Words) -> tuple[Singles, Singles]:
        """Draw places uniformly over free space (Algorithm 1, initRandParticles).

        Parameters
        ----------
        words : ndarray, shape (3, N), uint32
            Random bits.

        Returns
        -------
        x_m, y_m : ndarray, shape (N,), float32
            Places.
        """
        cells = self._free_cells
        chosen = cells[(words[0] * np.uint64(len(cells)) >> _WORD).astype(np.intp)]
        return self.grid.within(chosen, words[1], words[2])

    @cached_property
    def walls(self) -> Walls:
        """The look-up table that stops steps."""
        grid = self.grid
        free = np.pad(self.free[:-1].reshape(grid.shape), 1)
        apart = ndimage.distance_transform_edt(
            ~ndimage.binary_dilation(~free, np.ones((3, 3), np.bool_))
        )
        halves = np.minimum(np.floor(2.0 * apart), _MOST_HALVES)
        clearance = np.where(free, 1.0 + halves, 0.0).astype(np.uint8)
        return Walls(grid.raster, np.float32(0.5 * grid.cell_m), clearance.ravel())

    @cached_property
    def _free_cells(self) -> IntArray:
        return np.flatnonzero(self.free[:-1])
