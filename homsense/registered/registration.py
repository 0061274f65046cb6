"""Match with the map: the rotation, scale and shift that lay a crowd over the ground.

A placement is good when the scans lie on the ground and when the ground is covered by scans. Both
sums are correlations, so all shifts are tried at once by FFT.
"""

import math
from collections.abc import Iterable
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
DOUBTFUL_M, MIRRORED_M = 0.4, 0.3
SCALE, LOG_SCALE_SD = 1.15, 0.15
SCALES = tuple(float(scale) for scale in np.geomspace(0.8, 1.8, 9))
ROTATION_STEP = math.radians(6.0)
COARSE_M, COARSE_CELLS = 2.0, 200
LIKELY_ROTATIONS = 6.0
SIMILAR_M, SIMILAR = 6.0, 8
DISTINCT_M, DISTINCT = 15.0, 4
HALF = 0.5
_FINER = ((math.radians(3.0), 0.05), (math.radians(1.5), 0.025))
COMPASS_RAD = 0.07
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
        Distinct ones, the best first; their costs are those after the crowd has settled there.
    mirror_margin_m : float
        How much worse the mirror image of the crowd fits, metres: a control that needs no truth.
    """

    placements: tuple[Placement, ...]
    mirror_margin_m: float

    @property
    def cost_m(self) -> float:
        """Cost of the best placement, metres."""
        return self.placements[0].cost_m

    @property
    def margin_m(self) -> float:
        """How much better the best one is than the next, metres; `WORST_M` if there is none."""
        others = [placement.cost_m for placement in self.placements[1:]]
        return min(others, default=WORST_M + self.cost_m) - self.cost_m

    @property
    def is_doubtful(self) -> bool:
        """Whether another placement is nearly as good, or the mirror image is: a wrong map."""
        return self.margin_m < DOUBTFUL_M or self.mirror_margin_m < MIRRORED_M


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


def register(
    xy: FloatArray,
    free_space: FreeSpace,
    rotation_sd_rad: float | None = None,
    *,
    thorough: bool = True,
) -> list[Placement]:
    """Search the placements of a layout.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Layout of the crowd, metres.
    free_space : FreeSpace
        Of the map.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the map, radians; unknown when absent.
    thorough : bool, default True
        Whether to look closely at more than the most promising one.

    Returns
    -------
    list of Placement
        Full turn unless most of it is unlikely, free scale, all shifts.
    """
    middle = xy.mean(axis=0)
    shape = xy - middle
    cell_m = max(COARSE_M, max(free_space.grid.shape) * free_space.grid.cell_m / COARSE_CELLS)
    coarse = _Matcher(Ground.of(free_space, cell_m), shape, rotation_sd_rad)
    steps = round(math.pi / ROTATION_STEP)
    if rotation_sd_rad is not None:
        steps = min(steps, math.ceil(LIKELY_ROTATIONS * rotation_sd_rad / ROTATION_STEP))
    tried = [
        coarse.best(turn * ROTATION_STEP, scale)
        for turn in range(-steps, steps + 1)
        for scale in SCALES
    ]
    fine = _Matcher(Ground.of(free_space), shape, rotation_sd_rad)
    ordered = sorted(tried, key=lambda placement: placement.cost_m)
    places = [placement.place(shape) for placement in ordered]
    chosen = {0}
    if thorough:
        chosen = {*apart(places, SIMILAR_M, SIMILAR), *apart(places, DISTINCT_M, DISTINCT)}
    return [_moved(_finer(fine, ordered[number]), middle) for number in sorted(chosen)]


def apart(layouts: Iterable[FloatArray], least_m: float, keep: int) -> list[int]:
    """Return which of some layouts lie apart from all before them.

    Parameters
    ----------
    layouts : iterable of ndarray, shape (N, 2), float64
        Places of the same scans, metres.
    least_m : float
        Root mean square distance that counts, metres.
    keep : int
        How many to return at most.

    Returns
    -------
    list of int
        Numbers, the first one among them.
    """
    chosen: list[tuple[int, FloatArray]] = []
    for number, xy in enumerate(layouts):
        if len(chosen) == keep:
            break
        if all(_rms(xy - other) > least_m for _, other in chosen):
            chosen.append((number, xy))
    return [number for number, _ in chosen]


def unlikely_m(rotation_rad: float, scale: float, rotation_sd_rad: float | None) -> float:
    """Return what rotation and scale are unlikely by.

    Parameters
    ----------
    rotation_rad, scale : float
        Of a placement.
    rotation_sd_rad : float or None
        How far the headings of the crowd are from those of the map; unknown when None.

    Returns
    -------
    float
        Metres, to be added to a cost: a layout comes out too small by a predictable amount.
    """
    nats = 0.5 * (math.log(scale / SCALE) / LOG_SCALE_SD) ** 2
    if rotation_sd_rad is not None:
        nats += 0.5 * (math.remainder(rotation_rad, math.tau) / rotation_sd_rad) ** 2
    return M_PER_NAT * nats


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
        cost = (
            WORST_M
            - float(gained[up, right])
            + unlikely_m(rotation_rad, scale, self._rotation_sd_rad)
        )
        up -= self._size[0] if up > self._size[0] - scans.shape[0] else 0
        right -= self._size[1] if right > self._size[1] - scans.shape[1] else 0
        east = self._grid.west_m + (right - _BORDER - corner[0]) * cell_m
        north = self._grid.south_m + (up - _BORDER - corner[1]) * cell_m
        return Placement(rotation_rad, scale, east, north, cost)

    def _transform(self, image: FloatArray) -> NDArray[np.complex64]:
        return np.asarray(fft.rfft2(image.astype(np.float32), self._size))


def _nearness(cells: BoolArray, cell_m: float, cap_m: float) -> FloatArray:
    """Return how much closer than a cap each cell is to the nearest of some cells, metres."""
    apart = cell_m * ndimage.distance_transform_edt(~cells)
    return np.maximum(cap_m - apart, 0.0)
