"""Many small motions as one: a device that moves at 100 Hz need not be filtered at 100 Hz."""

import numpy as np
from numpy.typing import NDArray

from homsense.errors import InvalidInputError
from homsense.pose import Delta

FloatArray = NDArray[np.float64]
_ONE = 1


def composed(
    motions: FloatArray, durations_s: FloatArray, covariances: FloatArray | None = None
) -> Delta:
    """Compose motions that follow one another into one, with its covariance (to first order).

    Parameters
    ----------
    motions : ndarray, shape (n, 3)
        Forward (m), left (m) and turn (rad), each in the body frame at its start; at least one.
    durations_s : ndarray, shape (n,)
        Seconds.
    covariances : ndarray, shape (n, 3, 3), optional
        Of each motion; errors of different motions are independent.

    Returns
    -------
    Delta
        In the body frame at the start of the first; a single motion without covariance is
        returned bit for bit.

    Raises
    ------
    InvalidInputError
        If there is no motion.

    Examples
    --------
    >>> corner = np.array([[1.0, 0.0, np.pi / 2], [1.0, 0.0, 0.0]])
    >>> both = composed(corner, np.array([0.5, 0.5]))
    >>> round(both.forward_m, 9), round(both.left_m, 9), both.dt_s
    (1.0, 1.0, 1.0)
    """
    count = len(motions)
    if count == 0:
        message = "a motion is composed of at least one"
        raise InvalidInputError(message, "motions")
    if count == _ONE:
        forward, left, turn = motions[0].tolist()
        stated = None if covariances is None else _rows(covariances[0])
        return Delta(forward, left, turn, float(durations_s[0]), covariance=stated)
    turned = np.cumsum(motions[:, 2])
    before = np.concatenate([[0.0], turned[:-1]])
    right, up = np.cos(before), np.sin(before)
    east = np.cumsum(right * motions[:, 0] - up * motions[:, 1])
    north = np.cumsum(up * motions[:, 0] + right * motions[:, 1])
    total = None
    if covariances is not None:
        lever = np.zeros((count, 3, 3))
        lever[:, 0, 0], lever[:, 0, 1], lever[:, 0, 2] = right, -up, north - north[-1]
        lever[:, 1, 0], lever[:, 1, 1], lever[:, 1, 2] = up, right, east[-1] - east
        lever[:, 2, 2] = 1.0
        total = _rows(np.einsum("nij,njk,nlk->il", lever, covariances, lever))
    return Delta(
        float(east[-1]),
        float(north[-1]),
        float(turned[-1]),
        float(durations_s.sum()),
        covariance=total,
    )


def _rows(covariance: FloatArray) -> tuple[float, ...]:
    symmetric = (covariance + covariance.T) / 2.0
    return tuple(symmetric.ravel().tolist())
