"""The Bayes filter on a fine grid: the exact posterior that particles have to come near to."""

import math

import numpy as np
from scipy import ndimage

from homsense import Delta, FreeSpace


class PointMassFilter:
    """The Bayes filter on a grid of places and headings: exact but for the grid.

    Parameters
    ----------
    free_space : FreeSpace
        The cells of the places.
    headings : int
        How many directions.
    """

    def __init__(self, free_space: FreeSpace, headings: int = 48) -> None:
        grid = free_space.grid
        self._cell_m = grid.cell_m
        self._free = free_space.free[:-1].reshape(grid.shape).astype(float)
        self._angles = (np.arange(headings) + 0.5) * 2 * np.pi / headings - np.pi
        self._mass = np.repeat(self._free[None], headings, axis=0)
        self._mass /= self._mass.sum()

    def move(self, delta: Delta) -> None:
        """Shift by the motion in each direction, blur by its deviations, drop what is blocked."""
        assert delta.std
        std_m, _, std_rad = delta.std
        moved = np.empty_like(self._mass)
        for index, angle in enumerate(self._angles):
            right = math.cos(angle) * delta.forward_m - math.sin(angle) * delta.left_m
            up = math.sin(angle) * delta.forward_m + math.cos(angle) * delta.left_m
            shifted = ndimage.shift(
                self._mass[index], (up / self._cell_m, right / self._cell_m), order=1
            )
            moved[index] = ndimage.gaussian_filter(shifted, std_m / self._cell_m, mode="constant")
        spacing = 2 * np.pi / len(self._angles)
        turned = (self._angles[:, None] - self._angles[None] - delta.turn_rad) / std_rad
        period = 2 * np.pi / std_rad
        near = turned - period * np.round(turned / period)
        kernel = np.exp(-0.5 * near**2) * spacing
        kernel /= kernel.sum(axis=0)
        self._mass = np.tensordot(kernel, moved, axes=1) * self._free
        self._mass /= self._mass.sum()

    def weigh(self, likelihood: np.ndarray) -> None:
        """Multiply by the likelihood of each cell, shape (rows, columns)."""
        self._mass *= likelihood
        self._mass /= self._mass.sum()

    def histogram(self, cells: int) -> np.ndarray:
        """Return the probability of squares of some cells a side."""
        places = self._mass.sum(axis=0)
        rows, columns = (-(-length // cells) * cells for length in places.shape)
        padded = np.pad(places, ((0, rows - places.shape[0]), (0, columns - places.shape[1])))
        squares = padded.reshape(rows // cells, cells, columns // cells, cells)
        return np.asarray(squares.sum(axis=(1, 3)))
