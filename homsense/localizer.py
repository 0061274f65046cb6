"""Algorithm 1, runTopologicalMCL, as a chain of stages over values.

propagate -> reweigh -> resample on a policy -> estimate. A step is a pure function: the random
numbers of tick t of a session come from Philox keyed by (seed, t).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidConfigurationError, InvalidInputError
from homsense.estimate import PoseDistribution
from homsense.free_space import FreeSpace
from homsense.height import HeightMap
from homsense.likelihood import CountNoise, log_likelihood
from homsense.motion import MotionModel, OdometryMotion, propagate
from homsense.pose import Delta
from homsense.prior import Prior, UniformPrior
from homsense.resample import effective_sample_size, normalize, systematic
from homsense.site_map import SiteMap

FloatArray = NDArray[np.float64]

MAX_PARTICLES = 1_000_000
BLOCKED_LOG_WEIGHT = -20.0


@dataclass(frozen=True, slots=True)
class LocalizerConfig:
    """Parameters of the filter.

    Parameters
    ----------
    particles : int, default 8000
        Number of pose hypotheses, in [1, 1e6].
    motion : MotionModel, optional
        Uncertainty of motion; odometry by default.
    noise : CountNoise, optional
        Error of the homological sensor.
    prior : Prior, optional
        What is known at the start; nothing by default.
    resample_below : float, default 0.5
        Resample when the effective sample size falls below this share of the particles; 1.0
        resamples at every step, as Algorithm 1 does.
    cell_m : float, default 2.0
        Resolution of the walls, metres.

    Raises
    ------
    InvalidConfigurationError
        If a number is out of range.
    """

    particles: int = 8000
    motion: MotionModel = field(default_factory=OdometryMotion)
    noise: CountNoise = field(default_factory=CountNoise)
    prior: Prior = field(default_factory=UniformPrior)
    resample_below: float = 0.5
    cell_m: float = 2.0

    def __post_init__(self) -> None:
        if not 1 <= self.particles <= MAX_PARTICLES:
            message = f"particles must be in [1, {MAX_PARTICLES}], not {self.particles}"
            raise InvalidConfigurationError(message, "particles")
        if not 0.0 <= self.resample_below <= 1.0:
            message = f"resample_below must be in [0, 1], not {self.resample_below}"
            raise InvalidConfigurationError(message, "resample_below")


@dataclass(frozen=True, slots=True)
class LocalizerState:
    """Everything a session has to remember.

    Parameters
    ----------
    seed : int
        Key of the session's random numbers, in [0, 2**64).
    tick : int
        Steps taken.
    poses : ndarray, shape (N, 3), float64
        Particles.
    log_weights : ndarray, shape (N,), float64
        Natural logarithms, finite, at most 0.
    unweighed_m : float
        Way since the last weighing, metres; infinite before the first.
    """

    seed: int
    tick: int
    poses: FloatArray
    log_weights: FloatArray
    unweighed_m: float


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
    ) -> None:
        self.site_map = site_map
        self.heights = tuple(heights)
        self.config = config or LocalizerConfig()
        self.free_space = free_space or FreeSpace.of(site_map, self.config.cell_m)

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
        poses = self.config.prior.draw(self.free_space, count, _random(seed, 0))
        return LocalizerState(seed, 0, poses, np.zeros(count), np.inf)

    def step(
        self,
        state: LocalizerState,
        delta: Delta | Sequence[float],
        counts: Sequence[int] | None = None,
    ) -> tuple[LocalizerState, PoseDistribution]:
        """Move and, when there is a measurement, weigh and resample (Algorithm 1, lines 6 to 13).

        Parameters
        ----------
        state : LocalizerState
            From `start` or the step before; it stays valid.
        delta : Delta or sequence of float
            Measured body-frame motion: forward m, left m, turn rad.
        counts : sequence of int, optional
            Holes sensed in each neighborhood; none when nothing was sensed.

        Returns
        -------
        state : LocalizerState
            One tick later.
        pose : PoseDistribution
            What is known now.

        Raises
        ------
        InvalidInputError
            If the motion or a count is out of range; the state is unchanged.
        """
        rng = _random(state.seed, state.tick + 1)
        motion = Delta(*delta).checked()
        moved = self._propagate(state, motion, rng)
        weighed = self._reweigh(moved, counts) if counts is not None else moved
        resampled = self._resample(weighed, rng)
        final = replace(resampled, tick=state.tick + 1)
        return final, self.estimate(final)

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
        return PoseDistribution(state.poses, normalize(state.log_weights))

    def _propagate(
        self, state: LocalizerState, delta: Delta, rng: np.random.Generator
    ) -> LocalizerState:
        poses = propagate(state.poses, delta, self.config.motion, rng)
        blocked = self.free_space.blocked(state.poses[:, :2], poses[:, :2])
        log_weights = state.log_weights + np.where(blocked, BLOCKED_LOG_WEIGHT, 0.0)
        return replace(
            state,
            poses=poses,
            log_weights=log_weights - log_weights.max(),
            unweighed_m=state.unweighed_m + delta.length_m,
        )

    def _reweigh(self, state: LocalizerState, counts: Sequence[int]) -> LocalizerState:
        noise = self.config.noise
        exponent = min(1.0, state.unweighed_m / noise.correlation_m)
        gain = exponent * log_likelihood(state.poses, self.heights, counts, noise)
        log_weights = state.log_weights + gain
        return replace(state, log_weights=log_weights - log_weights.max(), unweighed_m=0.0)

    def _resample(self, state: LocalizerState, rng: np.random.Generator) -> LocalizerState:
        weights = normalize(state.log_weights)
        count = len(weights)
        if effective_sample_size(weights) > self.config.resample_below * count:
            return state
        kept = systematic(weights, rng)
        return replace(state, poses=state.poses[kept], log_weights=np.zeros(count))


def _random(seed: int, tick: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, tick, 0]))
