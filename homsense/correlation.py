"""How errors of the sensor go together: those of two neighborhoods, and those of two places."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

DIGITS = 4
"""What no order of summation changes."""

_SHRUNK = 0.02
_MOST_MEASURED = 4800
_BIN_M = 5.0
_FARTHEST_M = 400.0
_NO_LONGER = 0.05


def between_levels(products: FloatArray) -> FloatArray:
    """Return the correlation of neighborhoods, a little less than it is so that it has a root.

    Parameters
    ----------
    products : ndarray, shape (L, L), float64
        Their covariance, in any unit.

    Returns
    -------
    ndarray, shape (L, L), float64
        Positive definite, of unit diagonal.

    Examples
    --------
    >>> between_levels(np.array([[4.0, 3.0], [3.0, 9.0]])).tolist()
    [[1.0, 0.49], [0.49, 1.0]]
    """
    deviation = np.sqrt(np.diag(products))
    correlation = products / np.maximum(np.outer(deviation, deviation), np.finfo(float).tiny)
    shrunk: FloatArray = (1 - _SHRUNK) * correlation + _SHRUNK * np.eye(len(correlation))
    np.fill_diagonal(shrunk, 1.0)
    return shrunk.round(DIGITS)


def independent(errors: FloatArray, correlation: FloatArray) -> FloatArray:
    """Return what errors are made of.

    Parameters
    ----------
    errors : ndarray, shape (..., L), float64
        Of unit variance.
    correlation : ndarray, shape (L, L), float64
        Between the neighborhoods.

    Returns
    -------
    ndarray, shape (..., L), float64
        Of unit variance, too, and not correlated: the root of the correlation times these are the
        errors.
    """
    found: FloatArray = errors @ np.linalg.inv(np.linalg.cholesky(correlation)).T
    return found


def correlation_m(places: FloatArray, errors: FloatArray, walk: IntArray | None = None) -> float:
    """Return twice the integral of the errors' correlation over distance, metres.

    So many metres hold as much as one independent measurement.

    Parameters
    ----------
    places : ndarray, shape (P, 2), float64
        Where, metres.
    errors : ndarray, shape (W, P, L), float64
        Of each place in some worlds, not correlated between the neighborhoods.
    walk : ndarray, shape (P,), int64, optional
        Walk that each place belongs to; only those of the same walk are compared.

    Returns
    -------
    float
        To a tenth of a metre, 5 m or more.
    """
    power = max(float(np.square(errors).mean()), np.finfo(float).tiny)
    some = np.arange(0, len(places), max(1, len(errors) * len(places) // _MOST_MEASURED))
    products = np.zeros(int(_FARTHEST_M / _BIN_M) + 1)
    pairs = np.zeros_like(products)
    for place in some:
        others = slice(None) if walk is None else walk == walk[place]
        apart = np.sqrt(np.square(places[others] - places[place]).sum(axis=1))
        which = np.minimum(apart / _BIN_M + 0.5, len(pairs) - 1).astype(np.intp)
        alike = (errors[:, others] * errors[:, place, None, :]).mean(axis=(0, 2))
        products += np.bincount(which, alike, len(pairs))
        pairs += np.bincount(which, minlength=len(pairs))
    known = np.flatnonzero(pairs[:-1])
    alike = np.maximum(products[known] / pairs[known] / power, 0.0)
    alike[0] = 1.0
    end = int(np.argmax(alike < _NO_LONGER)) or len(alike)
    length_m = 2.0 * float(np.trapezoid(alike[: end + 1], _BIN_M * known[: end + 1]))
    return max(round(length_m, 1), _BIN_M)
