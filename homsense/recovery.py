"""A standing doubt: the device may be somewhere else altogether.

Each measurement is also weighed against the hypothesis that the pose has nothing to do with the
particles. By Bayes' rule that hypothesis gets a share of them, drawn from p(x | z).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from homsense.errors import InvalidConfigurationError
from homsense.scalar import exp2

_MOST_ODDS = 1e9


class Doubt(NamedTuple):
    """What the measurements have said so far about the particles as a whole.

    Parameters
    ----------
    evidence_bits : float
        Binary logarithm of the likelihood of the last measurement, mean over the particles.
    advantage_bits : float
        The same, above its mean over all free space.
    odds : float
        That the pose was lost, to that it was not (Shiryaev's statistic).
    slow, fast : float
        Averages of the likelihood for `AugmentedMcl`; 0 before the first measurement.
    injected : int
        Particles drawn from p(x | z) at the last step.
    """

    evidence_bits: float = 0.0
    advantage_bits: float = 0.0
    odds: float = 0.0
    slow: float = 0.0
    fast: float = 0.0
    injected: int = 0

    @property
    def relocation_p(self) -> float:
        """Probability that the pose was lost, in [0, 1)."""
        return self.odds / (1.0 + self.odds)


class Recovery(Protocol):
    """What the localizer asks of a way to recover."""

    def share(self, doubt: Doubt, exponent: float) -> tuple[Doubt, float]:
        """Return what is remembered, and the share of particles to draw anew."""
        ...

    @property
    def draws_from_measurement(self) -> bool:
        """Whether new particles come from p(x | z); else from free space."""
        ...


@dataclass(frozen=True, slots=True)
class Relocation:
    """The standing hypothesis, with a prior probability.

    Parameters
    ----------
    probability : float, default 0.05
        That the pose was lost between two independent measurements, in [0, 1); 0 never draws.

    Raises
    ------
    InvalidConfigurationError
        If the probability is out of range.
    """

    probability: float = 0.05

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability < 1.0:
            message = f"probability must be in [0, 1), not {self.probability}"
            raise InvalidConfigurationError(message, "recovery.probability")

    @property
    def draws_from_measurement(self) -> bool:
        """Whether new particles come from p(x | z)."""
        return True

    def share(self, doubt: Doubt, exponent: float) -> tuple[Doubt, float]:
        """Return what is remembered, and the share of particles to draw anew.

        Parameters
        ----------
        doubt : Doubt
            With the evidence of this measurement.
        exponent : float
            How much of an independent measurement it is, in [0, 1].

        Returns
        -------
        doubt : Doubt
            With new odds.
        share : float
            In [0, 1].
        """
        prior = self.probability * exponent
        against = exp2(-doubt.advantage_bits)
        odds = min((doubt.odds + prior) * against / (1.0 - prior), _MOST_ODDS)
        lost = prior * against
        return doubt._replace(odds=odds), lost / (1.0 - prior + lost)


@dataclass(frozen=True, slots=True)
class AugmentedMcl:
    """AMCL's rule: random particles when the likelihood falls below its own long average.

    It is here for those who know it; with a sensor that counts, the likelihood hardly falls.

    Parameters
    ----------
    alpha_slow, alpha_fast : float, default 0.001 and 0.1
        Rates of the two averages, 0 <= slow < fast <= 1.

    Raises
    ------
    InvalidConfigurationError
        If the rates are out of range.
    """

    alpha_slow: float = 0.001
    alpha_fast: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.alpha_slow < self.alpha_fast <= 1.0:
            message = "0 <= alpha_slow < alpha_fast <= 1 must hold"
            raise InvalidConfigurationError(message, "recovery.alpha_slow")

    @property
    def draws_from_measurement(self) -> bool:
        """Whether new particles come from p(x | z)."""
        return False

    def share(self, doubt: Doubt, exponent: float) -> tuple[Doubt, float]:
        """Return what is remembered, and the share of particles to draw anew.

        Parameters
        ----------
        doubt : Doubt
            With the evidence of this measurement.
        exponent : float
            Does not matter here.

        Returns
        -------
        doubt : Doubt
            With new averages and odds.
        share : float
            In [0, 1].
        """
        doubt, _ = Relocation().share(doubt, exponent)
        likelihood = exp2(doubt.evidence_bits)
        if not doubt.slow:
            return doubt._replace(slow=likelihood, fast=likelihood), 0.0
        slow = doubt.slow + self.alpha_slow * (likelihood - doubt.slow)
        fast = doubt.fast + self.alpha_fast * (likelihood - doubt.fast)
        return doubt._replace(slow=slow, fast=fast), max(0.0, 1.0 - fast / slow)
