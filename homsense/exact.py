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

HALF, ONE, QUARTER = map(np.float32, (0.5, 1.0, 0.25))
UNIT, QUARTER_UNIT = np.float32(2.0**-24), np.float32(2.0**-33)
ROOT_HALF, MANTISSA = np.int32(0x3F3504F3), np.int32(0x007FFFFF)
SCALED_ROOT_HALF = ROOT_HALF + np.int32(24 << 23)
LOG = tuple(
    map(
        np.float32,
        (
            -0.2376929224,
            0.3733564019,
            -0.4099950194,
            0.4981994033,
            -0.6662861705,
            1.000021935,
            -2.000001907,
        ),
    )
)
"""Of -2 ln(1 + f) / f between the root of 1/2 and of 2, the least relative error."""
MINUS_TWO_LN_2 = np.float32(-1.3862943611)
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


def squared_radius(words: Words) -> Singles:
    """Return the squared length of two normal deviates, which is exponentially distributed.

    Parameters
    ----------
    words : ndarray, uint32
        Random bits; the upper 24 count.

    Returns
    -------
    ndarray, float32
        -2 ln u for the u that `unit_interval` gives, to within a relative error of 2e-6.
    """
    bits = ((words >> np.uint32(8)).astype(np.float32) + HALF).view(np.int32)
    bits -= SCALED_ROOT_HALF
    exponent = (bits >> np.int32(23)).astype(np.float32)
    bits &= MANTISSA
    bits += ROOT_HALF
    f = bits.view(np.float32) - ONE
    series = LOG[0] * f
    for coefficient in LOG[1:]:
        series += coefficient
        series *= f
    exponent *= MINUS_TWO_LN_2
    series += exponent
    return series


def sine(turns: Singles) -> Singles:
    """Return the sine.

    Parameters
    ----------
    turns : ndarray, float32
        Angles in turns, in [-1/2, 1/2].

    Returns
    -------
    ndarray, float32
        To within 3e-7.
    """
    acute = np.abs(turns)
    acute -= QUARTER
    np.abs(acute, out=acute)
    np.subtract(QUARTER, acute, out=acute)
    result = _sine_of_acute(acute)
    np.copysign(result, turns, out=result)
    return result


def cosine(turns: Singles) -> Singles:
    """Return the cosine.

    Parameters
    ----------
    turns : ndarray, float32
        Angles in turns, in [-1/2, 1/2].

    Returns
    -------
    ndarray, float32
        To within 3e-7.
    """
    acute = np.abs(turns)
    return _sine_of_acute(np.subtract(QUARTER, acute, out=acute))


def _sine_of_acute(turns: Singles) -> Singles:
    square = turns * turns
    series = SINE[0] * square
    for coefficient in SINE[1:-1]:
        series += coefficient
        series *= square
    series += SINE[-1]
    series *= turns
    return series


def standard_normals(words: Words) -> Singles:
    """Return four independent normal deviates for each column (Box and Muller).

    Two words give a point of the plane: the first its distance from the middle and, by its lowest
    bit, one of two halves; the second the direction in that half.

    Parameters
    ----------
    words : ndarray, shape (4, N), uint32
        Random bits.

    Returns
    -------
    ndarray, shape (4, N), float32
        Standard normal.
    """
    distance, direction = words[0::2], words[1::2]
    radius = np.sqrt(squared_radius(distance))
    radius.view(np.uint32)[...] |= distance << np.uint32(31)
    turns = direction.view(np.int32).astype(np.float32)
    turns *= QUARTER_UNIT
    normals = np.empty(words.shape, np.float32)
    np.multiply(radius, cosine(turns), out=normals[0::2])
    np.multiply(radius, _sine_of_acute(turns), out=normals[1::2])
    return normals


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
    whole = turns + HALF
    np.floor(whole, out=whole)
    wrapped: Singles = np.subtract(turns, whole, out=whole)
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
