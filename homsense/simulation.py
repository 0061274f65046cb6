"""Sites that could be this one: random placements of transmitters, and a crowd that hears them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from homsense.engine import Engine
from homsense.free_space import FreeSpace
from homsense.grid import Grid
from homsense.height import HeightMap
from homsense.profiles import Profiles
from homsense.radio import RadioModel, crowd_places, placement
from homsense.sight import in_view
from homsense.simplicial import LandmarkComplex

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

WORLDS = 24
_PLACES = 3000


@dataclass(frozen=True)
class Stage:
    """Places at which holes are counted: one for each coarse cell that has free space.

    Parameters
    ----------
    free_space : FreeSpace
        Of the map.
    grid : Grid
        The coarse cells.
    cells : ndarray, shape (P,), intp
        Those with free space.
    places : ndarray, shape (P, 2), float64
        The free place nearest to the middle of each, metres.
    """

    free_space: FreeSpace
    grid: Grid
    cells: IntArray
    places: FloatArray

    @classmethod
    def of(cls, free_space: FreeSpace) -> Self:
        """Return some three thousand places, or all the cells of a small map.

        Parameters
        ----------
        free_space : FreeSpace
            Of the map.

        Returns
        -------
        Stage
            Its cells are a whole number of those of the free space wide.
        """
        fine = free_space.grid
        centers = fine.centers()[free_space.free[:-1]]
        times = max(1, round(np.sqrt(len(centers) / _PLACES)))
        columns, rows = -(-fine.columns // times), -(-fine.rows // times)
        grid = Grid(fine.west_m, fine.south_m, times * fine.cell_m, columns, rows)
        cell = grid.flat_index(centers)
        from_middle = np.square(centers - grid.centers()[cell]).sum(axis=1)
        order = np.lexsort((from_middle, cell))
        cells, first = np.unique(cell[order], return_index=True)
        return cls(free_space, grid, cells, centers[order[first]])

    def raster(self, values: FloatArray) -> HeightMap:
        """Return values of the places as a map.

        Parameters
        ----------
        values : ndarray, shape (P,), float64
            One for each place.

        Returns
        -------
        HeightMap
            Not a number where there is no free space.
        """
        field = np.full(self.grid.rows * self.grid.columns, np.nan, np.float32)
        field[self.cells] = values
        return HeightMap(self.grid, field.reshape(self.grid.shape), None)


class World(NamedTuple):
    """One random placement.

    Parameters
    ----------
    holes : ndarray, shape (P, n_levels), float64
        Mean holes of the landmarks that are heard at each place; not a number where none is.
    profiles : ndarray, shape (T, n_levels), float64
        Holes near each landmark.
    """

    holes: FloatArray
    profiles: FloatArray


def simulate(  # noqa: PLR0913 - all that a simulation takes
    stage: Stage,
    radio: RadioModel,
    hops: Sequence[int],
    *,
    worlds: int = WORLDS,
    walked: FloatArray | None = None,
    seed: int = 0,
    engine: Engine | None = None,
) -> Iterator[World]:
    """Count holes at all places of a map, for one random placement after the other.

    Parameters
    ----------
    stage : Stage
        The places.
    radio : RadioModel
        How transmitters are placed and heard.
    hops : sequence of int
        Neighborhoods, rising.
    worlds : int, default 24
        How many placements.
    walked : ndarray, shape (W, 2), float64, optional
        Where the crowd has been, metres; anywhere when absent.
    seed : int, default 0
        Decides them.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.

    Yields
    ------
    World
        What is counted.
    """
    free_space, names = stage.free_space, list(map(str, range(radio.transmitters)))
    for world in range(worlds):
        rng = np.random.Generator(np.random.Philox(key=[seed, world]))
        where = placement(free_space, rng, radio.transmitters, radio.evenness)
        crowd = crowd_places(free_space, rng, radio.scans, walked)
        heard = radio.heard(in_view(free_space, where, crowd, radio.range_m), rng)
        scans = [[names[i] for i in seen] for seen in heard.by_place(len(crowd))]
        grown = LandmarkComplex.from_observations([seen for seen in scans if seen], engine)
        holes = Profiles(grown, hops).table(names)
        here = radio.heard(in_view(free_space, where, stage.places, radio.range_m), rng)
        here = here.kept(~np.isnan(holes[here.transmitter, 0]))
        n_places = len(stage.places)
        sums = [
            np.bincount(here.place, holes[here.transmitter, level], n_places)
            for level in range(len(hops))
        ]
        with np.errstate(invalid="ignore"):
            means = np.stack(sums, axis=1) / np.bincount(here.place, minlength=n_places)[:, None]
        yield World(means, holes[~np.isnan(holes[:, 0])])
