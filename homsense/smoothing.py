"""Walks smoothed within the walls of the map: polish of a registered crowd, and its growth.

A filter runs over the scans of a walk, weighed by what other walks have heard; then tracks are
drawn backwards from what it knew at each scan [1]_. At first a scan is weighed by what it
resembles; once the crowd lies better, by the radio map that it has made.

.. [1] Godsill, Doucet and West, "Monte Carlo Smoothing for Nonlinear Time Series", Journal of the
   American Statistical Association 99, 2004.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.adaptive import KldSampling
from homsense.backend import Backend
from homsense.configuration import LocalizerConfig
from homsense.free_space import FreeSpace
from homsense.localizer import Localizer
from homsense.particles import Particles
from homsense.pose import MAX_DELTA, Delta
from homsense.prior import GaussianPrior, HeadingPrior, Prior, UniformPrior
from homsense.registered.complex import RegisteredComplex
from homsense.registered.crowd import Crowd, WalkScan
from homsense.registered.layout import HEADING_RAD, STEP_FLOOR_M, STEP_SHARE
from homsense.registered.place import PlaceLikelihood
from homsense.registered.radio_likelihood import RadioMapLikelihood
from homsense.registered.retracing import turned
from homsense.scalar import LN_2, TURN
from homsense.site_map import SiteMap
from homsense.weights import UNITS_PER_BIT

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PARTICLES, NEWCOMER_PARTICLES, TRACKS = 1000, 4000, 50
START_SHARE, KNOWN_SHARE = 0.25, 0.5
QUARTERS = 4
TURN_RAD = 0.02
"""Deviation of a heading after one metre; it grows with the square root of the way."""


class _Move(NamedTuple):
    right_m: float
    up_m: float
    std_m: float
    std_rad: float

    @property
    def delta(self) -> Delta:
        return Delta(self.right_m, self.up_m, 0.0, std=(self.std_m, self.std_m, self.std_rad))


def smooth(
    found: RegisteredComplex,
    scans: Sequence[WalkScan],
    site_map: SiteMap,
    free_space: FreeSpace,
    seed: int = 0,
    backend: Backend | None = None,
) -> RegisteredComplex:
    """Move the scans of each walk to where motion, walls and the other walks want them.

    Parameters
    ----------
    found : RegisteredComplex
        The crowd.
    scans : sequence of WalkScan
        What the complex was made of.
    site_map : SiteMap
        The map.
    free_space : FreeSpace
        Where devices are looked for.
    seed : int, default 0
        Of the particles.
    backend : Backend, optional
        What runs the filter; the fastest by default. Results do not depend on it.

    Returns
    -------
    RegisteredComplex
        The same scans at the means of the tracks drawn, under each placement.
    """
    xy, *rivals = (
        _by_radio_map(
            _by_resemblance(one, scans, site_map, free_space, seed, backend),
            scans,
            site_map,
            free_space,
            seed,
            backend,
        ).xy
        for one in found.placed
    )
    return replace(found, xy=xy, rivals=tuple(rivals))


def _by_resemblance(
    found: RegisteredComplex,
    scans: Sequence[WalkScan],
    site_map: SiteMap,
    free_space: FreeSpace,
    seed: int,
    backend: Backend | None,
) -> RegisteredComplex:
    """Move each walk to where it resembles all others."""
    place = PlaceLikelihood(found.thinned(), free_space, backend)
    rng = np.random.Generator(np.random.Philox(seed))
    xy = found.xy.copy()
    for walk in np.unique(found.walk).tolist():
        which = np.flatnonzero(found.walk == walk)
        xy[which] = _moved(found, which, scans, place.without(walk), site_map, rng)
    return replace(found, xy=xy)


def _by_radio_map(
    found: RegisteredComplex,
    scans: Sequence[WalkScan],
    site_map: SiteMap,
    free_space: FreeSpace,
    seed: int,
    backend: Backend | None,
) -> RegisteredComplex:
    """Move a quarter of the walks after the other to where the radio map of the rest wants it."""
    rng = np.random.Generator(np.random.Philox(seed))
    xy, share = found.xy.copy(), None
    for quarter in range(QUARTERS):
        is_moved = found.walk % QUARTERS == quarter
        others = found.of(~is_moved)
        if not others.size:
            continue
        place = RadioMapLikelihood(others.thinned(), free_space, backend, share)
        share = place.share
        for walk in np.unique(found.walk[is_moved]).tolist():
            which = np.flatnonzero(found.walk == walk)
            xy[which] = _moved(found, which, scans, place, site_map, rng)
    return replace(found, xy=xy)


def _moved(
    found: RegisteredComplex,
    which: IntArray,
    scans: Sequence[WalkScan],
    place: PlaceLikelihood,
    site_map: SiteMap,
    rng: np.random.Generator,
) -> FloatArray:
    """Return where the scans of a walk were made, by motion, walls and the others, metres."""
    made = [scans[number] for number in found.source[which].tolist()]
    own_xy, xy = np.array([(scan.x_m, scan.y_m) for scan in made]), found.xy[which]
    middles = place.code_map.expected[1:]
    x_m, y_m = middles[np.square(middles - xy[0]).sum(axis=1).argmin()].tolist()
    heading = HeadingPrior(turned(own_xy, xy), HEADING_RAD)
    start = GaussianPrior(x_m, y_m, START_SHARE * found.reach_m, heading)
    localizer = _localizer(place, site_map, start)
    return np.asarray(_tracks(localizer, place.complex, made, rng).mean(axis=1))


def extend(
    found: RegisteredComplex,
    scans: Sequence[WalkScan],
    site_map: SiteMap,
    free_space: FreeSpace,
    seed: int = 0,
    backend: Backend | None = None,
) -> RegisteredComplex:
    """Let walks that a registered crowd does not have join it, each on its own.

    Parameters
    ----------
    found : RegisteredComplex
        The crowd.
    scans : sequence of WalkScan
        What the complex was made of and the scans of other walks; where each of those that it
        has stands is kept.
    site_map : SiteMap
        The map.
    free_space : FreeSpace
        Where devices are looked for.
    seed : int, default 0
        Of the particles.
    backend : Backend, optional
        What runs the filter; the fastest by default. Results do not depend on it.

    Returns
    -------
    RegisteredComplex
        The scans that it had where they are, and those others whose places the tracks agree on;
        under the best placement alone.
    """
    best, *_ = found.placed
    place = PlaceLikelihood(best.thinned(), free_space, backend)
    others = np.setdiff1d(np.arange(len(scans)), found.source)
    rng = np.random.Generator(np.random.Philox(seed))
    crowd = Crowd.of([scans[number] for number in others.tolist()], found.hearing)
    source = others[crowd.source]
    rotation = found.registration.placements[0].rotation_rad
    start = UniformPrior(HeadingPrior(rotation, HEADING_RAD))
    localizer = _localizer(place, site_map, start, KldSampling(PARTICLES, NEWCOMER_PARTICLES))
    xy, known = np.empty((crowd.size, 2)), np.zeros(crowd.size, np.bool_)
    for walk in range(crowd.n_walks):
        which = np.flatnonzero(crowd.walk == walk)
        made = [scans[number] for number in source[which].tolist()]
        tracks = _tracks(localizer, place.complex, made, rng)
        xy[which] = tracks.mean(axis=1)
        spread = np.sqrt(tracks.var(axis=1).sum(axis=1))
        known[which] = spread <= KNOWN_SHARE * found.reach_m
    return replace(
        best,
        walk=np.concatenate([found.walk, found.walk[-1] + 1 + crowd.walk[known]]),
        xy=np.concatenate([found.xy, xy[known]]),
        signatures=(*found.signatures, *(crowd.signatures[i] for i in np.flatnonzero(known))),
        source=np.concatenate([found.source, source[known]]),
    )


def _localizer(
    place: PlaceLikelihood, site_map: SiteMap, start: Prior, adaptive: KldSampling | None = None
) -> Localizer:
    config = LocalizerConfig(
        particles=adaptive.most if adaptive else PARTICLES,
        prior=start,
        recovery=None,
        adaptive=adaptive,
        weigh_every_m=0.0,
    )
    return Localizer(
        site_map,
        [],
        config,
        free_space=place.code_map.free_space,
        likelihood=place,
        backend=place.backend,
    )


def _tracks(
    localizer: Localizer,
    found: RegisteredComplex,
    scans: Sequence[WalkScan],
    rng: np.random.Generator,
) -> FloatArray:
    """Draw where a walk has been, shape (T, TRACKS, 2), metres."""
    own_xy = np.array([(scan.x_m, scan.y_m) for scan in scans])
    moves = list(_moves(own_xy))
    known = list(_filtered(localizer, scans, moves, found, int(rng.integers(2**63))))
    return _drawn_back(known, moves, rng)


def _moves(own_xy: FloatArray) -> Iterator[_Move]:
    """Yield what a device has measured between its scans."""
    for right, up in np.clip(np.diff(own_xy, axis=0), -MAX_DELTA, MAX_DELTA).tolist():
        length = math.hypot(right, up)
        yield _Move(
            right, up, STEP_FLOOR_M + STEP_SHARE * length, TURN_RAD * math.sqrt(max(length, 0.1))
        )


def _filtered(
    localizer: Localizer,
    scans: Sequence[WalkScan],
    moves: Sequence[_Move],
    found: RegisteredComplex,
    seed: int,
) -> Iterator[Particles]:
    """Yield what is known at each scan from those up to it."""
    state = localizer.start(seed)
    for scan, delta in zip(scans, (Delta(), *(move.delta for move in moves)), strict=True):
        state, _ = localizer.step(state, delta, found.sighting(scan.readings))
        yield state.particles


def _drawn_back(
    known: Sequence[Particles], moves: Sequence[_Move], rng: np.random.Generator
) -> FloatArray:
    """Draw tracks from what is known from all scans, shape (T, TRACKS, 2), metres."""
    last = known[-1]
    chosen = _placed(last)[_draw(np.tile(_nats(last), (TRACKS, 1)), rng)]
    tracks = [chosen[:, :2]]
    for before, move in zip(known[-2::-1], reversed(moves), strict=True):
        here = _placed(before)
        cos, sin = here[:, 2], here[:, 3]
        led_to = here.copy()
        led_to[:, 0] += cos * move.right_m - sin * move.up_m
        led_to[:, 1] += sin * move.right_m + cos * move.up_m
        middle = chosen.mean(axis=0)
        sure = 1.0 / np.array([move.std_m, move.std_m, move.std_rad, move.std_rad])
        there, led_to = (chosen - middle) * sure, (led_to - middle) * sure
        nats = _nats(before) + there @ led_to.T - 0.5 * np.square(led_to).sum(axis=1)
        chosen = here[_draw(nats, rng)]
        tracks.append(chosen[:, :2])
    return np.stack(tracks[::-1])


def _placed(particles: Particles) -> FloatArray:
    """Return places and directions: x m, y m, cosine, sine."""
    turned = particles.turns.astype(np.float64) * TURN
    return np.stack([particles.x_m, particles.y_m, np.cos(turned), np.sin(turned)], axis=1)


def _nats(particles: Particles) -> FloatArray:
    return np.asarray(particles.log_weight * (LN_2 / UNITS_PER_BIT))


def _draw(nats: FloatArray, rng: np.random.Generator) -> IntArray:
    """Draw one of the columns for each row."""
    reached = np.exp(nats - nats.max(axis=1, keepdims=True)).cumsum(axis=1)
    short = reached < rng.random((len(nats), 1)) * reached[:, -1:]
    return np.asarray(np.minimum(short.sum(axis=1), nats.shape[1] - 1))
