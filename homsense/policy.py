"""When to resample: predicates over the weights."""

from collections.abc import Callable

from homsense.errors import InvalidConfigurationError
from homsense.weights import WeightSums

Policy = Callable[[WeightSums], bool]


def ess_below(share: float) -> Policy:
    """Resample when the effective sample size falls below a share of the particles.

    Parameters
    ----------
    share : float
        In [0, 1]; 1 resamples whenever weights differ.

    Returns
    -------
    callable
        The predicate.

    Raises
    ------
    InvalidConfigurationError
        If the share is out of range.

    Examples
    --------
    >>> ess_below(0.5)(WeightSums(size=4, total=10, squares=100))
    True
    """
    if not 0.0 <= share <= 1.0:
        message = f"resample_below must be in [0, 1], not {share}"
        raise InvalidConfigurationError(message, "resample_below")
    return lambda weights: weights.ess < share * weights.size


def always(_: WeightSums) -> bool:
    """Resample at every step, as Algorithm 1 does."""
    return True


def never(_: WeightSums) -> bool:
    """Keep the weights."""
    return False


def any_of(*policies: Policy) -> Policy:
    """Resample when one of some policies says so.

    Parameters
    ----------
    *policies : callable
        Predicates.

    Returns
    -------
    callable
        The predicate.

    Examples
    --------
    >>> any_of(never, always)(WeightSums(1, 1, 1))
    True
    """
    return lambda weights: any(policy(weights) for policy in policies)
