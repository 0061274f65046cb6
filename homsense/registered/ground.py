"""Where devices walk, as it is matched with a crowd."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from homsense.free_space import FreeSpace
from homsense.grid import Grid

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

OFF_GROUND_M, UNCOVERED_M = 6.0, 10.0
WORST_M = OFF_GROUND_M + UNCOVERED_M
TAKEN_M = 5.0
HALF = 0.5


@dataclass(frozen=True)
class Ground:
    """Where devices walk, ready to be matched.

    Parameters
    ----------
    grid : Grid
        The raster.
    free : ndarray, shape (rows, columns), bool
        Where they can be.
    """

    grid: Grid
    free: BoolArray

    @classmethod
    def of(cls, free_space: FreeSpace, cell_m: float | None = None) -> "Ground":
        """Return the ground of a map.

        Parameters
        ----------
        free_space : FreeSpace
            Its free cells.
        cell_m : float, optional
            Size of the cells to match on, metres; those of the free space by default.

        Returns
        -------
        Ground
            A coarse cell is free where half of it is.
        """
        grid = free_space.grid
        free = free_space.free[:-1].reshape(grid.shape)
        step = max(1, round((cell_m or grid.cell_m) / grid.cell_m))
        if step == 1:
            return cls(grid, free)
        rows, columns = -(-grid.rows // step), -(-grid.columns // step)
        padded = np.zeros((rows * step, columns * step), np.bool_)
        padded[: grid.rows, : grid.columns] = free
        share = padded.reshape(rows, step, columns, step).mean(axis=(1, 3))
        coarse = replace(grid, cell_m=grid.cell_m * step, columns=columns, rows=rows)
        return cls(coarse, share >= HALF)

    def mirrored(self) -> "Ground":
        """Return the mirror image, east for west.

        Returns
        -------
        Ground
            A crowd lies on it as its own mirror image lies on this one.
        """
        grid = self.grid
        east_m = grid.west_m + grid.columns * grid.cell_m
        return Ground(replace(grid, west_m=-east_m), np.ascontiguousarray(self.free[:, ::-1]))

    @cached_property
    def cells(self) -> FloatArray:
        """Middles of the free cells, shape (M, 2), metres."""
        return self.grid.centers()[self.free.ravel()]

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.cells)

    def nearest(self, xy: FloatArray) -> FloatArray:
        """Return the free cells that are closest to some places.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places, metres.

        Returns
        -------
        ndarray, shape (N, 2), float64
            Metres.
        """
        return self.cells[self._tree.query(xy)[1]]

    def without(self, xy: FloatArray) -> BoolArray:
        """Tell which ground is left beside a part of the crowd, for one that has not heard it.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places of its scans, metres.

        Returns
        -------
        ndarray, shape (rows, columns), bool
            The free cells that are not near them.
        """
        apart, _ = cKDTree(xy).query(self.cells, distance_upper_bound=TAKEN_M)
        left = self.free.copy()
        left[self.free] = np.isinf(apart)
        return left

    def mismatch_m(self, xy: FloatArray) -> float:
        """Return how badly scans and ground cover one another.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            Places of the scans, metres.

        Returns
        -------
        float
            Mean distance from the scans to the ground and from the ground to the scans, both
            bounded, metres.
        """
        off_ground = np.minimum(self._tree.query(xy)[0], OFF_GROUND_M)
        uncovered = np.minimum(cKDTree(xy).query(self.cells)[0], UNCOVERED_M)
        return float(off_ground.mean() + uncovered.mean())


def nearness_m(cells: BoolArray, cell_m: float, cap_m: float) -> FloatArray:
    """Return how much closer than a cap each cell is to the nearest of some cells.

    Squared distances are spread along the columns, then along the rows, no farther than the cap:
    less than the exact distance transform of the whole raster does.

    Parameters
    ----------
    cells : ndarray, shape (rows, columns), bool
        True for those cells.
    cell_m : float
        Size of a cell, metres.
    cap_m : float
        The cap, metres.

    Returns
    -------
    ndarray, shape (rows, columns), float64
        Metres, from 0 to the cap; 0 everywhere if there are none.

    Examples
    --------
    >>> nearness_m(np.array([[True, False, False]]), 2.0, 3.0).tolist()
    [[3.0, 1.0, 0.0]]
    >>> nearness_m(np.zeros((1, 2), np.bool_), 2.0, 3.0).tolist()
    [[0.0, 0.0]]
    """
    reach = int(cap_m / cell_m)
    squares = np.where(cells, np.int32(0), np.int32((reach + 1) ** 2))
    for _ in range(2):
        nearest = squares.copy()
        for away in range(1, reach + 1):
            beyond = squares + np.int32(away * away)
            np.minimum(nearest[away:], beyond[:-away], out=nearest[away:])
            np.minimum(nearest[:-away], beyond[away:], out=nearest[:-away])
        squares = np.ascontiguousarray(nearest.T)
    return np.maximum(cap_m - cell_m * np.sqrt(squares), 0.0)
