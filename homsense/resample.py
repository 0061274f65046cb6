"""Resampling: which particle lives on, by weight (Algorithm 1, resampleParticlesByWeight)."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def normalize(log_weights: FloatArray) -> FloatArray:
    """Return weights that sum to one.

    Parameters
    ----------
    log_weights : ndarray, shape (N,), float64
        Natural logarithms up to a constant, finite.

    Returns
    -------
    ndarray, shape (N,), float64
        Non-negative.

    Examples
    --------
    >>> normalize(np.array([-1000.0, -1000.0])).tolist()
    [0.5, 0.5]
    """
    weights = np.exp(log_weights - log_weights.max())
    normalized: FloatArray = weights / weights.sum()
    return normalized


def effective_sample_size(weights: FloatArray) -> float:
    """Return how many equally weighted particles carry the same information.

    Parameters
    ----------
    weights : ndarray, shape (N,), float64
        Normalized weights.

    Returns
    -------
    float
        ``1 / sum(w**2)``, in [1, N].

    Examples
    --------
    >>> effective_sample_size(np.full(4, 0.25))
    4.0
    """
    return float(1.0 / np.square(weights).sum())


def systematic(weights: FloatArray, rng: np.random.Generator) -> IntArray:
    """Draw N indices with one random offset and N equal strides.

    Parameters
    ----------
    weights : ndarray, shape (N,), float64
        Normalized weights.
    rng : numpy.random.Generator
        Source of the offset.

    Returns
    -------
    ndarray, shape (N,), intp
        Rising indices; index i occurs floor(N w_i) or ceil(N w_i) times, N w_i on average.
    """
    count = len(weights)
    strides = (np.arange(count) + rng.random()) / count
    reached = np.searchsorted(np.cumsum(weights), strides, side="right")
    return np.minimum(reached, count - 1)
