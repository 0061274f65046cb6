"""Algorithm 1, runTopologicalMCL, as a chain of stages over values.

propagate -> reweigh -> relocate and resample on a policy -> estimate. A session is a pure
function of the map, the parameters, a seed and its inputs, to the last bit: see
`homsense.exact`, `homsense.philox` and `homsense.weights`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.backend import Backend, fastest
from homsense.code_map import NOWHERE, CodeMap
from homsense.configuration import LocalizerConfig
from homsense.errors import InvalidConfigurationError, InvalidInputError
from homsense.estimate import PoseDistribution
from homsense.free_space import FreeSpace
from homsense.height import HeightMap
from homsense.likelihood import CodeLikelihood, Likelihood
from homsense.motion import measured_move
from homsense.particles import NOBODY, Particles, joined
from homsense.philox import Purpose
from homsense.policy import ess_below
from homsense.pose import Delta
from homsense.recovery import Doubt, Relocation
from homsense.resample import SCHEMES, scaled
from homsense.resetting import CellMasses
from homsense.site_map import SiteMap
from homsense.stages import Reweighed, chosen
from homsense.travel import Travel
from homsense.weights import BLOCKED, UNITS_PER_BIT, Weights, WeightSums, bits, units

FloatArray = NDArray[np.float64]

_STREAMS = len(Purpose)
_WATCHING = Relocation()


@dataclass(frozen=True, slots=True)
class LocalizerState:
    """Everything a session has to remember.

    Parameters
    ----------
    seed : int
        Key of the session's random numbers, in [0, 2**64).
    tick : int
        Steps taken.
    particles : Particles
        Pose hypotheses; the best log-weight is 0.
    travel : Travel
        Way since the last weighing.
    doubt : Doubt
        What the measurements say about the particles as a whole.
    """

    seed: int
    tick: int
    particles: Particles
    travel: Travel
    doubt: Doubt

    @property
    def poses(self) -> NDArray[np.float64]:
        """Particles, shape (N, 3): x m, y m, heading rad."""
        return self.particles.poses

    def digest(self) -> str:
        """Return a hash of the particles, equal for equal inputs on every machine.

        Returns
        -------
        str
            16 hexadecimal digits.
        """
        return self.particles.digest()


class _Fresh(NamedTuple):
    """Particles to draw anew: from where, and which share of all."""

    masses: CellMasses
    share: float


class Localizer:
    """Monte Carlo localization with a homological sensor on one map.

    Parameters
    ----------
    site_map : SiteMap
        The unlabeled map.
    heights : sequence of HeightMap
        Expected counts, one for each neighborhood (near, far).
    config : LocalizerConfig, optional
        Parameters.
    free_space : FreeSpace, optional
        Free cells of this map, when they are known already.
    likelihood : Likelihood, optional
        The sensor model, in place of counts that are compared with height maps.
    backend : Backend, optional
        What runs the stages; the fastest by default. Results do not depend on it.

    Examples
    --------
    >>> ring = [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]
    >>> square = {"type": "Polygon", "coordinates": [ring], "frame": "local"}
    >>> site_map = SiteMap.from_geojson(square)
    >>> height = HeightMap.geometric(site_map, r_geo_m=25.0)
    >>> localizer = Localizer(site_map, [height], LocalizerConfig(particles=500))
    >>> state = localizer.start(seed=7)
    >>> state, pose = localizer.step(state, Delta(forward_m=2.0), [1])
    >>> state.tick, 1.0 <= pose.ess <= 500.0
    (1, True)
    """

    def __init__(
        self,
        site_map: SiteMap,
        heights: Sequence[HeightMap],
        config: LocalizerConfig | None = None,
        *,
        free_space: FreeSpace | None = None,
        likelihood: Likelihood | None = None,
        backend: Backend | None = None,
    ) -> None:
        self.site_map = site_map
        self.heights = tuple(heights)
        self.config = config or LocalizerConfig()
        self.free_space = free_space or FreeSpace.of(site_map, self.config.cell_m)
        self.backend = backend or fastest()
        self.likelihood = (likelihood or self._counting()).run_by(self.backend)
        self.code_map = self.likelihood.code_map
        self._is_due = self.config.policy or ess_below(self.config.resample_below)

    def _counting(self) -> Likelihood:
        if not self.heights:
            message = "there must be a height map for at least one neighborhood"
            raise InvalidConfigurationError(message, "heights")
        code_map = CodeMap.of(self.free_space, self.heights)
        return CodeLikelihood(code_map, self.config.noise)

    def run_by(self, backend: Backend) -> "Localizer":
        """Return the same localizer on another backend.

        Parameters
        ----------
        backend : Backend
            What runs the stages.

        Returns
        -------
        Localizer
            It continues any state of this one with the same bits.
        """
        if backend is self.backend:
            return self
        return Localizer(
            self.site_map,
            self.heights,
            self.config,
            free_space=self.free_space,
            likelihood=self.likelihood,
            backend=backend,
        )

    def start(self, seed: int) -> LocalizerState:
        """Draw the particles of a new session from the prior.

        Parameters
        ----------
        seed : int
            In [0, 2**64).

        Returns
        -------
        LocalizerState
            Tick 0.

        Raises
        ------
        InvalidInputError
            If the seed is out of range.
        """
        if not 0 <= seed < 2**64:
            message = f"seed must be in [0, 2**64), not {seed}"
            raise InvalidInputError(message, "seed")
        count = self.config.particles

        def random(block: int) -> NDArray[np.uint32]:
            return self.backend.random_words(seed, 0, Purpose.PRIOR + _STREAMS * block, count)

        drawn = self.config.prior.draw(self.free_space, random)
        return LocalizerState(
            seed, 0, Particles(*drawn, np.zeros(count, np.int32)), Travel(), Doubt()
        )

    def step(
        self,
        state: LocalizerState,
        delta: Delta | Sequence[float],
        measurement: object | None = None,
    ) -> tuple[LocalizerState, PoseDistribution]:
        """Move and, when there is a measurement, weigh and resample (Algorithm 1, lines 6 to 13).

        Parameters
        ----------
        state : LocalizerState
            From `start` or the step before; it stays valid.
        delta : Delta or sequence of float
            Measured body-frame motion: forward m, left m, turn rad.
        measurement : sequence of float, optional
            Holes sensed in each neighborhood, or whatever the likelihood takes; none when nothing
            was sensed.

        Returns
        -------
        state : LocalizerState
            One tick later.
        pose : PoseDistribution
            What is known now.

        Raises
        ------
        InvalidInputError
            If the motion is not finite or absurd, or the measurement is.
        """
        motion = delta if isinstance(delta, Delta) else Delta(*delta)  # type: ignore[arg-type]
        motion.checked()
        explained = None if measurement is None else self.likelihood(measurement)
        tick, travel, fresh = state.tick + 1, state.travel.onward(motion), None
        doubt = state.doubt
        particles = self.backend.propagate(
            state.particles,
            measured_move(motion, self.config.motion),
            self.free_space.walls,
            state.seed,
            tick,
        )
        if explained is not None and travel.length_m >= self.config.weigh_every_m:
            found, doubt, fresh = self._reweigh(particles, doubt, explained, travel)
            particles, weighed = found.particles, (found.weights, found.summed)
            travel = Travel(credit_m=0.0)
        else:
            weighed = self.backend.weigh(particles)
        particles, injected = self._resample(particles, weighed, fresh, (state.seed, tick))
        after = LocalizerState(
            state.seed, tick, particles, travel, doubt._replace(injected=injected)
        )
        return after, self.estimate(after)

    def estimate(self, state: LocalizerState) -> PoseDistribution:
        """Return the pose distribution of a state.

        Parameters
        ----------
        state : LocalizerState
            Any state of this localizer.

        Returns
        -------
        PoseDistribution
            Lazily evaluated.
        """
        return PoseDistribution(state.particles, self.likelihood.blur_m, self.backend, state.doubt)

    def migrate(self, state: LocalizerState) -> LocalizerState:
        """Continue a session that began on another map.

        Parameters
        ----------
        state : LocalizerState
            Of a localizer for the other map.

        Returns
        -------
        LocalizerState
            The same particles; those that are not free on this map have hardly any weight.
        """
        particles = state.particles
        nothing = np.where(np.arange(len(self.code_map.expected)) == NOWHERE, BLOCKED, 0)
        found = self.backend.reweigh(
            particles, self.free_space.grid.raster, self.code_map.codes, nothing.astype(np.int32)
        )
        return replace(state, particles=found.particles)

    def _reweigh(
        self, particles: Particles, doubt: Doubt, explained: FloatArray, travel: Travel
    ) -> tuple[Reweighed, Doubt, _Fresh | None]:
        exponent = min(1.0, travel.length_m / self.likelihood.correlation_m)
        table = units(exponent * explained)
        found = self.backend.reweigh(
            particles, self.free_space.grid.raster, self.code_map.codes, table
        )
        evidence = found.gain / UNITS_PER_BIT + bits(found.summed.total) - bits(found.before)
        masses = self.backend.cell_masses(self.code_map.coded_cells, table)
        advantage = evidence - masses.evidence_bits
        rule = self.config.recovery
        doubt, share = (rule or _WATCHING).share(
            Doubt(evidence, advantage, doubt.odds, doubt.slow, doubt.fast), exponent
        )
        if rule is None:
            return found, doubt, None
        if not rule.draws_from_measurement:
            masses = self.backend.cell_masses(self.code_map.coded_cells, np.zeros_like(table))
        return found, doubt, _Fresh(masses, share)

    def _resample(
        self,
        particles: Particles,
        weighed: tuple[Weights, WeightSums],
        fresh: _Fresh | None,
        key: tuple[int, int],
    ) -> tuple[Particles, int]:
        """Return the particles to go on with, and how many of them are drawn anew."""
        (weights, sums), backend, adaptive = weighed, self.backend, self.config.adaptive
        high, low, spare, _ = backend.random_words(*key, Purpose.RESAMPLING, 1)[:, 0].tolist()
        injected = 0 if fresh is None else _rounded(fresh.share * particles.size, spare)
        if not injected and not self._is_due(sums):
            return particles, 0
        count = particles.size if adaptive is None else adaptive.count(particles, weights)
        injected = min(injected, count - 1)
        joining = NOBODY
        if fresh is not None and injected:
            joining = backend.draw(self.code_map.coded_cells, fresh.masses, *key, injected)
        if self.config.scheme == "systematic":
            offset = scaled(high, low, sums.total)
            kept = count - injected
            drawn = backend.systematic(particles, weights, sums.total, offset, kept, joining)
            return drawn, injected
        words = backend.random_words(*key, Purpose.RESAMPLING, count)
        ancestors = SCHEMES[self.config.scheme](weights, words, count - injected)
        return joined([chosen(particles, ancestors), joining]), injected


def _rounded(number: float, word: int) -> int:
    """Return one of the two whole numbers around a number, at random with the right mean."""
    return math.floor(number + word * 2.0**-32)
