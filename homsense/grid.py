"""A regular raster over a map: the ground of every O(1) look-up."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidInputError
from homsense.site_map import SiteMap

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Singles = NDArray[np.float32]
Words = NDArray[np.uint32]

MAX_CELLS = 4_000_000
_UNIT = 2.0**-32


class Raster(NamedTuple):
    """A grid with a ring of cells around it, as the filter looks it up, in single precision.

    All that lies outside belongs to the ring, so a look-up needs no question.

    Parameters
    ----------
    west_m, south_m : float32
        Corner of the ring, metres.
    cells_per_m : float32
        One over the side of a cell.
    columns, rows : int
        Number of cells to the east and to the north, with the ring.
    """

    west_m: np.float32
    south_m: np.float32
    cells_per_m: np.float32
    columns: int
    rows: int


@dataclass(frozen=True)
class Grid:
    """Square cells, row by row from the south-west corner.

    Parameters
    ----------
    west_m, south_m : float
        Corner of the first cell, metres.
    cell_m : float
        Side of a cell, metres.
    columns, rows : int
        Number of cells to the east and to the north.
    """

    west_m: float
    south_m: float
    cell_m: float
    columns: int
    rows: int

    @classmethod
    def covering(cls, site_map: SiteMap, cell_m: float) -> Self:
        """Return the grid that covers the domain of a map.

        Parameters
        ----------
        site_map : SiteMap
            The map.
        cell_m : float
            Side of a cell, metres.

        Returns
        -------
        Grid
            At least one cell each way.

        Raises
        ------
        InvalidInputError
            If the side is not positive or there would be more than four million cells.
        """
        if not (math.isfinite(cell_m) and cell_m > 0.0):
            message = f"cell_m must be positive, not {cell_m}"
            raise InvalidInputError(message, "cell_m")
        west, south, east, north = site_map.bounds
        columns = max(1, math.ceil((east - west) / cell_m))
        rows = max(1, math.ceil((north - south) / cell_m))
        if columns * rows > MAX_CELLS:
            message = f"{columns} x {rows} cells are more than {MAX_CELLS}; take a larger cell_m"
            raise InvalidInputError(message, "cell_m")
        return cls(west, south, cell_m, columns, rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    @cached_property
    def raster(self) -> Raster:
        """The same with a ring around it, in single precision."""
        west, south = self.west_m - self.cell_m, self.south_m - self.cell_m
        per_m = np.float32(1.0 / self.cell_m)
        return Raster(np.float32(west), np.float32(south), per_m, self.columns + 2, self.rows + 2)

    def centers(self) -> FloatArray:
        """Return the middle of every cell.

        Returns
        -------
        ndarray, shape (rows * columns, 2), float64
            Metres, in the order of the flat index.
        """
        x = self.west_m + (np.arange(self.columns) + 0.5) * self.cell_m
        y = self.south_m + (np.arange(self.rows) + 0.5) * self.cell_m
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def within(self, cells: IntArray, right: Words, up: Words) -> tuple[Singles, Singles]:
        """Draw a place in each of some cells.

        Parameters
        ----------
        cells : ndarray, shape (N,), intp
            Flat indices.
        right, up : ndarray, shape (N,), uint32
            Random bits.

        Returns
        -------
        x_m, y_m : ndarray, shape (N,), float32
            Places.
        """
        row, column = np.divmod(cells, self.columns)
        x = self.west_m + self.cell_m * (column + right * _UNIT)
        y = self.south_m + self.cell_m * (row + up * _UNIT)
        return x.astype(np.float32), y.astype(np.float32)

    def flat_index(self, xy: FloatArray) -> IntArray:
        """Return the flat index of the cell that holds each place, -1 outside the grid.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N,), intp
            Row-major cell numbers.

        Examples
        --------
        >>> Grid(0.0, 0.0, 2.0, 3, 2).flat_index(np.array([[1.0, 3.0], [9.0, 0.0]])).tolist()
        [3, -1]
        """
        with np.errstate(invalid="ignore"):
            column = np.floor((xy[:, 0] - self.west_m) / self.cell_m)
            row = np.floor((xy[:, 1] - self.south_m) / self.cell_m)
            inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        flat = np.where(inside, row * self.columns + column, -1.0)
        return flat.astype(np.intp)
