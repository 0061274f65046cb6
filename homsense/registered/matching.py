"""All shifts of a crowd over the ground at once.

A placement is good when the scans lie on the ground and when the ground is covered by scans. Both
sums are correlations, so all shifts are tried at once by FFT. Where the parts of a crowd lie to
one another is not known, so they are shifted in turn, each over the ground that the others leave.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from homsense.exact import exp
from homsense.registered.ground import OFF_GROUND_M, UNCOVERED_M, WORST_M, Ground, nearness_m

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Spectrum = NDArray[np.complex64]

M_PER_NAT = 0.06
SCALE, LOG_SCALE_SD = 1.05, 0.15
SWEEPS = 2
_BORDER = 12
_ROOM = 1.01
"""What is turned and rounded may reach a little farther than it did."""


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


class Fit(NamedTuple):
    """Where the parts of a crowd lie.

    Parameters
    ----------
    rotation_rad, scale : float
        Of all of them.
    at : ndarray, shape (P, 2), float64
        Where the origin of each comes to lie, metres.
    cost_m : float
        Of a `Placement`.
    """

    rotation_rad: float
    scale: float
    at: FloatArray
    cost_m: float

    def place(self, parts: Sequence[FloatArray]) -> list[FloatArray]:
        """Return places of the parts on the map.

        Parameters
        ----------
        parts : sequence of ndarray, shape (N, 2), float64
            Each around its origin, metres.

        Returns
        -------
        list of ndarray, shape (N, 2), float64
            Metres.
        """
        turned = Placement(self.rotation_rad, self.scale, 0.0, 0.0, 0.0)
        return [turned.place(part) + at for part, at in zip(parts, self.at, strict=True)]


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
        Metres, to be added to a cost: a layout comes out a little too small.
    """
    nats = 0.5 * (math.log(scale / SCALE) / LOG_SCALE_SD) ** 2
    if rotation_sd_rad is not None:
        nats += 0.5 * (math.remainder(rotation_rad, math.tau) / rotation_sd_rad) ** 2
    return M_PER_NAT * nats


def probabilities(costs_m: Sequence[float]) -> FloatArray:
    """Return how probable placements of one crowd are if one of them is true.

    Parameters
    ----------
    costs_m : sequence of float
        Of each, metres; at least one.

    Returns
    -------
    ndarray, shape (P,), float64
        Their sum is 1; a nat for each `M_PER_NAT`.

    Examples
    --------
    >>> probabilities([2.0, 2.0]).tolist()
    [0.5, 0.5]
    """
    weights = exp((min(costs_m) - np.asarray(costs_m)) / M_PER_NAT)
    return np.asarray(weights / weights.sum())


class Image(NamedTuple):
    """A part as it is correlated with ground.

    Parameters
    ----------
    corner : ndarray, shape (2,), float64
        Column and row of its first cell, in cells from the origin of the part.
    shape : tuple of int
        Rows and columns.
    scans, near_scans : ndarray, complex64
        Spectra, conjugate.
    """

    corner: FloatArray
    shape: tuple[int, int]
    scans: Spectrum
    near_scans: Spectrum


class Turned(NamedTuple):
    """The parts of a crowd, turned and scaled.

    Parameters
    ----------
    rotation_rad, scale : float
        Of all of them.
    places : list of ndarray, shape (N, 2), float64
        Each around its origin, metres.
    images : list of Image
        The same as they are correlated.
    """

    rotation_rad: float
    scale: float
    places: list[FloatArray]
    images: list[Image]


class Facing(NamedTuple):
    """Ground as it is correlated with a part.

    Parameters
    ----------
    near_ground, ground : ndarray, complex64
        Spectra.
    """

    near_ground: Spectrum
    ground: Spectrum


