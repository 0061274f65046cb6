"""Match with the map: the rotation, scale and shift that lay a crowd over the ground.

A placement is good when the scans lie on the ground and when the ground is covered by scans. Both
sums are correlations, so all shifts are tried at once by FFT.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage
from scipy.spatial import cKDTree

from homsense.free_space import FreeSpace
from homsense.grid import Grid

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

OFF_GROUND_M, UNCOVERED_M = 6.0, 10.0
WORST_M = OFF_GROUND_M + UNCOVERED_M
M_PER_NAT = 0.06
SCALE, LOG_SCALE_SD = 1.15, 0.15
SCALES = tuple(float(scale) for scale in np.geomspace(0.8, 1.8, 9))
ROTATION_STEP = math.radians(6.0)
COARSE_M = 2.0
DISTINCT_M = 15.0
HALF = 0.5
_FINER = ((math.radians(3.0), 0.05), (math.radians(1.5), 0.025))
_BORDER = 12


class Placement(NamedTuple):
    """Where a layout lies on the map.

    Parameters
    ----------
    rotation_rad : float
        Counter-clockwise.
    scale : float
        Of its lengths.
    east_m, north_m : float
        Where its origin comes to lie.
    cost_m : float
        Mean distance from the scans to the ground and from the ground to the scans, both bounded,
        and what rotation and scale are unlikely by.
    """

    rotation_rad: float
    scale: float
    east_m: float
    north_m: float
    cost_m: float

    def place(self, xy: FloatArray) -> FloatArray:
        """Return places of the layout on the map.

        Parameters
        ----------
        xy : ndarray, shape (N, 2), float64
            In the frame of the layout, metres.

        Returns
        -------
        ndarray, shape (N, 2), float64
            Metres.

        Examples
        --------
        >>> quarter = Placement(math.pi / 2, 2.0, 10.0, 0.0, 0.0)
        >>> quarter.place(np.array([[1.0, 0.0]])).round(6).tolist()
        [[10.0, 2.0]]
        """
        cos = self.scale * math.cos(self.rotation_rad)
        sin = self.scale * math.sin(self.rotation_rad)
        x, y = xy[:, 0], xy[:, 1]
        return np.stack(
            [cos * x - sin * y + self.east_m, sin * x + cos * y + self.north_m], axis=1
        )


@dataclass(frozen=True)
class Registration:
    """How a crowd lies on a map.

    Parameters
    ----------
    placements : tuple of Placement
        Distinct ones, the best first.
    """

    placements: tuple[Placement, ...]

    @property
    def margin_m(self) -> float:
        """How much better the best one is than the next; infinite when there is only one."""
        if len(self.placements) == 1:
            return math.inf
        return self.placements[1].cost_m - self.placements[0].cost_m


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


def register(
    xy: FloatArray, free_space: FreeSpace, rotation_sd_rad: float | None = None, keep: int = 8
) -> Registration:
    """Search the placements of a layout.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Layout of the crowd, metres.
    free_space : FreeSpace
        Of the map.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the map, radians; unknown when absent.
    keep : int, default 8
        Most placements.

    Returns
    -------
    Registration
        Full turn, free scale, all shifts.
    """
    middle = xy.mean(axis=0)
    shape = xy - middle
    coarse = _Matcher(Ground.of(free_space, COARSE_M), shape, rotation_sd_rad)
    tried = [
        coarse.best(turn * ROTATION_STEP, scale)
        for turn in range(round(math.tau / ROTATION_STEP))
        for scale in SCALES
    ]
    fine = _Matcher(Ground.of(free_space), shape, rotation_sd_rad)
    found = _distinct(
        [_finer(fine, start) for start in _distinct(tried, shape, keep)], shape, keep
    )
    return Registration(tuple(_moved(placement, middle) for placement in found))


def _distinct(placements: Sequence[Placement], shape: FloatArray, keep: int) -> list[Placement]:
    """Return the best placements that lie apart from better ones."""
    chosen: list[Placement] = []
    for placement in sorted(placements, key=lambda found: found.cost_m):
        places = placement.place(shape)
        if all(_rms(places - other.place(shape)) > DISTINCT_M for other in chosen):
            chosen.append(placement)
        if len(chosen) == keep:
            break
    return chosen


def _finer(matcher: "_Matcher", start: Placement) -> Placement:
    best = start
    for turn, stretch in _FINER:
        around = [
            matcher.best(best.rotation_rad + i * turn, best.scale * (1.0 + j * stretch))
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        ]
        best = min(around, key=lambda found: found.cost_m)
    return best


def _moved(placement: Placement, middle: FloatArray) -> Placement:
    """Return the placement of a layout that has been moved to its middle before."""
    (east, north) = placement._replace(east_m=0.0, north_m=0.0).place(-middle[None])[0]
    return placement._replace(east_m=placement.east_m + east, north_m=placement.north_m + north)


def _rms(apart: FloatArray) -> float:
    return float(np.sqrt((apart * apart).sum(axis=1).mean()))


class _Matcher:
    """All shifts at once for one ground and one layout."""

    def __init__(self, ground: Ground, shape: FloatArray, rotation_sd_rad: float | None) -> None:
        self._grid, self._shape, self._rotation_sd_rad = ground.grid, shape, rotation_sd_rad
        reach = np.linalg.norm(shape, axis=1).max() * max(SCALES) * 1.1
        side = math.ceil(2.0 * reach / ground.grid.cell_m) + 4 * _BORDER
        rows, columns = ground.free.shape
        self._size = tuple(
            fft.next_fast_len(length + side, real=True) for length in (rows, columns)
        )
        wide = np.zeros(self._size, np.bool_)
        wide[_BORDER : _BORDER + rows, _BORDER : _BORDER + columns] = ground.free
        self._near_ground = self._transform(_nearness(wide, self._grid.cell_m, OFF_GROUND_M))
        self._ground = self._transform(wide / wide.sum())

    def best(self, rotation_rad: float, scale: float) -> Placement:
        """Return the best shift."""
        cell_m = self._grid.cell_m
        turned = Placement(rotation_rad, scale, 0.0, 0.0, 0.0).place(self._shape) / cell_m
        corner = np.floor(turned.min(axis=0)) - _BORDER // 2
        column, row = np.floor(turned - corner).astype(np.int64).T
        scans = np.zeros((row.max() + _BORDER // 2 + 1, column.max() + _BORDER // 2 + 1))
        np.add.at(scans, (row, column), 1.0 / len(row))
        near_scans = _nearness(scans > 0.0, cell_m, UNCOVERED_M)
        gained = fft.irfft2(
            np.conj(self._transform(scans)) * self._near_ground
            + np.conj(self._transform(near_scans)) * self._ground,
            self._size,
        )
        up, right = (int(n) for n in np.unravel_index(int(gained.argmax()), self._size))
        cost = WORST_M - float(gained[up, right]) + self._unlikely_m(rotation_rad, scale)
        up -= self._size[0] if up > self._size[0] - scans.shape[0] else 0
        right -= self._size[1] if right > self._size[1] - scans.shape[1] else 0
        east = self._grid.west_m + (right - _BORDER - corner[0]) * cell_m
        north = self._grid.south_m + (up - _BORDER - corner[1]) * cell_m
        return Placement(rotation_rad, scale, east, north, cost)

    def _transform(self, image: FloatArray) -> NDArray[np.complex128]:
        return np.asarray(fft.rfft2(image, self._size))

    def _unlikely_m(self, rotation_rad: float, scale: float) -> float:
        nats = 0.5 * (math.log(scale / SCALE) / LOG_SCALE_SD) ** 2
        if self._rotation_sd_rad is not None:
            turn = math.remainder(rotation_rad, math.tau)
            nats += 0.5 * (turn / self._rotation_sd_rad) ** 2
        return M_PER_NAT * nats


def _nearness(cells: BoolArray, cell_m: float, cap_m: float) -> FloatArray:
    """Return how much closer than a cap each cell is to the nearest of some cells, metres."""
    apart = cell_m * ndimage.distance_transform_edt(~cells)
    return np.maximum(cap_m - apart, 0.0)
