"""The same for single numbers, where a call of numpy costs more than the sum; see `exact`."""

import math

_LOG_2_E = 1.4426950408889634
LN_2 = 0.6931471805599453
_ROOT_HALF = 0.7071067811865476
TURN = 6.283185307179586
_ATANH = tuple(1.0 / (2 * term - 1) for term in range(12, 0, -1))
_FACTORIALS = tuple(1.0 / term for term in range(14, 0, -1))
_SINE = tuple((-1.0) ** term / math.factorial(2 * term + 1) for term in range(9, -1, -1))
_MOST = 1000.0


def log2(number: float) -> float:
    """Return the binary logarithm.

    Parameters
    ----------
    number : float
        Positive.

    Returns
    -------
    float
        To within a few units in the last place.

    Examples
    --------
    >>> log2(0.25)
    -2.0
    """
    mantissa, exponent = math.frexp(number)
    if mantissa < _ROOT_HALF:
        mantissa, exponent = 2.0 * mantissa, exponent - 1
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    square = ratio * ratio
    series = 0.0
    for coefficient in _ATANH:
        series = series * square + coefficient
    return exponent + 2.0 * ratio * series * _LOG_2_E


def exp2(bits: float) -> float:
    """Return a power of two.

    Parameters
    ----------
    bits : float
        Its exponent, bounded to [-1000, 1000].

    Returns
    -------
    float
        To within a few units in the last place.

    Examples
    --------
    >>> exp2(-2.0)
    0.25
    """
    bounded = min(max(bits, -_MOST), _MOST)
    whole = math.floor(bounded + 0.5)
    rest = (bounded - whole) * LN_2
    series = 1.0
    for coefficient in _FACTORIALS:
        series = series * rest * coefficient + 1.0
    return math.ldexp(series, whole)


def sine(turns: float) -> float:
    """Return the sine.

    Parameters
    ----------
    turns : float
        Angle in turns.

    Returns
    -------
    float
        To within 1e-14.

    Examples
    --------
    >>> round(sine(1.0 / 12.0), 12)
    0.5
    """
    folded = turns - math.floor(turns + 0.5)
    acute = (0.25 - abs(abs(folded) - 0.25)) * TURN
    square = acute * acute
    series = 0.0
    for coefficient in _SINE:
        series = series * square + coefficient
    return math.copysign(series * acute, folded)


def cosine(turns: float) -> float:
    """Return the cosine.

    Parameters
    ----------
    turns : float
        Angle in turns.

    Returns
    -------
    float
        To within 1e-14.

    Examples
    --------
    >>> round(cosine(1.0 / 6.0), 12)
    0.5
    """
    return sine(turns + 0.25)