class Matcher:
    """One ground and the parts of one layout.

    Parameters
    ----------
    ground : Ground
        Where devices walk.
    parts : sequence of ndarray, shape (N, 2), float64
        Each around its middle, metres, the largest first.
    rotation_sd_rad : float or None
        How far the headings of the crowd are from those of the map; unknown when None.
    greatest_scale : float
        Of the placements to be tried: the less, the faster.
    """

    def __init__(
        self,
        ground: Ground,
        parts: Sequence[FloatArray],
        rotation_sd_rad: float | None,
        greatest_scale: float,
    ) -> None:
        self._ground, self._grid = ground, ground.grid
        self._parts, self._rotation_sd_rad = parts, rotation_sd_rad
        self._scans = sum(map(len, parts))
        reach = _ROOM * greatest_scale * max(np.linalg.norm(part, axis=1).max() for part in parts)
        side = math.ceil(2.0 * reach / self._grid.cell_m) + 4 * _BORDER
        self._size = tuple(
            fft.next_fast_len(length + side, real=True) for length in ground.free.shape
        )
        self._whole = self._facing(ground.free)

    def turned(self, rotation_rad: float, scale: float) -> Turned:
        """Return the parts, turned and scaled.

        Parameters
        ----------
        rotation_rad, scale : float
            Of all parts.

        Returns
        -------
        Turned
            For `best`, also of a matcher whose ground has the same shape.
        """
        unmoved = Placement(rotation_rad, scale, 0.0, 0.0, 0.0)
        places = [unmoved.place(part) for part in self._parts]
        return Turned(rotation_rad, scale, places, [self._image(xy) for xy in places])

    def best(self, turned: Turned, beside: Sequence[Facing] | None = None) -> Fit:
        """Return the best shifts.

        Parameters
        ----------
        turned : Turned
            The parts.
        beside : sequence of Facing, optional
            The ground for each part; for each what the others leave by default.

        Returns
        -------
        Fit
            Of the only part the best one, of several a good one.
        """
        rotation_rad, scale, places, images = turned
        at = np.zeros((len(places), 2))
        unlikely = unlikely_m(rotation_rad, scale, self._rotation_sd_rad)
        if len(places) == 1:
            at[0], gained = self._shift(images[0], self._whole)
            return Fit(rotation_rad, scale, at, WORST_M - gained + unlikely)
        lying: list[FloatArray] = []
        for number in [*range(len(places))] * (SWEEPS if beside is None else 1):
            facing = self._left_by(lying, number) if beside is None else beside[number]
            at[number], _ = self._shift(images[number], facing)
            lying[number : number + 1] = [places[number] + at[number]]
        cost = self._ground.mismatch_m(np.concatenate(lying)) + unlikely
        return Fit(rotation_rad, scale, at, cost)

    def beside(self, fit: Fit) -> list[Facing]:
        """Return the ground that is left for each part beside the others.

        Parameters
        ----------
        fit : Fit
            Where they lie.

        Returns
        -------
        list of Facing
            For `best`.
        """
        lying = fit.place(self._parts)
        return [self._left_by(lying, number) for number in range(len(lying))]

    def _left_by(self, lying: Sequence[FloatArray], number: int) -> Facing:
        others = [xy for other, xy in enumerate(lying) if other != number]
        if not others:
            return self._whole
        return self._facing(self._ground.without(np.concatenate(others)))

    def _facing(self, free: BoolArray) -> Facing:
        wide = np.zeros(self._size, np.bool_)
        rows, columns = free.shape
        wide[_BORDER : _BORDER + rows, _BORDER : _BORDER + columns] = free
        return Facing(
            self._spectrum(nearness_m(wide, self._grid.cell_m, OFF_GROUND_M)),
            self._spectrum(wide / self._ground.free.sum()),
        )

    def _image(self, places: FloatArray) -> Image:
        turned = places / self._grid.cell_m
        corner = np.floor(turned.min(axis=0)) - _BORDER // 2
        column, row = np.floor(turned - corner).astype(np.int64).T
        scans = np.zeros((row.max() + _BORDER // 2 + 1, column.max() + _BORDER // 2 + 1))
        np.add.at(scans, (row, column), 1.0 / self._scans)
        near_scans = nearness_m(scans > 0.0, self._grid.cell_m, UNCOVERED_M)
        return Image(
            corner,
            scans.shape,
            np.conj(self._spectrum(scans)),
            np.conj(self._spectrum(near_scans)),
        )

    def _shift(self, image: Image, facing: Facing) -> tuple[FloatArray, float]:
        """Return the best shift of a part, and what it gains."""
        gained = fft.irfft2(
            image.scans * facing.near_ground + image.near_scans * facing.ground, self._size
        )
        best = np.unravel_index(int(gained.argmax()), self._size)
        rows, columns = (
            int(cells) - (size if cells > size - length else 0)
            for cells, size, length in zip(best, self._size, image.shape, strict=True)
        )
        moved = np.array([columns, rows]) - _BORDER - image.corner
        at = (self._grid.west_m, self._grid.south_m) + moved * self._grid.cell_m
        return at, float(gained[best])

    def _spectrum(self, image: FloatArray) -> Spectrum:
        """Return what `scipy.fft.rfft2` does, without transforming the rows that it would add."""
        rows, columns = self._size
        of_rows = fft.rfft(image.astype(np.float32), columns, axis=1)
        return np.asarray(fft.fft(of_rows, rows, axis=0, overwrite_x=True))
