"""The particles of a session, as the filter keeps them."""

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Integers = NDArray[np.int32]


class Particles(NamedTuple):
    """Pose hypotheses with weights.

    Parameters
    ----------
    x_m, y_m : ndarray, shape (N,), float32
        Positions, metres in the site frame.
    turns : ndarray, shape (N,), float32
        Headings in turns, in [-1/2, 1/2).
    log_weight : ndarray, shape (N,), int32
        Binary logarithm of the weight, in 1/2048.
    """

    x_m: Singles
    y_m: Singles
    turns: Singles
    log_weight: Integers

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.x_m)

    @property
    def poses(self) -> NDArray[np.float64]:
        """Poses, shape (N, 3): x m, y m, heading rad."""
        return np.stack([self.x_m, self.y_m, self.turns * (2.0 * np.pi)], axis=1, dtype=np.float64)

    def digest(self) -> str:
        """Return a hash of all bits.

        Returns
        -------
        str
            16 hexadecimal digits.
        """
        digest = hashlib.sha256()
        for array in self:
            digest.update(array.tobytes())
        return digest.hexdigest()[:16]


_NOTHING = np.zeros(0, np.float32)
NOBODY = Particles(_NOTHING, _NOTHING, _NOTHING, np.zeros(0, np.int32))


def joined(parts: Sequence[Particles]) -> Particles:
    """Return particles as one set, in order.

    Parameters
    ----------
    parts : sequence of Particles
        At least one.

    Returns
    -------
    Particles
        All of them.
    """
    x, y, turns, log_weight = zip(*parts, strict=True)
    return Particles(
        np.concatenate(x), np.concatenate(y), np.concatenate(turns), np.concatenate(log_weight)
    )
