"""How a site hears its transmitters, learnt from scans whose places nobody knows.

Random placements on the map are heard by a random crowd, or by one that walks where the site's was
found to walk (`homsense.registered`). The range, the dropout and the evenness whose scans are most
like the site's own, in the mean over a few placements, are taken for the site's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

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
_PLACEMENTS = 4
_BLOCK = 512


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


def crowd_places(
    free_space: FreeSpace, rng: Rng, count: int, walked: FloatArray | None = None
) -> FloatArray:
    """Draw places for the scans of a crowd.

    Parameters
    ----------
    free_space : FreeSpace
        Where.
    rng : numpy.random.Generator
        Decides.
    count : int
        How many.
    walked : ndarray, shape (W, 2), float64, optional
        Where a crowd has been, metres; those in free space are drawn, all equally often. It can
        have been anywhere when absent.

    Returns
    -------
    ndarray, shape (count, 2), float64
        Metres.
    """
    known = np.empty((0, 2)) if walked is None else walked[free_space.contains(walked)]
    if not len(known):
        return free_places(free_space, rng, count)
    drawn: FloatArray = known[np.resize(rng.permutation(len(known)), count)]
    return drawn


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
    chosen = np.empty((count, 2))
    for first in range(0, count, _BLOCK):
        block = tried[first : first + _BLOCK]
        gaps = np.full(block.shape[:2], np.inf)
        if first:
            _, nearest = cKDTree(chosen[:first]).query(block)
            gaps = np.square(block - chosen[nearest]).sum(axis=2)
        for number in range(len(block)):
            best = block[number, gaps[number].argmax()]
            chosen[first + number] = best
            apart = np.square(block[number + 1 :] - best).sum(axis=2)
            np.minimum(gaps[number + 1 :], apart, out=gaps[number + 1 :])
    return chosen


def estimate_radio(
    free_space: FreeSpace,
    observations: Sequence[frozenset[str]],
    *,
    transmitters: int | None = None,
    scans: int | None = None,
    walked: FloatArray | None = None,
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
    walked : ndarray, shape (W, 2), float64, optional
        Where the observations were made, metres: the places of a registered complex.
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
    site = _Heard(free_space, count, _looks(scan, what, len(names)), walked)
    tried = [[_fits(site, rng, even) for _ in range(_PLACEMENTS)] for even in EVENNESS]
    misfit, range_m = np.moveaxis(np.mean(tried, axis=1), -1, 0)
    best = evenness, dropout = np.unravel_index(misfit.argmin(), misfit.shape)
    return RadioModel(
        count,
        max(1, round(range_m[best] / _RANGE_STEP_M)) * _RANGE_STEP_M,
        DROPOUTS[dropout],
        EVENNESS[evenness],
        min(MOST_CROWD, scans or len(heard)),
    )


@dataclass(frozen=True, slots=True)
class _Looks:
    """What scans look like: how large each is, and how much the most similar other one shares."""

    sizes: IntArray
    likeness: FloatArray


@dataclass(frozen=True, slots=True)
class _Heard:
    """What is known of a site before its radio is."""

    free_space: FreeSpace
    transmitters: int
    looks: _Looks
    walked: FloatArray | None


def _fits(site: _Heard, rng: Rng, evenness: int) -> list[tuple[float, float]]:
    """Place transmitters once; return misfit and range under each dropout."""
    free_space, observed, grid = site.free_space, site.looks, site.free_space.grid
    where = placement(free_space, rng, site.transmitters, evenness)
    places = crowd_places(free_space, rng, len(observed.sizes), site.walked)
    farthest = float(np.hypot(grid.columns, grid.rows) * grid.cell_m)
    wanted = float(observed.sizes.mean())
    reach = farthest / 8.0
    while True:
        seen = in_view(free_space, where, places, reach)
        chance = rng.random(len(seen.place))
        is_enough = _range_for(seen.kept(chance >= DROPOUTS[-1]), wanted) is not None
        if is_enough or reach >= farthest:
            break
        reach = min(2.0 * reach, farthest)
    found = []
    for dropout in DROPOUTS:
        kept = seen.kept(chance >= dropout)
        range_m = _range_for(kept, wanted) or farthest
        found.append((_misfit(kept.kept(kept.distance_m <= range_m), site), range_m))
    return found


def _misfit(heard: Sightings, site: _Heard) -> float:
    observed, simulated = site.looks, _looks(heard.place, heard.transmitter, site.transmitters)
    if not len(simulated.sizes):
        return math.inf
    apart = earth_mover_distance(simulated.sizes, observed.sizes) / float(observed.sizes.mean())
    return float(apart + earth_mover_distance(simulated.likeness, observed.likeness))


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
