"""How a site hears its transmitters, learnt from scans whose places nobody knows.

Random placements on the map are heard by a random crowd; the range, the dropout and the evenness
of the placement under which scans look most like the site's own are taken for the site's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from homsense.earth_mover import earth_mover_distance
from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.sight import Sightings, in_view

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Rng = np.random.Generator

DROPOUTS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.45)
EVENNESS = (1, 3, 10, 40)
MOST_SCANS = 1500
MOST_CROWD = 6000
_MOST_PAIRS = 400_000
_RANGE_STEP_M = 0.5


@dataclass(frozen=True, slots=True)
class RadioModel:
    """What decides how a random placement is heard.

    Parameters
    ----------
    transmitters : int
        How many there are.
    range_m : float
        No transmitter is heard from farther away, metres.
    dropout : float, default 0.0
        Probability that a transmitter in view is missed, in [0, 1).
    evenness : int, default 1
        Each transmitter is put where, of so many random places, the others are farthest; 1 places
        them independently.
    scans : int, default 1500
        Scans of the crowd that build the complex.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """

    transmitters: int
    range_m: float
    dropout: float = 0.0
    evenness: int = 1
    scans: int = MOST_SCANS

    def __post_init__(self) -> None:
        for name in ("transmitters", "evenness", "scans"):
            if getattr(self, name) < 1:
                message = f"{name} must be at least 1, not {getattr(self, name)}"
                raise InvalidInputError(message, name)
        if not (np.isfinite(self.range_m) and self.range_m > 0.0):
            message = f"range_m must be positive, not {self.range_m}"
            raise InvalidInputError(message, "range_m")
        if not 0.0 <= self.dropout < 1.0:
            message = f"dropout must be in [0, 1), not {self.dropout}"
            raise InvalidInputError(message, "dropout")

    def heard(self, seen: Sightings, rng: Rng) -> Sightings:
        """Drop what a device misses.

        Parameters
        ----------
        seen : Sightings
            All that is in view.
        rng : numpy.random.Generator
            Decides.

        Returns
        -------
        Sightings
            What is left.
        """
        return seen.kept(rng.random(len(seen.place)) >= self.dropout)


def free_places(free_space: FreeSpace, rng: Rng, count: int) -> FloatArray:
    """Draw places uniformly over free space.

    Parameters
    ----------
    free_space : FreeSpace
        Where.
    rng : numpy.random.Generator
        Decides.
    count : int
        How many.

    Returns
    -------
    ndarray, shape (count, 2), float64
        Metres.
    """
    words = rng.integers(2**32, size=(3, count), dtype=np.uint32)
    return np.stack(free_space.draw(words), axis=1, dtype=np.float64)


def placement(free_space: FreeSpace, rng: Rng, count: int, evenness: int) -> FloatArray:
    """Draw places for transmitters, each the best of some candidates (Mitchell 1991).

    Parameters
    ----------
    free_space : FreeSpace
        Where.
    rng : numpy.random.Generator
        Decides.
    count : int
        How many transmitters.
    evenness : int
        Candidates for each, at least 1.

    Returns
    -------
    ndarray, shape (count, 2), float64
        Metres.
    """
    tried = free_places(free_space, rng, count * evenness).reshape(count, evenness, 2)
    if evenness == 1:
        return tried[:, 0]
    gaps = np.full((count, evenness), np.inf)
    chosen = np.empty((count, 2))
    for number in range(count):
        chosen[number] = tried[number, gaps[number].argmax()]
        rest = tried[number + 1 :]
        apart = np.square(rest - chosen[number]).sum(axis=2)
        np.minimum(gaps[number + 1 :], apart, out=gaps[number + 1 :])
    return chosen


def estimate_radio(
    free_space: FreeSpace,
    observations: Sequence[frozenset[str]],
    *,
    transmitters: int | None = None,
    scans: int | None = None,
    seed: int = 0,
) -> RadioModel:
    """Learn range, dropout and evenness from unlabeled scans by simulated moments.

    Parameters
    ----------
    free_space : FreeSpace
        Of the site's map.
    observations : sequence of frozenset of str
        What scans have heard; empty ones are ignored.
    transmitters, scans : int, optional
        How many the site has, when the observations are a sample.
    seed : int, default 0
        Decides the placements that are tried.

    Returns
    -------
    RadioModel
        The one whose scans are most like the observed ones: by the distribution of their sizes,
        and by how much each shares with the scan most like it.

    Raises
    ------
    InvalidInputError
        If there is no observation.
    """
    heard = [observation for observation in observations if observation]
    if not heard:
        message = "nothing can be learnt from no scans"
        raise InvalidInputError(message, "observations")
    names = {name: number for number, name in enumerate(sorted(set().union(*heard)))}
    count = max(len(names), transmitters or 0)
    rng = np.random.Generator(np.random.Philox(key=seed))
    most = max(50, min(MOST_SCANS, _MOST_PAIRS // count, len(heard)))
    some = [heard[i] for i in rng.permutation(len(heard))[:most]]
    scan = np.repeat(np.arange(len(some)), [len(observation) for observation in some])
    what = np.array([names[name] for observation in some for name in sorted(observation)])
    observed = _looks(scan, what, len(names))
    tried = product(EVENNESS, DROPOUTS)
    models = (
        _Fitted.of(free_space, rng, observed, count, evenness, dropout)
        for evenness, dropout in tried
    )
    best = min(models, key=lambda fitted: fitted.misfit)
    return RadioModel(
        count,
        max(1, round(best.range_m / _RANGE_STEP_M)) * _RANGE_STEP_M,
        best.dropout,
        best.evenness,
        min(MOST_CROWD, scans or len(heard)),
    )


@dataclass(frozen=True, slots=True)
class _Looks:
    """What scans look like: how large each is, and how much the most similar other one shares."""

    sizes: IntArray
    likeness: FloatArray


@dataclass(frozen=True, slots=True)
class _Fitted:
    misfit: float
    range_m: float
    dropout: float
    evenness: int

    @classmethod
    def of(
        cls,
        free_space: FreeSpace,
        rng: Rng,
        observed: _Looks,
        transmitters: int,
        evenness: int,
        dropout: float,
    ) -> "_Fitted":
        where = placement(free_space, rng, transmitters, evenness)
        places = free_places(free_space, rng, len(observed.sizes))
        grid = free_space.grid
        farthest = np.hypot(grid.columns, grid.rows) * grid.cell_m
        wanted = float(observed.sizes.mean())
        reach = farthest / 8.0
        while True:
            seen = in_view(free_space, where, places, reach)
            kept = seen.kept(rng.random(len(seen.place)) >= dropout)
            range_m = _range_for(kept, wanted)
            if range_m is not None or reach >= farthest:
                break
            reach = min(2.0 * reach, farthest)
        if range_m is None:
            range_m = farthest
        within = kept.kept(kept.distance_m <= range_m)
        simulated = _looks(within.place, within.transmitter, transmitters)
        if not len(simulated.sizes):
            return cls(math.inf, range_m, dropout, evenness)
        misfit = earth_mover_distance(simulated.sizes, observed.sizes) / wanted
        misfit += earth_mover_distance(simulated.likeness, observed.likeness)
        return cls(float(misfit), range_m, dropout, evenness)


def _range_for(seen: Sightings, wanted: float) -> float | None:
    """Return the range at which scans that hear anything hear so many, if it is long enough."""
    ranges = np.sort(seen.distance_m)
    low, high = 0, len(ranges)
    if not high or _mean_size(seen, float(ranges[-1])) < wanted:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if _mean_size(seen, float(ranges[middle - 1])) < wanted:
            low = middle
        else:
            high = middle
    return float(ranges[high - 1])


def _mean_size(seen: Sightings, range_m: float) -> float:
    within = seen.place[seen.distance_m <= range_m]
    return len(within) / max(1, len(np.unique(within)))


def _looks(scan: IntArray, what: IntArray, transmitters: int) -> _Looks:
    _, scan = np.unique(scan, return_inverse=True)
    n_scans = int(scan.max(initial=-1)) + 1
    ones = np.ones(len(scan), np.float64)
    seen = csr_array((ones, (scan, what)), shape=(n_scans, transmitters))
    sizes = np.asarray(seen.sum(axis=1)).astype(np.intp)
    shared = (seen @ seen.T).tocoo()
    other = shared.row != shared.col
    row, column, both = shared.row[other], shared.col[other], shared.data[other]
    likeness = np.zeros(n_scans)
    np.maximum.at(likeness, row, both / (sizes[row] + sizes[column] - both))
    return _Looks(sizes, likeness)
