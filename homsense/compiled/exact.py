"""Single-precision arithmetic and random bits, compiled; see `homsense.exact` and `philox`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense import exact, philox
from homsense.compiled.jit import allocating, apart, inlined

Array = NDArray[Any]

HALF, ONE, QUARTER = exact.HALF, exact.ONE, exact.QUARTER
_QUARTER_UNIT = exact.QUARTER_UNIT
_ROOT_HALF, _SCALED_ROOT_HALF = exact.ROOT_HALF, exact.SCALED_ROOT_HALF
_MANTISSA, _MINUS_TWO_LN_2 = exact.MANTISSA, exact.MINUS_TWO_LN_2
_L0, _L1, _L2, _L3, _L4, _L5, _L6 = exact.LOG
_S0, _S1, _S2, _S3, _S4 = exact.SINE
_M0, _M1 = philox.MULTIPLIERS
_W0, _W1 = philox.WEYL
_ROUNDS = philox.ROUNDS
_WORD, _EIGHT, _SIGN = np.uint64(32), np.uint32(8), np.uint32(31)
_TWENTY_THREE = np.int32(23)


@inlined
def random_words(index: Any, tick: Any, purpose: Any, seed: Any) -> Any:
    """Return the four random words of a number."""
    c0, c1 = np.uint32(index), np.uint32(tick)
    c2, c3 = np.uint32(tick >> _WORD), np.uint32(purpose)
    k0, k1 = np.uint32(seed), np.uint32(seed >> _WORD)
    for _ in range(_ROUNDS):
        low, high = _M0 * np.uint64(c0), _M1 * np.uint64(c2)
        c0, c1, c2, c3 = (
            np.uint32(high >> _WORD) ^ c1 ^ k0,
            np.uint32(high),
            np.uint32(low >> _WORD) ^ c3 ^ k1,
            np.uint32(low),
        )
        k0, k1 = np.uint32(k0 + _W0), np.uint32(k1 + _W1)
    return c0, c1, c2, c3


@allocating
def words(seed: Any, tick: Any, purpose: Any, count: int) -> Array:
    """Return four random words for each of the numbers from 0.

    Parameters
    ----------
    seed, tick : uint64
        Key.
    purpose : int
        Number of the stream.
    count : int
        How many.

    Returns
    -------
    ndarray, shape (4, count), uint32
        Random bits.
    """
    drawn = np.empty((4, count), np.uint32)
    _fill(seed, tick, purpose, drawn[0], drawn[1], drawn[2], drawn[3])
    return drawn


@apart
def _fill(
    seed: Any, tick: Any, purpose: Any, first: Array, second: Array, third: Array, fourth: Array
) -> None:
    for index in range(len(first)):
        first[index], second[index], third[index], fourth[index] = random_words(
            index, tick, purpose, seed
        )


@inlined
def squared_radius(word: Any) -> Any:
    """Return the squared length of two normal deviates."""
    number = np.float32(word >> _EIGHT) + HALF
    bits = np.int32(np.float32(number).view(np.int32) - _SCALED_ROOT_HALF)
    exponent = np.float32(bits >> _TWENTY_THREE)
    f = np.int32(np.int32(bits & _MANTISSA) + _ROOT_HALF).view(np.float32) - ONE
    series = ((((_L0 * f + _L1) * f + _L2) * f + _L3) * f + _L4) * f + _L5
    return (series * f + _L6) * f + exponent * _MINUS_TWO_LN_2


@inlined
def sine(turns: Any) -> Any:
    """Return the sine of an angle in turns, in [-1/2, 1/2]."""
    acute = QUARTER - abs(abs(turns) - QUARTER)
    return np.copysign(_sine_of_acute(acute), turns)


@inlined
def cosine(turns: Any) -> Any:
    """Return the cosine of an angle in turns, in [-1/2, 1/2]."""
    return _sine_of_acute(QUARTER - abs(turns))


@inlined
def _sine_of_acute(turns: Any) -> Any:
    square = turns * turns
    series = (((_S0 * square + _S1) * square + _S2) * square + _S3) * square + _S4
    return series * turns


@inlined
def two_normals(distance: Any, direction: Any) -> Any:
    """Return two independent normal deviates."""
    length = np.float32(np.sqrt(squared_radius(distance))).view(np.uint32)
    radius = np.uint32(length | np.uint32(distance << _SIGN)).view(np.float32)
    turns = np.float32(np.int32(direction)) * _QUARTER_UNIT
    return radius * cosine(turns), radius * _sine_of_acute(turns)


@inlined
def wrap_turns(turns: Any) -> Any:
    """Return an angle in [-1/2, 1/2)."""
    return turns - np.floor(turns + HALF)
