"""The few messages that robots send and read, as CDR bytes (OMG DDS-XTypes, plain CDR)."""

import math
import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_LITTLE = b"\x00\x01\x00\x00"
_ORDERS = {0: ">", 1: "<"}
_HEAD = 4
_NS = 1_000_000_000


class CdrError(ValueError):
    """The bytes are not the message that they should be."""


class Imu(NamedTuple):
    """What counts of a `sensor_msgs/Imu`: seconds, m/s^2 and rad/s in its own frame."""

    t: float
    frame: str
    acceleration: tuple[float, float, float]
    rate: tuple[float, float, float]


class Odometry(NamedTuple):
    """What counts of a `nav_msgs/Odometry`: the pose in its frame, and variances of the twist."""

    t: float
    frame: str
    x_m: float
    y_m: float
    yaw_rad: float
    twist_variances: tuple[float, float, float]


def imu(payload: bytes) -> Imu:
    """Read a `sensor_msgs/Imu`."""
    reader = _Reader(payload)
    t, frame = reader.header()
    numbers = reader.doubles(4 + 9 + 3 + 9 + 3 + 9)
    return Imu(t, frame, _finite(numbers[25:28]), _finite(numbers[13:16]))


def odometry(payload: bytes) -> Odometry:
    """Read a `nav_msgs/Odometry`."""
    reader = _Reader(payload)
    t, frame = reader.header()
    reader.string()
    numbers = reader.doubles(3 + 4 + 36 + 6 + 36)
    x, y, qx = _finite((*numbers[:2], numbers[3]))
    qy, qz, qw = _finite(numbers[4:7])
    yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    twist = numbers[49:]
    return Odometry(t, frame, x, y, yaw, (twist[0], twist[7], twist[35]))


def text(payload: bytes) -> str:
    """Read a `std_msgs/String`."""
    return _Reader(payload).string()


def diagnostics(payload: bytes) -> tuple[float, dict[str, str]]:
    """Read the time and all key-value pairs of a `diagnostic_msgs/DiagnosticArray`."""
    reader = _Reader(payload)
    t, _ = reader.header()
    pairs: dict[str, str] = {}
    for _ in range(reader.count()):
        reader.skip(1)
        for _ in range(3):
            reader.string()
        for _ in range(reader.count()):
            key = reader.string()
            pairs[key] = reader.string()
    return t, pairs


def pose_with_covariance(
    t: float, frame: str, pose: tuple[float, float, float], covariance: FloatArray
) -> bytes:
    """Write a `geometry_msgs/PoseWithCovarianceStamped`.

    Parameters
    ----------
    t : float
        Seconds.
    frame : str
        Of the map.
    pose : tuple of float
        (x m, y m, yaw rad).
    covariance : ndarray, shape (3, 3)
        Of the three.

    Returns
    -------
    bytes
        Little endian.
    """
    full = np.zeros((6, 6))
    axes = (0, 1, 5)
    full[np.ix_(axes, axes)] = covariance
    x, y, yaw = pose
    numbers = np.array([x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)])
    return _header(t, frame) + np.concatenate([numbers, full.ravel()]).astype("<f8").tobytes()


def pose_array(t: float, frame: str, poses: FloatArray) -> bytes:
    """Write a `geometry_msgs/PoseArray` of poses (x m, y m, yaw rad), shape (n, 3)."""
    rows = np.zeros((len(poses), 7), "<f8")
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)
    counted = _header(t, frame, aligned=4) + struct.pack("<I", len(poses))
    return _padded(counted, 8) + rows.tobytes() if len(poses) else counted


def _header(t: float, frame: str, aligned: int = 8) -> bytes:
    whole = math.floor(t)
    name = frame.encode() + b"\0"
    head = struct.pack("<iII", whole, min(round((t - whole) * _NS), _NS - 1), len(name))
    return _padded(_LITTLE + head + name, aligned)


def _padded(written: bytes, aligned: int) -> bytes:
    return written + bytes(-(len(written) - _HEAD) % aligned)


def _finite(numbers: tuple[float, ...]) -> tuple[float, float, float]:
    if not all(map(math.isfinite, numbers)):
        message = f"numbers must be finite, not {numbers}"
        raise CdrError(message)
    x, y, z = numbers
    return x, y, z


class _Reader:
    """Reads one message from its start."""

    def __init__(self, payload: bytes) -> None:
        if len(payload) < _HEAD or payload[0] != 0 or payload[1] not in _ORDERS:
            message = "the payload does not begin like plain CDR"
            raise CdrError(message)
        self._bytes, self._at, self._order = payload, _HEAD, _ORDERS[payload[1]]

    def header(self) -> tuple[float, str]:
        """Read a `std_msgs/Header`: seconds and frame."""
        seconds, nanoseconds = self._unpack("iI", 4)
        return seconds + nanoseconds / _NS, self.string()

    def count(self) -> int:
        """Read the length of a sequence."""
        (found,) = self._unpack("I", 4)
        if found > len(self._bytes):
            message = f"a sequence of {found} in {len(self._bytes)} bytes"
            raise CdrError(message)
        return int(found)

    def string(self) -> str:
        """Read a string."""
        size = self.count()
        found = self._bytes[self._at : self._at + size]
        self._at += size
        if len(found) != size or not found.endswith(b"\0"):
            message = "a string has no end"
            raise CdrError(message)
        try:
            return found[:-1].decode()
        except UnicodeDecodeError as error:
            message = "a string is not UTF-8"
            raise CdrError(message) from error

    def doubles(self, count: int) -> tuple[float, ...]:
        """Read some doubles."""
        return self._unpack(f"{count}d", 8)

    def skip(self, count: int) -> None:
        """Leave out some bytes."""
        self._at += count

    def _unpack(self, form: str, aligned: int) -> tuple[float, ...]:
        self._at += -(self._at - _HEAD) % aligned
        try:
            found = struct.unpack_from(self._order + form, self._bytes, self._at)
        except struct.error as error:
            message = f"the message ends after {len(self._bytes)} bytes"
            raise CdrError(message) from error
        self._at += struct.calcsize(self._order + form)
        return found
