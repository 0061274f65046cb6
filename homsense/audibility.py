"""What the landmarks that a scan hears tell about the blocks of a map where each can be heard.

The hot loop of the radio map; `homsense.compiled.audibility` repeats it operation by operation,
and the results have the same bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.ragged import spread

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Singles = NDArray[np.float32]


class Audible(NamedTuple):
    """Where landmarks can be heard; an entry for each landmark and each block where it can.

    Parameters
    ----------
    start : ndarray, shape (L + 1,), int64
        Where the entries of each landmark begin.
    block : ndarray, shape (E,), int32
        The block, below B.
    bits : ndarray, shape (E,), float32
        What it tells that the landmark is heard there, at the height expected, bits.
    height_db : ndarray, shape (E,), float32
        How loud it is expected to be, dB.
    bits_per_db2 : ndarray, shape (E,), float32
        What a deviation from that costs, bits by its square.
    """

    start: IntArray
    block: NDArray[np.int32]
    bits: Singles
    height_db: Singles
    bits_per_db2: Singles


def heard(
    audible: Audible, landmark: IntArray, height_db: FloatArray, above: FloatArray, n_blocks: int
) -> FloatArray:
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
        B.

    Returns
    -------
    ndarray, shape (B,), float64
        Sums over the entries of the landmarks, in their order, bits.

    Examples
    --------
    >>> louder = np.array([20.0, 20.0, 10.0], np.float32)
    >>> one = np.ones(3, np.float32)
    >>> near = Audible(np.array([0, 2, 3]), np.array([0, 1, 1], np.int32), 3 * one, louder, one)
    >>> heard(near, np.array([0, 1]), np.array([20.0, 12.0]), np.zeros(2), 3).tolist()
    [3.0, 2.0, 0.0]
    """
    size = audible.start[landmark + 1] - audible.start[landmark]
    _, entry = spread(audible.start[landmark], size)
    off_db = np.repeat(height_db, size) - audible.height_db.take(entry)
    told = np.repeat(above, size) + audible.bits.take(entry)
    told -= audible.bits_per_db2.take(entry) * (off_db * off_db)
    return np.asarray(np.bincount(audible.block.take(entry), told, n_blocks))
