"""Lists of different lengths, laid one after the other."""

import numpy as np
from numpy.typing import NDArray

Offsets = NDArray[np.int64]


def spread(starts: Offsets, lengths: Offsets) -> tuple[Offsets, Offsets]:
    """Return where lists end when they are laid one after the other, and what they are made of.

    Parameters
    ----------
    starts : ndarray, shape (N,), int64
        Where each list begins in a table.
    lengths : ndarray, shape (N,), int64
        How long each is.

    Returns
    -------
    ends : ndarray, shape (N + 1,), int64
        Where each list begins among the laid ones, and where the last one ends.
    places : ndarray, int64
        Where each entry comes from in the table.

    Examples
    --------
    >>> ends, places = spread(np.array([5, 0]), np.array([2, 3]))
    >>> ends.tolist(), places.tolist()
    ([0, 2, 5], [5, 6, 0, 1, 2])
    """
    ends = np.zeros(len(starts) + 1, np.int64)
    np.cumsum(lengths, out=ends[1:])
    places = np.repeat(starts - ends[:-1], lengths)
    places += np.arange(ends[-1])
    return ends, places
