"""Parameters of the filter."""

import math
from dataclasses import dataclass, field
from typing import Literal

from homsense.adaptive import MAX_PARTICLES, KldSampling
from homsense.errors import InvalidConfigurationError
from homsense.motion import MotionModel, OdometryMotion
from homsense.noise import CountNoise, Noise
from homsense.policy import Policy, ess_below
from homsense.prior import Prior, UniformPrior
from homsense.recovery import Recovery, Relocation
from homsense.resample import SCHEMES


@dataclass(frozen=True, slots=True)
class LocalizerConfig:
    """Parameters of the filter.

    Parameters
    ----------
    particles : int, default 8000
        Number of pose hypotheses, in [1, 1e6].
    motion : MotionModel, optional
        Uncertainty of motion; odometry by default.
    noise : Noise, optional
        Error of the homological sensor.
    prior : Prior, optional
        What is known at the start; nothing by default.
    resample_below : float, default 0.5
        Resample when the effective sample size falls below this share of the particles; 1.0
        resamples whenever weights differ, as Algorithm 1 does.
    policy : callable, optional
        When to resample, a predicate of `homsense.policy`, in place of `resample_below`.
    scheme : {"systematic", "stratified", "residual", "multinomial"}, default "systematic"
        How particles are drawn.
    recovery : Recovery or None, optional
        What becomes of the doubt that the pose is lost; a standing hypothesis of five percent by
        default, None never draws particles anew.
    adaptive : KldSampling, optional
        Bounds within which the number of particles follows the spread; fixed by default.
    weigh_every_m : float, default 0.5
        A measurement is weighed when the device has moved this far since the last one, metres: a
        device that stands still learns nothing new.
    cell_m : float, default 2.0
        Resolution of the walls, metres.

    Raises
    ------
    InvalidConfigurationError
        If a number is out of range.
    """

    particles: int = 8000
    motion: MotionModel = field(default_factory=OdometryMotion)
    noise: Noise = field(default_factory=CountNoise)
    prior: Prior = field(default_factory=UniformPrior)
    resample_below: float = 0.5
    policy: Policy | None = None
    scheme: Literal["systematic", "stratified", "residual", "multinomial"] = "systematic"
    recovery: Recovery | None = field(default_factory=Relocation)
    adaptive: KldSampling | None = None
    weigh_every_m: float = 0.5
    cell_m: float = 2.0

    def __post_init__(self) -> None:
        if not 1 <= self.particles <= MAX_PARTICLES:
            message = f"particles must be in [1, {MAX_PARTICLES}], not {self.particles}"
            raise InvalidConfigurationError(message, "particles")
        if self.scheme not in SCHEMES:
            message = f"scheme must be one of {', '.join(SCHEMES)}, not {self.scheme!r}"
            raise InvalidConfigurationError(message, "scheme")
        if not (math.isfinite(self.weigh_every_m) and self.weigh_every_m >= 0.0):
            message = f"weigh_every_m must not be negative, not {self.weigh_every_m}"
            raise InvalidConfigurationError(message, "weigh_every_m")
        ess_below(self.resample_below)
