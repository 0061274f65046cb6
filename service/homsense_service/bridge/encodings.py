"""Bytes of messages -> inputs. What is wrong is told by the name of its field."""

import struct
from typing import NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

import homsense
from homsense_service import schemas
from homsense_service.bridge.inputs import Deltas, FloatArray, Moving, Readings
from homsense_service.schemas.wire import Landmarks, Moment

ATTACHMENT = struct.Struct("<Q8s")
DELTA, IMU, JSON, PARTICLES = (
    "application/octet-stream;schema=delta8f4",
    "application/octet-stream;schema=imu8f4",
    "application/json",
    "application/octet-stream;schema=particles3f4",
)
MOST_IN_MESSAGE = 1000
_COLUMNS = 8
_MOST = 1e6
_BEYOND = 2**52


class Stamp(NamedTuple):
    """What goes along with every message of a device.

    Parameters
    ----------
    number : int
        Of its first input.
    token : bytes
        Eight bytes from the answer to `open`.
    """

    number: int
    token: bytes


class TimedDelta(schemas.DeltaIn):
    """A motion and how long it took."""

    dt_s: float = Field(default=0.0, ge=0, le=1e6)

    def to_delta(self) -> homsense.Delta:
        """Return the value."""
        return super().to_delta()._replace(dt_s=self.dt_s)


class MotionIn(schemas.Wire):
    """Motion as JSON."""

    deltas: list[TimedDelta] = Field(default=[], max_length=MOST_IN_MESSAGE)
    imu: list[schemas.ImuSampleIn] = Field(default=[], max_length=MOST_IN_MESSAGE)

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> Self:
        if self.deltas and self.imu:
            message = "one of deltas and imu, not both"
            raise ValueError(message)
        return self


class ScanBody(MotionIn):
    """A scan, and the motion before it."""

    landmarks: Landmarks
    t: Moment | None = None


def stamp_of(attachment: bytes | None) -> Stamp | None:
    r"""Return what goes along with a message; None when it is none.

    Examples
    --------
    >>> stamp_of(bytes(16)), stamp_of(b"short")
    (Stamp(number=0, token=b'\x00\x00\x00\x00\x00\x00\x00\x00'), None)
    """
    if attachment is None or len(attachment) != ATTACHMENT.size:
        return None
    stamp = Stamp(*ATTACHMENT.unpack(attachment))
    return stamp if stamp.number < _BEYOND else None


def motion_of(encoding: str, payload: bytes, first: int) -> Moving:
    """Return the motions of a message.

    Parameters
    ----------
    encoding : str
        As the sample says.
    payload : bytes
        Rows of eight little-endian floats, or JSON.
    first : int
        Number of the first motion.

    Returns
    -------
    Moving
        At least one.

    Raises
    ------
    ValueError
        If it is something else, or a number is out of range.
    """
    if encoding == DELTA:
        return _deltas(_rows(payload), first)
    if encoding == IMU:
        return _readings(_rows(payload), first)
    if encoding.partition(";")[0] == JSON:
        moving = motion_before(MotionIn.model_validate_json(payload), first)
        if moving is None:
            message = "payload: deltas or imu"
            raise ValueError(message)
        return moving
    message = f"encoding: {encoding!r} is none of {DELTA}, {IMU}, {JSON}"
    raise ValueError(message)


def motion_before(wire: MotionIn, first: int) -> Moving | None:
    """Return the motions of a JSON message, numbered from the first; None without any."""
    if not wire.deltas and not wire.imu:
        return None
    if wire.imu:
        return Readings(first, tuple(sample.to_sample() for sample in wire.imu))
    given = [delta.to_delta() for delta in wire.deltas]
    rows = np.array([delta[:4] for delta in given])
    stated = [c for c in map(_covariance, given) if c is not None]
    covariances = np.array(stated) if len(stated) == len(given) else None
    return Deltas(first, rows[:, :3], rows[:, 3], covariances)


def particles_of(poses: FloatArray) -> bytes:
    """Return poses as rows of little-endian floats: x m, y m, heading rad."""
    return poses.astype("<f4").tobytes()


def _rows(payload: bytes) -> FloatArray:
    size = 4 * _COLUMNS
    count, rest = divmod(len(payload), size)
    if rest or not 1 <= count <= MOST_IN_MESSAGE:
        message = f"payload: {len(payload)} bytes are not 1 to {MOST_IN_MESSAGE} rows of {size}"
        raise ValueError(message)
    return np.frombuffer(payload, "<f4").reshape(count, _COLUMNS).astype(np.float64)


def _deltas(rows: FloatArray, first: int) -> Deltas:
    """Read dt_s, forward_m, left_m, turn_rad, their deviations (NaN: unknown), and a spare."""
    durations_s, motions, deviations = rows[:, 0], rows[:, 1:4], rows[:, 4:7]
    if not (np.abs(rows[:, :4]).max() <= _MOST and durations_s.min() >= 0.0):
        message = f"rows: dt_s and motion must be finite, at most {_MOST:.0f}, dt_s not negative"
        raise ValueError(message)
    if np.isnan(deviations).any():
        return Deltas(first, motions, durations_s)
    if not (deviations.min() >= 0.0 and deviations.max() <= _MOST):
        message = f"rows: deviations must lie in [0, {_MOST:.0f}], or all be NaN"
        raise ValueError(message)
    return Deltas(first, motions, durations_s, _diagonal(deviations))


def _diagonal(deviations: FloatArray) -> FloatArray:
    covariances = np.zeros((len(deviations), 3, 3))
    covariances[:, range(3), range(3)] = np.square(deviations)
    return covariances


def _readings(rows: FloatArray, first: int) -> Readings:
    """Read dt_s, accelerations forward, left, up, turn rates about these, and a spare."""
    if not np.isfinite(rows[:, :7]).all():
        message = "rows: all but the last column must be finite"
        raise ValueError(message)
    chosen = rows[:, [0, 1, 2, 6]].tolist()
    parsed = [
        schemas.ImuSampleIn(dt_s=dt_s, forward=forward, left=left, turn=turn)
        for dt_s, forward, left, turn in chosen
    ]
    return Readings(first, tuple(sample.to_sample() for sample in parsed))


def _covariance(delta: homsense.Delta) -> FloatArray | None:
    if delta.covariance is not None:
        return np.array(delta.covariance).reshape(3, 3)
    return None if delta.std is None else np.diag(np.square(delta.std))
