"""What the sensor counts at each place, over all the sites that look like this one from its scans.

Transmitters are placed at random on the map, a random crowd builds their complex, and holes are
counted everywhere. Over many placements this gives the expected count of each place, its spread,
how the errors of neighborhoods go together, and the way after which an error is new. What a
placement has in common everywhere (more holes than others, or larger differences) is taken out
first, since a site's own scans tell it without any position.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from homsense.correlation import DIGITS, between_levels, correlation_m, independent
from homsense.engine import Engine
from homsense.errors import InvalidInputError
from homsense.free_space import FreeSpace
from homsense.height import HeightMap
from homsense.noise import FieldNoise, advantage_bits
from homsense.radio import RadioModel
from homsense.simulation import WORLDS, Stage, World, simulate

FloatArray = NDArray[np.float64]

HOPS = tuple(range(1, 9))
_LEAST_SPREAD = 0.6
_TRUTHS = 200
_LEAST_GAIN_BITS = 0.1


@dataclass(frozen=True)
class Expectation:
    """What is to be counted over a map, and how wrong it is.

    Parameters
    ----------
    hops : tuple of int
        The neighborhoods.
    heights : tuple of HeightMap
        Mean count of each neighborhood.
    spreads : tuple of HeightMap
        Its deviation, holes.
    usual : tuple of (float, float)
        Mean and deviation over the landmarks of the holes near each, by neighborhood.
    correlation : tuple of tuple of float
        Between the errors of two neighborhoods at a place.
    correlation_m : float
        Way after which an error is new, metres.
    freedom : int
        Degrees of freedom of the spreads.
    information_bits : tuple of float
        What one scan tells about the place when it is weighed with the first so many
        neighborhoods, mean over free space, bits.
    """

    hops: tuple[int, ...]
    heights: tuple[HeightMap, ...]
    spreads: tuple[HeightMap, ...]
    usual: tuple[tuple[float, float], ...]
    correlation: tuple[tuple[float, ...], ...]
    correlation_m: float
    freedom: int
    information_bits: tuple[float, ...]

    @classmethod
    def of(cls, stage: Stage, hops: Sequence[int], worlds: Sequence[World]) -> Self:
        """Return what some simulated worlds have in common.

        Parameters
        ----------
        stage : Stage
            Where was counted.
        hops : sequence of int
            The neighborhoods.
        worlds : sequence of World
            From `simulate`; at least three.

        Returns
        -------
        Expectation
            Of one more world like these.

        Raises
        ------
        InvalidInputError
            If there are too few worlds, or none in which anything is heard.
        """
        if len(worlds) < 3:  # noqa: PLR2004 - a spread and what is left of it
            message = f"an expectation needs at least three worlds, not {len(worlds)}"
            raise InvalidInputError(message, "worlds")
        if not all(len(world.profiles) for world in worlds):
            message = "nothing is heard anywhere"
            raise InvalidInputError(message, "worlds")
        usual = _usual(worlds)
        counts = np.array([_alike(world, usual) for world in worlds])
        heard = ~np.isnan(counts[..., 0])
        times = heard.sum(axis=0)[:, None]
        sums = np.where(heard[..., None], counts, 0.0).sum(axis=0)
        mean = np.where(times > 0, sums / np.maximum(times, 1), usual[0])
        off = np.where(heard[..., None], counts - mean, 0.0)
        variance = np.square(off).sum(axis=0) / np.maximum(times - 1, 1) * (1 + 1 / len(worlds))
        spread = np.sqrt(np.where(times > 1, variance, usual[1] ** 2) + _LEAST_SPREAD**2)
        errors = off / spread
        correlation = between_levels(np.einsum("pi,pj->ij", errors[heard], errors[heard]))
        found = cls(
            tuple(hops),
            tuple(stage.raster(mean[:, level]) for level in range(len(hops))),
            tuple(stage.raster(spread[:, level]) for level in range(len(hops))),
            tuple(map(tuple, usual.T.tolist())),
            tuple(map(tuple, correlation.tolist())),
            correlation_m(stage.places, independent(errors, correlation)),
            len(worlds) - 1,
            (),
        )
        information = [
            found._information(counts, heard, mean, spread, level + 1)
            for level in range(len(hops))
        ]
        return replace(found, information_bits=tuple(information))

    @property
    def best_hops(self) -> tuple[int, ...]:
        """The neighborhoods worth their cost: each adds a tenth of a bit."""
        best = 1
        for level in range(1, len(self.hops)):
            if self.information_bits[level] >= self.information_bits[best - 1] + _LEAST_GAIN_BITS:
                best = level + 1
        return self.hops[:best]

    def narrowed(self, hops: Sequence[int]) -> Self:
        """Return the same for some of the neighborhoods.

        Parameters
        ----------
        hops : sequence of int
            Among those of the expectation.

        Returns
        -------
        Expectation
            Of these alone.
        """
        at = [self.hops.index(radius) for radius in hops]
        is_first = at == list(range(len(at)))
        return replace(
            self,
            hops=tuple(hops),
            heights=tuple(self.heights[i] for i in at),
            spreads=tuple(self.spreads[i] for i in at),
            usual=tuple(self.usual[i] for i in at),
            correlation=tuple(tuple(self.correlation[i][j] for j in at) for i in at),
            information_bits=self.information_bits[: len(at)] if is_first else (),
        )

    def noise(self, profiles: FloatArray | None = None) -> FieldNoise:
        """Return the error of a sensor that counts as this one is expected to.

        Parameters
        ----------
        profiles : ndarray, shape (T, n_levels), optional
            Holes near each landmark of a site. They decide gain and offset of the measurement, so
            that they are distributed as expected; where the landmarks are is not needed.

        Returns
        -------
        FieldNoise
            For the heights followed by the spreads.
        """
        gains, offsets = [], []
        for level, (mean, spread) in enumerate(self.usual):
            gain, offset = 1.0, 0.0
            if profiles is not None:
                gain, offset = _likening(profiles[:, level], mean, spread)
            gains.append(gain)
            offsets.append(offset)
        return FieldNoise(
            self.correlation, tuple(gains), tuple(offsets), self.freedom, self.correlation_m
        )

    def _information(
        self,
        counts: FloatArray,
        heard: NDArray[np.bool_],
        mean: FloatArray,
        spread: FloatArray,
        levels: int,
    ) -> float:
        """Return what one scan tells when its own world is not among those that are known.

        Nothing where no scan hears anything.
        """
        noise = self.narrowed(self.hops[:levels]).noise()
        told: list[float] = []
        for world in range(0, len(counts), max(1, len(counts) // 4)):
            known = np.flatnonzero(heard[world])
            times = heard.sum(axis=0)[known, None]
            own = counts[world, known, :levels]
            others = (times * mean[known, :levels] - own) / np.maximum(times - 1, 1)
            fields = np.concatenate([others, spread[known, :levels]], axis=1)
            truths = range(0, len(known), max(1, len(known) // _TRUTHS))
            told += advantage_bits(noise.weigher(fields), own[truths], truths)
        return float(np.mean(told)) if told else 0.0


def expect(  # noqa: PLR0913 - all that a simulation takes
    free_space: FreeSpace,
    radio: RadioModel,
    hops: Sequence[int] = HOPS,
    *,
    worlds: int = WORLDS,
    walked: FloatArray | None = None,
    seed: int = 0,
    engine: Engine | None = None,
    on_world: Callable[[int], None] = lambda _number: None,
) -> Expectation:
    """Return what a site's sensor is expected to count.

    Parameters
    ----------
    free_space : FreeSpace
        Of the map.
    radio : RadioModel
        What the scans of the site say about its radio.
    hops : sequence of int, default 1 to 8
        Neighborhoods, rising; see `Expectation.best_hops`.
    worlds : int, default 24
        How many placements to simulate.
    walked : ndarray, shape (W, 2), float64, optional
        Where the crowd has been, metres: the places of its registered complex. Where nobody walks,
        holes stay open; a crowd that is not known is taken to have been everywhere alike.
    seed : int, default 0
        Decides them.
    engine : Engine, optional
        What runs the hot loops; the fastest by default.
    on_world : callable, optional
        Told how many are done, after each.

    Returns
    -------
    Expectation
        For every place of the map.
    """
    stage, tried = Stage.of(free_space), tuple(hops)
    found = []
    simulated = simulate(
        stage, radio, tried, worlds=worlds, walked=walked, seed=seed, engine=engine
    )
    for world in simulated:
        found.append(world)
        on_world(len(found))
    return Expectation.of(stage, tried, found)


def _usual(worlds: Sequence[World]) -> FloatArray:
    """Return mean and deviation over the landmarks, in the mean over the worlds, by level."""
    moments = [(w.profiles.mean(axis=0), w.profiles.std(axis=0)) for w in worlds]
    usual: FloatArray = np.array(moments).mean(axis=0)
    return usual


def _alike(world: World, usual: FloatArray) -> FloatArray:
    """Return what is counted in a world as if its landmarks had the usual moments."""
    levels = [
        _likening(profiles, mean, spread)
        for profiles, mean, spread in zip(world.profiles.T, *usual, strict=True)
    ]
    gains, offsets = np.array(levels).T
    return np.asarray(offsets + gains * world.holes)


def _likening(values: FloatArray, mean: float, spread: float) -> tuple[float, float]:
    """Return gain and offset that give some values this mean and deviation."""
    if not len(values):
        return 1.0, 0.0
    own = float(values.std())
    gain = round(spread / own, DIGITS) if own > 0.0 and spread > 0.0 else 1.0
    return gain, round(mean - gain * float(values.mean()), DIGITS)
