"""Random bits without a state: Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011).

The four words of number i at a tick are a function of the seed, the tick, what they are for,
and i; so any tick can be computed again, in any order.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]

ROUNDS = 10
MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
WEYL = np.uint32(0x9E3779B9), np.uint32(0xBB67AE85)
_MASK = 0xFFFFFFFF
_WORD = np.uint64(32)
(_M0, _M1), (_W0, _W1) = map(int, MULTIPLIERS), map(int, WEYL)
_FACTORS, _STEPS = np.array(MULTIPLIERS)[:, None], np.array(WEYL)[:, None]


class Purpose(IntEnum):
    """What random bits are for; each has its own stream."""

    MOTION = 0
    RESAMPLING = 1
    RELOCATION = 2
    PRIOR = 3


def random_words(seed: int, tick: int, purpose: int, count: int, first: int = 0) -> Words:
    """Return four random words for each of some numbers in a row.

    Parameters
    ----------
    seed, tick : int
        In [0, 2**64).
    purpose : int
        Number of the stream, in [0, 2**32).
    count, first : int
        How many, and the first one.

    Returns
    -------
    ndarray, shape (4, count), uint32
        Uniform and independent.

    Examples
    --------
    >>> [hex(word) for word in random_words(0, 0, 0, 1)[:, 0].tolist()]
    ['0x6627e8d5', '0xe169c58d', '0xbc57ac4c', '0x9b00dbd8']
    """
    if count == 1:
        return np.array([_words_of(first, seed, tick, purpose)], np.uint32).T
    words = np.empty((2, 2, count), np.uint32)
    words[0, 0] = np.arange(first, first + count, dtype=np.uint32)
    words[0, 1], words[1, 0], words[1, 1] = tick & _MASK, tick >> 32, purpose
    even, odd = words[:, 0], words[:, 1]
    key = np.array([[seed & _MASK], [seed >> 32]], np.uint32)
    for _ in range(ROUNDS):
        product = even * _FACTORS
        even = (product[::-1] >> _WORD).astype(np.uint32)
        even ^= odd
        even ^= key
        odd = product[::-1].astype(np.uint32)
        key = key + _STEPS
    words[:, 0], words[:, 1] = even, odd
    return words.reshape(4, count)


def _words_of(number: int, seed: int, tick: int, purpose: int) -> tuple[int, int, int, int]:
    """Return the four random words of one number, where arrays take ten times as long."""
    c0, c1, c2, c3 = number, tick & _MASK, tick >> 32, purpose
    k0, k1 = seed & _MASK, seed >> 32
    for _ in range(ROUNDS):
        low, high = _M0 * c0, _M1 * c2
        c0, c1, c2, c3 = high >> 32 ^ c1 ^ k0, high & _MASK, low >> 32 ^ c3 ^ k1, low & _MASK
        k0, k1 = k0 + _W0 & _MASK, k1 + _W1 & _MASK
    return c0, c1, c2, c3
