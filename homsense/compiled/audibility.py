"""What heard landmarks tell about the blocks of a map, compiled; see `homsense.audibility`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense.audibility import Audible
from homsense.compiled.jit import kept

Array = NDArray[Any]


def heard(
    audible: Audible, landmark: Array, height_db: Array, above: Array, n_blocks: int
) -> NDArray[np.float64]:
    """Return what it tells about each block that some landmarks are heard.

    Parameters
    ----------
    audible : Audible
        Where they can be heard.
    landmark : ndarray, shape (H,), int64
        Which landmarks.
    height_db : ndarray, shape (H,), float64
        How loud each is, dB.
    above : ndarray, shape (H,), float64
        What each tells wherever it can be heard at all, bits.
    n_blocks : int
        How many blocks there are.

    Returns
    -------
    ndarray, shape (n_blocks,), float64
        As `homsense.audibility.heard` gives it.
    """
    found: NDArray[np.float64] = _heard(*audible, landmark, height_db, above, n_blocks)
    return found


@kept
def _heard(
    start: Array,
    block: Array,
    bits: Array,
    expected_db: Array,
    bits_per_db2: Array,
    landmark: Array,
    height_db: Array,
    above: Array,
    n_blocks: int,
) -> Array:
    found = np.zeros(n_blocks, np.float64)
    for number in range(len(landmark)):
        begin, end = start[landmark[number]], start[landmark[number] + 1]
        for at in range(np.uint64(begin), np.uint64(end)):
            off_db = height_db[number] - expected_db[at]
            told = above[number] + bits[at]
            found[np.uint64(block[at])] += told - bits_per_db2[at] * (off_db * off_db)
    return found
