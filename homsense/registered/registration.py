"""Match with the map: the rotation, scale and shift that lay a crowd over the ground."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.free_space import FreeSpace
from homsense.registered.ground import WORST_M, Ground
from homsense.registered.matching import Fit, Matcher, Placement, probabilities

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DOUBTFUL_M, MIRRORED_M, STRAINED = 0.4, 0.3, 0.6
SCALES = tuple(float(scale) for scale in np.geomspace(0.8, 1.8, 9))
ROTATION_STEP = math.radians(6.0)
COARSE_M, COARSE_CELLS = 2.0, 200
LIKELY_ROTATIONS = 6.0
SIMILAR_M, SIMILAR = 6.0, 8
DISTINCT_M, DISTINCT = 15.0, 4
COMPASS_RAD = 0.07
_FINER = ((math.radians(3.0), 0.05), (math.radians(1.5), 0.025))
_STRETCHED = math.prod(1.0 + stretch for _, stretch in _FINER)


@dataclass(frozen=True)
class Registration:
    """How a crowd lies on a map.

    Parameters
    ----------
    placements : tuple of Placement
        Distinct ones, the best first; their costs are those after the crowd has settled there.
    mirror_margin_m : float
        How much worse the mirror image of the crowd fits, metres: a control that needs no truth.
    strain : float, default 0.0
        How bent the crowd lies: what its steps, its likeness and the ground leave of one another,
        squares of deviations a scan. Where it lies right they seldom quarrel.
    """

    placements: tuple[Placement, ...]
    mirror_margin_m: float
    strain: float = 0.0

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
    def probabilities(self) -> FloatArray:
        """Of the placements, shape (P,), as if one of them were true."""
        return probabilities([placement.cost_m for placement in self.placements])

    @property
    def n_plausible(self) -> int:
        """How many placements are nearly as good as the best, itself included."""
        most = self.cost_m + DOUBTFUL_M
        return sum(placement.cost_m < most for placement in self.placements)

    @property
    def is_doubtful(self) -> bool:
        """Whether another placement is nearly as good, or the mirror image is, or it is bent."""
        return self.n_plausible > 1 or self.mirror_margin_m < MIRRORED_M or self.strain > STRAINED


class PlacedParts(NamedTuple):
    """How the parts of a layout lie on the map.

    Parameters
    ----------
    placement : Placement
        Of the first one, and of the others once they have been moved.
    offset : ndarray, shape (P, 2), float64
        What to move each part by before, in the frame of the layout, metres; the first one is 0.
    """

    placement: Placement
    offset: FloatArray


class Search(NamedTuple):
    """What a search of placements has found.

    Parameters
    ----------
    placed : list of PlacedParts
        The most promising ones.
    mirrored_m : float
        Cost of the best placement of the mirror image, metres.
    """

    placed: list[PlacedParts]
    mirrored_m: float

    @property
    def best_m(self) -> float:
        """Cost of the best one, metres."""
        return min(placement.cost_m for placement, _ in self.placed)


def register(
    xy: FloatArray,
    part: IntArray,
    free_space: FreeSpace,
    rotation_sd_rad: float | None = None,
) -> Search:
    """Search the placements of a layout, and of its mirror image.

    Parameters
    ----------
    xy : ndarray, shape (N, 2), float64
        Layout of the crowd, metres.
    part : ndarray, shape (N,), int64
        Part that each scan belongs to, 0 for the largest. Parts share rotation and scale; where
        they lie to one another is not known.
    free_space : FreeSpace
        Of the map.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the map, radians; unknown when absent.

    Returns
    -------
    Search
        Full turn unless most of it is unlikely, free scale, all shifts.
    """
    parts = [xy[part == number] for number in range(int(part.max()) + 1)]
    middles = np.array([points.mean(axis=0) for points in parts])
    shapes = [points - middle for points, middle in zip(parts, middles, strict=True)]
    cell_m = max(COARSE_M, max(free_space.grid.shape) * free_space.grid.cell_m / COARSE_CELLS)
    coarse = Ground.of(free_space, cell_m)
    steps = round(math.pi / ROTATION_STEP)
    if rotation_sd_rad is not None:
        steps = min(steps, math.ceil(LIKELY_ROTATIONS * rotation_sd_rad / ROTATION_STEP))
    tried: list[Fit] = []
    mirrored: list[Fit] = []
    for scale in SCALES:
        matcher, mirror = (
            Matcher(ground, shapes, rotation_sd_rad, scale)
            for ground in (coarse, coarse.mirrored())
        )
        for turn in range(-steps, steps + 1):
            turned = matcher.turned(turn * ROTATION_STEP, scale)
            tried.append(matcher.best(turned))
            mirrored.append(mirror.best(turned))
    ordered = sorted(tried, key=_cost_m)
    places = [np.concatenate(fit.place(shapes)) for fit in ordered]
    chosen = {*apart(places, SIMILAR_M, SIMILAR), *apart(places, DISTINCT_M, DISTINCT)}
    fine = Ground.of(free_space)

    def finer(start: Fit, ground: Ground) -> Fit:
        return _finer(Matcher(ground, shapes, rotation_sd_rad, start.scale * _STRETCHED), start)

    return Search(
        [_moved(finer(ordered[number], fine), middles) for number in sorted(chosen)],
        finer(min(mirrored, key=_cost_m), fine.mirrored()).cost_m,
    )


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


def _finer(matcher: Matcher, start: Fit) -> Fit:
    best = start
    for turn, stretch in _FINER:
        beside = matcher.beside(best)
        around = [
            matcher.best(matcher.turned(best.rotation_rad + i * turn, best.scale * by), beside)
            for i in (-1, 0, 1)
            for by in (1.0 - stretch, 1.0, 1.0 + stretch)
        ]
        best = min(around, key=_cost_m)
    return best


def _cost_m(fit: Fit) -> float:
    return fit.cost_m


def _moved(fit: Fit, middles: FloatArray) -> PlacedParts:
    """Return the placement of parts that have been moved to their middles before."""
    turned = Placement(fit.rotation_rad, fit.scale, 0.0, 0.0, fit.cost_m)
    east, north = (fit.at[0] - turned.place(middles[:1])[0]).tolist()
    back = Placement(-fit.rotation_rad, 1.0 / fit.scale, 0.0, 0.0, 0.0)
    offset = back.place(fit.at - (east, north)) - middles
    return PlacedParts(turned._replace(east_m=east, north_m=north), offset)


def _rms(apart: FloatArray) -> float:
    return float(np.sqrt((apart * apart).sum(axis=1).mean()))
