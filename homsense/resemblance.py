"""What scans that a new one resembles tell about the blocks of a map near them.

The hot loop of the registered sensor; `homsense.compiled.resemblance` repeats it operation by
operation, and the results have the same bits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from homsense.ragged import spread

FloatArray = NDArray[np.float64]
Integers = NDArray[np.int32]
IntArray = NDArray[np.int64]


class Nearby(NamedTuple):
    """Which blocks lie near which scans; an entry for each scan and each block near it.

    Parameters
    ----------
    start : ndarray, shape (N + 1,), int64
        Where the entries of each scan begin.
    block : ndarray, shape (E,), intp
        The block, below B.
    kernel : ndarray, shape (E,), float64
        How much the scan counts there.
    row : ndarray, shape (E,), int32
        Where the levels of its distance begin in `gain`.
    gain : ndarray, shape (rings * levels,), float64
        What a similarity tells above none, nats.
    """

    start: IntArray
    block: NDArray[np.intp]
    kernel: FloatArray
    row: Integers
    gain: FloatArray


def told(nearby: Nearby, scan: IntArray, level: Integers, n_blocks: int) -> FloatArray:
    """Return what some scans tell about each block.

    Parameters
    ----------
    nearby : Nearby
        Where they count.
    scan : ndarray, shape (S,), int64
        Which scans.
    level : ndarray, shape (S,), int32
        How alike each is, below the number of levels.
    n_blocks : int
        B.

    Returns
    -------
    ndarray, shape (B,), float64
        Sums of gain times kernel over the entries of the scans, in their order, nats.

    Examples
    --------
    >>> near = Nearby(
    ...     np.array([0, 2, 3]),
    ...     np.array([0, 1, 1]),
    ...     np.array([1.0, 0.5, 1.0]),
    ...     np.array([0, 0, 2], np.int32),
    ...     np.array([0.0, 4.0, 0.0, 3.0]),
    ... )
    >>> told(near, np.array([0, 1]), np.array([1, 1], np.int32), 3).tolist()
    [4.0, 5.0, 0.0]
    """
    size = nearby.start[scan + 1] - nearby.start[scan]
    _, entry = spread(nearby.start[scan], size)
    at = nearby.row.take(entry)
    at += np.repeat(level, size)
    gain = nearby.gain.take(at)
    gain *= nearby.kernel.take(entry)
    return np.asarray(np.bincount(nearby.block.take(entry), gain, n_blocks))
