"""Arithmetic that gives the same bits on every machine.

IEEE 754 defines ``+ - * /``, the square root and `floor` to the last bit; it leaves the rest to
the library, and libraries choose by processor. So the functions here are polynomials in those
operations. `homsense.compiled.exact` repeats the ones for single precision, operation by
operation.
"""

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Doubles = NDArray[np.float64]
Words = NDArray[np.uint32]

HALF, ONE, QUARTER, MINUS_TWO = map(np.float32, (0.5, 1.0, 0.25, -2.0))
UNIT = np.float32(2.0**-24)
ROOT_HALF = np.int32(0x3F3504F3)
MANTISSA = np.int32(0x007FFFFF)
LOG = tuple(
    map(
        np.float32,
        (
            7.0376836292e-2,
            -1.1514610310e-1,
            1.1676998740e-1,
            -1.2420140846e-1,
            1.4249322787e-1,
            -1.6668057665e-1,
            2.0000714765e-1,
            -2.4999993993e-1,
            3.3333331174e-1,
        ),
    )
)
LOG_2_HIGH, LOG_2_LOW = np.float32(0.693359375), np.float32(-2.12194440e-4)
SINE = tuple(
    map(np.float32, (39.5367054791, -76.5497822203, 81.6010040703, -41.3416550314, 6.28318516009))
)

_LOG_2_E = 1.4426950408889634
_LN_2_HIGH, _LN_2_LOW = 0.6931471803691238, 1.9082149292705877e-10
_EXP_TERMS = 14
_EXP_LEAST = -700.0
_LOG_TERMS = 12


def unit_interval(words: Words) -> Singles:
    """Return random words as numbers.

    Parameters
    ----------
    words : ndarray, uint32
        Random bits; the upper 24 count.

    Returns
    -------
    ndarray, float32
        In (0, 1].
    """
    numbers: Singles = ((words >> np.uint32(8)).astype(np.float32) + HALF) * UNIT
    return numbers


def log_unit(numbers: Singles) -> Singles:
    """Return the natural logarithm.

    Parameters
    ----------
    numbers : ndarray, float32
        Positive and normal.

    Returns
    -------
    ndarray, float32
        To within 5e-7.
    """
    bits = numbers.view(np.int32) - ROOT_HALF
    exponent = (bits >> np.int32(23)).astype(np.float32)
    f = ((bits & MANTISSA) + ROOT_HALF).view(np.float32) - ONE
    square = f * f
    series = LOG[0] * f + LOG[1]
    for coefficient in LOG[2:]:
        series = series * f + coefficient
    series = series * f * square
    series = series + LOG_2_LOW * exponent
    series = series - HALF * square
    logarithm: Singles = (f + series) + LOG_2_HIGH * exponent
    return logarithm


def sine(turns: Singles) -> Singles:
    """Return the sine.

    Parameters
    ----------
    turns : ndarray, float32
        Angles in turns.

    Returns
    -------
    ndarray, float32
        To within 3e-7.
    """
    folded = wrap_turns(turns)
    acute = QUARTER - np.abs(np.abs(folded) - QUARTER)
    return np.copysign(_sine_of_acute(acute), folded)


def cosine(turns: Singles) -> Singles:
    """Return the cosine.

    Parameters
    ----------
    turns : ndarray, float32
        Angles in turns.

    Returns
    -------
    ndarray, float32
        To within 3e-7.
    """
    return _sine_of_acute(QUARTER - np.abs(wrap_turns(turns)))


def _sine_of_acute(turns: Singles) -> Singles:
    square = turns * turns
    series = SINE[0] * square + SINE[1]
    for coefficient in SINE[2:]:
        series = series * square + coefficient
    result: Singles = series * turns
    return result


def standard_normals(words: Words) -> tuple[Singles, Singles, Singles]:
    """Return three independent normal deviates for each column (Box and Muller).

    Parameters
    ----------
    words : ndarray, shape (4, N), uint32
        Random bits.

    Returns
    -------
    tuple of ndarray, shape (N,), float32
        Standard normal.
    """
    near = np.sqrt(MINUS_TWO * log_unit(unit_interval(words[0])))
    around = unit_interval(words[1])
    far = np.sqrt(MINUS_TWO * log_unit(unit_interval(words[2])))
    return near * cosine(around), near * sine(around), far * cosine(unit_interval(words[3]))


def wrap_turns(turns: Singles) -> Singles:
    """Return angles in [-1/2, 1/2).

    Parameters
    ----------
    turns : ndarray, float32
        Angles in turns.

    Returns
    -------
    ndarray, float32
        The same directions.
    """
    wrapped: Singles = turns - np.floor(turns + HALF)
    return wrapped


def exp(numbers: Doubles) -> Doubles:
    """Return the exponential.

    Parameters
    ----------
    numbers : ndarray, float64
        At most 700; below -700 the result is 0.

    Returns
    -------
    ndarray, float64
        To within a few units in the last place.

    Examples
    --------
    >>> exp(np.array([0.0, -1000.0])).tolist()
    [1.0, 0.0]
    """
    bounded = np.maximum(numbers, _EXP_LEAST)
    twos = np.floor(bounded * _LOG_2_E + 0.5)
    rest = (bounded - twos * _LN_2_HIGH) - twos * _LN_2_LOW
    series = np.ones_like(rest)
    for term in range(_EXP_TERMS, 0, -1):
        series *= rest
        series /= term
        series += 1.0
    result: Doubles = np.ldexp(series, twos.astype(np.int32))
    return np.where(numbers < _EXP_LEAST, 0.0, result)


def log2(numbers: Doubles) -> Doubles:
    """Return the binary logarithm.

    Parameters
    ----------
    numbers : ndarray, float64
        Positive.

    Returns
    -------
    ndarray, float64
        To within a few units in the last place.

    Examples
    --------
    >>> log2(np.array([1.0, 8.0, 0.25])).tolist()
    [0.0, 3.0, -2.0]
    """
    mantissa, exponent = np.frexp(numbers)
    small = mantissa < np.sqrt(0.5)
    mantissa = np.where(small, 2.0 * mantissa, mantissa)
    exponent = exponent - small
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    square = ratio * ratio
    series = np.zeros_like(ratio)
    for term in range(_LOG_TERMS, 0, -1):
        series *= square
        series += 1.0 / (2 * term - 1)
    result: Doubles = exponent + 2.0 * ratio * series * _LOG_2_E
    return result
