"""The position histogram of weighted particles, in whole numbers."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from homsense.particles import Particles
from homsense.weights import Weights

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_CELLS = 250_000
MARGIN = 4
"""Empty cells on each side, twice what the kernel reaches: no cell with mass lies at the edge."""
KEY_BITS = 63


@dataclass(frozen=True)
class Histogram:
    """Mass of the particles by cell, as it is and smoothed by the kernel 1 4 6 4 1 both ways.

    Parameters
    ----------
    cell_m : float
        Side of a cell, metres.
    column, row : int
        Which cell of the plane comes first; cell (0, 0) begins at the origin of the site frame.
    cells : ndarray, shape (N,), int64
        Flat index of the cell of each particle.
    smooth : ndarray, shape (rows, columns), int64
        Smoothed mass, 256 for each unit of weight.
    order : ndarray, int64
        Flat indices of the cells with mass, heaviest first.
    """

    cell_m: float
    column: int
    row: int
    cells: IntArray
    smooth: IntArray
    order: IntArray

    @property
    def corner(self) -> tuple[float, float]:
        """South-west corner of the first cell, metres."""
        return self.column * self.cell_m, self.row * self.cell_m

    @property
    def density(self) -> FloatArray:
        """Probability of each cell."""
        density: FloatArray = self.smooth / self.smooth.sum()
        return density

    def region(self, level: float) -> BoolArray:
        """Return the fewest cells that hold a share of the mass.

        Parameters
        ----------
        level : float
            Share, in (0, 1).

        Returns
        -------
        ndarray, shape (rows, columns), bool
            Cells of the region.
        """
        inside = np.zeros(self.smooth.size, np.bool_)
        inside[self.order[: self.needed(level)]] = True
        return inside.reshape(self.smooth.shape)

    def needed(self, level: float) -> int:
        """Return how many of the heaviest cells hold a share of the mass.

        Parameters
        ----------
        level : float
            Share, in (0, 1).

        Returns
        -------
        int
            At least 1.
        """
        reached = self._reached
        return int(np.searchsorted(reached, math.ceil(level * reached[-1]))) + 1

    @cached_property
    def _reached(self) -> IntArray:
        return np.cumsum(self.smooth.ravel()[self.order])


def fitting_cell_m(particles: Particles, cell_m: float) -> float:
    """Return a cell size at which the histogram stays small.

    Parameters
    ----------
    particles : Particles
        What it is of.
    cell_m : float
        Wanted size, metres.

    Returns
    -------
    float
        The size, doubled as often as it takes.
    """
    wide = float(particles.x_m.max()) - float(particles.x_m.min())
    high = float(particles.y_m.max()) - float(particles.y_m.min())
    while (wide / cell_m + 2 * MARGIN + 2) * (high / cell_m + 2 * MARGIN + 2) > MAX_CELLS:
        cell_m *= 2.0
    return cell_m


def histogram(particles: Particles, weights: Weights, cell_m: float) -> Histogram:
    """Return the histogram of some particles.

    Parameters
    ----------
    particles : Particles
        Where.
    weights : ndarray, shape (N,), uint32
        How heavy.
    cell_m : float
        Side of a cell, metres.

    Returns
    -------
    Histogram
        With an empty margin around it.
    """
    per_m = np.float32(1.0 / cell_m)
    column = np.floor(particles.x_m * per_m).astype(np.int64)
    row = np.floor(particles.y_m * per_m).astype(np.int64)
    west, south = int(column.min()) - MARGIN, int(row.min()) - MARGIN
    columns, rows = int(column.max()) - west + MARGIN + 1, int(row.max()) - south + MARGIN + 1
    cells = (row - south) * columns + (column - west)
    mass = np.bincount(cells, weights=weights, minlength=rows * columns).astype(np.int64)
    smooth = _smoothed(_smoothed(mass, 1), columns)
    order = heaviest_first(smooth)
    return Histogram(cell_m, west, south, cells, smooth.reshape(rows, columns), order)


def heaviest_first(smooth: IntArray) -> IntArray:
    """Return the cells with mass in falling order.

    Parameters
    ----------
    smooth : ndarray, int64
        Mass of each cell, not negative.

    Returns
    -------
    ndarray, int64
        Indices; of equals the first comes first.

    Examples
    --------
    >>> heaviest_first(np.array([2, 0, 5, 2])).tolist()
    [2, 0, 3]
    """
    heavy = np.flatnonzero(smooth > 0)
    index_bits = smooth.size.bit_length()
    if int(smooth.max(initial=0)).bit_length() + index_bits >= KEY_BITS:
        return heavy[np.argsort(-smooth[heavy], kind="stable")]
    return by_keys((-smooth[heavy] << index_bits) | heavy, index_bits)


def by_keys(keys: IntArray, index_bits: int) -> IntArray:
    """Sort indices by keys that hold them, which is many times faster than by other numbers.

    Parameters
    ----------
    keys : ndarray, int64
        What to sort by, then the index; sorted in place.
    index_bits : int
        How many bits the index has.

    Returns
    -------
    ndarray, int64
        Indices.
    """
    keys.sort()
    return keys & ((1 << index_bits) - 1)


def _smoothed(mass: IntArray, apart: int) -> IntArray:
    """Apply the kernel along the cells that lie so far apart; what it meets at the edge is 0."""
    near, far = mass[apart : -3 * apart] + mass[3 * apart : -apart], mass[: -4 * apart]
    smooth = np.zeros_like(mass)
    smooth[2 * apart : -2 * apart] = (
        6 * mass[2 * apart : -2 * apart] + 4 * near + far + mass[4 * apart :]
    )
    return smooth
