"""From accelerations and turn rates to a motion: preintegration in the plane.

The body frame is level: x forward, y to the left, z up. Gravity along z does not matter; a device
that is not level has to be levelled first.
"""

from collections.abc import Sequence
from typing import NamedTuple

from homsense.errors import InvalidInputError
from homsense.pose import Delta
from homsense.scalar import TURN, cosine, sine

MAX_ACCELERATION, MAX_RATE, MAX_PAUSE_S = 1000.0, 1000.0, 10.0


class ImuSample(NamedTuple):
    """One reading of an accelerometer and a gyroscope.

    Parameters
    ----------
    dt_s : float
        How long it holds, seconds, in (0, 10].
    forward, left : float
        Acceleration along the body's axes, metres per square second.
    turn : float
        Turn rate, radians per second counter-clockwise.
    """

    dt_s: float
    forward: float
    left: float
    turn: float


class ImuNoise(NamedTuple):
    """White noise of the sensors, and when a device counts as standing.

    Parameters
    ----------
    acceleration : float, default 0.1
        Metres per second to the power of 1.5.
    turn_rate : float, default 0.01
        Radians per square root of a second.
    still_acceleration, still_rate : float, default 0.15 and 0.03
        Bounds of the readings of a device that stands.
    still_speed : float, default 0.5
        A device that was slower and keeps within these bounds has stopped, metres per second.
    """

    acceleration: float = 0.1
    turn_rate: float = 0.01
    still_acceleration: float = 0.15
    still_rate: float = 0.03
    still_speed: float = 0.5


class Velocity(NamedTuple):
    """What one batch leaves to the next.

    Parameters
    ----------
    forward, left : float
        Metres per second, in the body frame at the end of the batch.
    variance : float
        Of each of the two.
    """

    forward: float = 0.0
    left: float = 0.0
    variance: float = 0.0


_USUAL = ImuNoise()


def preintegrate(
    samples: Sequence[ImuSample], before: Velocity, noise: ImuNoise = _USUAL
) -> tuple[Delta, Velocity]:
    """Integrate a batch of readings into one motion with its covariance.

    Parameters
    ----------
    samples : sequence of ImuSample
        In order of time, at least one.
    before : Velocity
        At the start of the batch.
    noise : ImuNoise, optional
        Of the sensors.

    Returns
    -------
    delta : Delta
        In the body frame at the start, with a covariance.
    after : Velocity
        In the body frame at the end; none when the device stood still.

    Raises
    ------
    InvalidInputError
        If there is no sample or a number is out of range.

    Examples
    --------
    >>> push = [ImuSample(0.5, 2.0, 0.0, 0.0)] * 2
    >>> delta, after = preintegrate(push, Velocity())
    >>> round(delta.forward_m, 9), round(after.forward, 9)
    (1.0, 2.0)
    """
    if not samples:
        message = "a batch has at least one sample"
        raise InvalidInputError(message, "imu")
    duration = 0.0
    for sample in samples:
        _check(sample)
        duration += sample.dt_s
    slow = _square(before.forward) + _square(before.left) < _square(noise.still_speed)
    if slow and all(_is_still(sample, noise) for sample in samples):
        return Delta(dt_s=duration, covariance=(0.0,) * 9), Velocity()
    x = y = turned = 0.0
    vx, vy = before.forward, before.left
    for dt, forward, left, rate in samples:
        right, up = _direction(turned + 0.5 * rate * dt)
        ax, ay = right * forward - up * left, up * forward + right * left
        x, y = x + (vx + 0.5 * ax * dt) * dt, y + (vy + 0.5 * ay * dt) * dt
        vx, vy = vx + ax * dt, vy + ay * dt
        turned += rate * dt
    shaken = _square(noise.acceleration) * duration
    spread = (before.variance + shaken / 3.0) * _square(duration)
    turning = _square(noise.turn_rate) * duration
    covariance = (spread, 0.0, 0.0, 0.0, spread, 0.0, 0.0, 0.0, turning)
    right, up = _direction(turned)
    after = Velocity(
        right * vx + up * vy,
        right * vy - up * vx,
        before.variance + shaken,
    )
    return Delta(x, y, turned, duration, covariance=covariance), after


def _check(sample: ImuSample) -> None:
    sound = 0.0 < sample.dt_s <= MAX_PAUSE_S and abs(sample.turn) <= MAX_RATE
    if not (sound and max(abs(sample.forward), abs(sample.left)) <= MAX_ACCELERATION):
        message = f"an IMU sample is out of range: {sample}"
        raise InvalidInputError(message, "imu")


def _is_still(sample: ImuSample, noise: ImuNoise) -> bool:
    fast = max(abs(sample.forward), abs(sample.left)) >= noise.still_acceleration
    return not fast and abs(sample.turn) < noise.still_rate


def _square(number: float) -> float:
    return number * number


def _direction(turned: float) -> tuple[float, float]:
    turns = turned / TURN
    return cosine(turns), sine(turns)
