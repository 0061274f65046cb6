"""What resembled scans tell about the blocks near them, compiled; see `homsense.resemblance`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from homsense.compiled.jit import kept
from homsense.resemblance import Nearby

Array = NDArray[Any]


def told(nearby: Nearby, scan: Array, level: Array, n_blocks: int) -> NDArray[np.float64]:
    """Return what some scans tell about each block.

    Parameters
    ----------
    nearby : Nearby
        Where they count.
    scan : ndarray, shape (S,), int64
        Which scans.
    level : ndarray, shape (S,), int32
        How alike each is.
    n_blocks : int
        How many blocks there are.

    Returns
    -------
    ndarray, shape (n_blocks,), float64
        As `homsense.resemblance.told` gives it.
    """
    found: NDArray[np.float64] = _told(*nearby, scan, level, n_blocks)
    return found


@kept
def _told(
    start: Array,
    block: Array,
    kernel: Array,
    row: Array,
    gain: Array,
    scan: Array,
    level: Array,
    n_blocks: int,
) -> Array:
    found = np.zeros(n_blocks, np.float64)
    for number in range(len(scan)):
        begin, end = start[scan[number]], start[scan[number] + 1]
        column = np.int64(level[number])
        for entry in range(np.uint64(begin), np.uint64(end)):
            found[np.uint64(block[entry])] += gain[np.uint64(row[entry] + column)] * kernel[entry]
    return found
