"""From the scans of a crowd to a complex on the map: laid out, placed, settled."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.registered.complex import RegisteredComplex
from homsense.registered.crowd import NEIGHBORS, Crowd, Likeness, WalkScan, likeness
from homsense.registered.ground import Ground
from homsense.registered.layout import Layout, Pull, lay_out, parts, settle
from homsense.registered.matching import Placement, unlikely_m
from homsense.registered.registration import (
    DISTINCT_M,
    DOUBTFUL_M,
    SCALES,
    Registration,
    Search,
    apart,
    register,
)
from homsense.registered.similarity import Hearing

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

GROUND_SD_M = 3.0
PLAUSIBLE_M, ALIKE_M = 1.0, 3.0
ALL_ROUNDS, LIKELY_ROUNDS = 8, 16
FITTING_SHARE = 0.5
TOO_LARGE = "the walks reach much farther than the map; are their places in metres?"
MOST_LAID_OUT = 10_000
"""Scans at once; `homsense.extend` lets the others join."""

STAGES = ("heard", "compared", "laid out", "registered", "settled")


class _Settled(NamedTuple):
    """A placement, where the scans lie under it, and how bent the crowd is."""

    placement: Placement
    xy: FloatArray
    strain: float


@dataclass(frozen=True)
class LaidOutCrowd:
    """A crowd in a frame of its own, ready to be placed on any map.

    Parameters
    ----------
    hearing : Hearing
        What of a scan counts.
    crowd : Crowd
        The scans.
    like : Likeness
        Which of them are alike.
    layout : Layout
        Where they were made, in that frame.
    """

    hearing: Hearing
    crowd: Crowd
    like: Likeness
    layout: Layout

    @classmethod
    def of(
        cls,
        scans: Iterable[WalkScan],
        hearing: Hearing | None = None,
        neighbors: int = NEIGHBORS,
        on_stage: Callable[[str], None] = lambda _stage: None,
    ) -> Self:
        """Lay a crowd out, or of a large one some of its walks.

        Parameters
        ----------
        scans : iterable of WalkScan
            The crowd.
        hearing : Hearing, optional
            What of a scan counts.
        neighbors : int, default 4
            Most similar scans that each scan is joined with.
        on_stage : callable, optional
            Told each of `STAGES` when it is reached.

        Returns
        -------
        LaidOutCrowd
            Without any map.

        Raises
        ------
        InvalidInputError
            If the crowd is too small to be laid out.
        """
        rule = hearing or Hearing()
        crowd = Crowd.of(scans, rule).few(MOST_LAID_OUT)
        on_stage("heard")
        like = likeness(crowd, neighbors)
        on_stage("compared")
        if not len(like.first):
            message = "no two walks have heard alike"
            raise InvalidInputError(message, "scans")
        layout = lay_out(crowd, like)
        on_stage("laid out")
        return cls(rule, crowd, like, layout)

    def on(
        self,
        free_space: FreeSpace,
        rotation_sd_rad: float | None = None,
        on_stage: Callable[[str], None] = lambda _stage: None,
    ) -> RegisteredComplex:
        """Place the crowd on a map, without any label.

        Parameters
        ----------
        free_space : FreeSpace
            Of the map.
        rotation_sd_rad : float, optional
            How far the headings of the crowd are from those of the map, radians; unknown when
            absent.
        on_stage : callable, optional
            Told each of `STAGES` when it is reached.

        Returns
        -------
        RegisteredComplex
            Of the parts that can be placed, under the best placement and those nearly as good.

        Raises
        ------
        InvalidInputError
            If most of the crowd is too far apart for the map.
        """
        if not self.fits(free_space):
            raise InvalidInputError(TOO_LARGE, "scans")
        kept = (self._part >= 0) & self._within(free_space)
        shape, part = self.layout.xy[kept], np.unique(self._part[kept], return_inverse=True)[1]
        found = register(shape, part, free_space, rotation_sd_rad)
        on_stage("registered")
        settled = self._settled(found, kept, Ground.of(free_space), rotation_sd_rad)
        distinct = apart((one.xy for one in settled), DISTINCT_M, len(settled))
        registration = Registration(
            tuple(settled[number].placement for number in distinct),
            found.mirrored_m - found.best_m,
            settled[0].strain,
        )
        on_stage("settled")
        return RegisteredComplex(
            self.hearing,
            self.crowd.walk[kept],
            settled[0].xy,
            tuple(self.crowd.signatures[scan] for scan in np.flatnonzero(kept).tolist()),
            self.like.radio.reach_m,
            registration,
            self.crowd.source[kept],
            tuple(settled[number].xy for number in distinct[1 : registration.n_plausible]),
        )

    @cached_property
    def _part(self) -> IntArray:
        return parts(self.crowd, self.like)

    def fits(self, free_space: FreeSpace) -> bool:
        """Tell whether more than half of the largest part can be on a map.

        Parameters
        ----------
        free_space : FreeSpace
            Of the map.

        Returns
        -------
        bool
            If not, the places are hardly in metres.
        """
        return bool(self._within(free_space)[self._part == 0].mean() > FITTING_SHARE)

    def _within(self, free_space: FreeSpace) -> BoolArray:
        """Tell which scans can be on a map together with the middle of their part."""
        grid = free_space.grid
        return self._far_m * SCALES[0] <= grid.cell_m * math.hypot(*grid.shape)

    @cached_property
    def _far_m(self) -> FloatArray:
        """How far each scan is from the middle of its part."""
        far = np.empty(self.crowd.size)
        for number in np.unique(self._part):
            xy = self.layout.xy[self._part == number]
            far[self._part == number] = np.linalg.norm(xy - np.median(xy, axis=0), axis=1)
        return far

    def _settled(
        self,
        found: Search,
        kept: BoolArray,
        ground: Ground,
        rotation_sd_rad: float | None,
    ) -> list[_Settled]:
        """Return plausible placements and where the scans that are kept settle, the best first.

        All settle for some rounds, and then those that may be the best, or its rivals, to the end.
        """
        most_m = found.best_m + PLAUSIBLE_M
        plausible = [one for one in found.placed if one.placement.cost_m <= most_m]
        rounds = [self._settling(*one, ground) for one in plausible]
        lying: dict[int, Layout] = {}

        def onward(number: int, count: int) -> _Settled:
            for layout in itertools.islice(rounds[number], count):
                lying[number] = layout
            placement, layout = plausible[number].placement, lying[number]
            xy = layout.xy[kept]
            unlikely = unlikely_m(placement.rotation_rad, placement.scale, rotation_sd_rad)
            cost_m = ground.mismatch_m(xy) + unlikely
            strain = float(layout.strain[kept].mean())
            return _Settled(placement._replace(cost_m=cost_m), xy, strain)

        settled = [onward(number, ALL_ROUNDS) for number in range(len(plausible))]
        costs_m = np.array([one.placement.cost_m for one in settled])
        likely = np.argsort(costs_m)[: (costs_m < costs_m.min() + DOUBTFUL_M).sum()].tolist()
        for place in apart((settled[number].xy for number in likely), ALIKE_M, len(likely)):
            settled[likely[place]] = onward(likely[place], LIKELY_ROUNDS)
        return sorted(settled, key=lambda one: one.placement.cost_m)

    def _settling(
        self, placement: Placement, offset: FloatArray, ground: Ground
    ) -> Iterator[Layout]:
        turned = self.layout.heading + placement.rotation_rad
        moved = self.layout.xy + offset[self._part]
        placed = Layout(placement.place(moved), turned, self.layout.log_step)
        return settle(
            self.crowd, self.like, placed, lambda xy: Pull(ground.nearest(xy), GROUND_SD_M)
        )


def register_crowd(
    scans: Iterable[WalkScan],
    free_space: FreeSpace,
    *,
    hearing: Hearing | None = None,
    neighbors: int = NEIGHBORS,
    rotation_sd_rad: float | None = None,
    on_stage: Callable[[str], None] = lambda _stage: None,
) -> RegisteredComplex:
    """Lay a crowd out, of a large one some walks, and place it on a map without any label.

    Parameters
    ----------
    scans : iterable of WalkScan
        The crowd.
    free_space : FreeSpace
        Of the map.
    hearing : Hearing, optional
        What of a scan counts.
    neighbors : int, default 4
        Most similar scans that each scan is joined with.
    rotation_sd_rad : float, optional
        How far the headings of the crowd are from those of the map, radians; unknown when absent.
    on_stage : callable, optional
        Told each of `STAGES` when it is reached.

    Returns
    -------
    RegisteredComplex
        Of the parts that can be placed, of no more than `MOST_LAID_OUT` scans or so, under the
        best placement and those nearly as good.

    Raises
    ------
    InvalidInputError
        If the crowd is too small to be laid out, or too large for the map.
    """
    laid_out = LaidOutCrowd.of(scans, hearing, neighbors, on_stage)
    return laid_out.on(free_space, rotation_sd_rad, on_stage)
