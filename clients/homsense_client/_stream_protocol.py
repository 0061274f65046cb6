"""The streaming contract as bytes: keys, stamps, rows. No I/O."""

import json
import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

JSON = "application/json"
DELTA = "application/octet-stream;schema=delta8f4"
IMU = "application/octet-stream;schema=imu8f4"
_STAMP = struct.Struct("<Q8s")
_POSE = struct.Struct("<3f")
_UNKNOWN = (math.nan,) * 3


def key(prefix: str, device: str, what: str) -> str:
    """Return the key of a stream or request of a device.

    Examples
    --------
    >>> key("homsense", "r1", "rpc/open")
    'homsense/@v1/dev/r1/rpc/open'
    """
    return f"{prefix}/@v1/dev/{device}/{what}"


def alive(prefix: str, device: str) -> str:
    """Return the key of the liveliness token of a device."""
    return f"{prefix}/@v1/alive/{device}"


def stamp(number: int, token: bytes) -> bytes:
    r"""Return what goes along with a message: the number of its first input, and the token.

    Examples
    --------
    >>> stamp(1, b"12345678")
    b'\x01\x00\x00\x00\x00\x00\x00\x0012345678'
    """
    return _STAMP.pack(number, token)


def delta_rows(deltas: Sequence[Mapping[str, Any]]) -> bytes:
    """Return motions as rows of eight little-endian floats."""
    return b"".join(
        struct.pack(
            "<8f",
            delta.get("dt_s", 0.0),
            delta.get("forward_m", 0.0),
            delta.get("left_m", 0.0),
            delta.get("turn_rad", 0.0),
            *(delta.get("std") or _UNKNOWN),
            0.0,
        )
        for delta in deltas
    )


def imu_rows(samples: Sequence[Mapping[str, float]]) -> bytes:
    """Return readings of an IMU as rows of eight little-endian floats."""
    return b"".join(
        struct.pack("<8f", s["dt_s"], s["forward"], s["left"], 0.0, 0.0, 0.0, s["turn"], 0.0)
        for s in samples
    )


def motion_json(kind: str, motions: Sequence[Mapping[str, Any]]) -> bytes:
    """Return motions as JSON, every bit of them."""
    return json.dumps({kind: list(motions)}).encode()


def particles(payload: bytes) -> list[tuple[float, float, float]]:
    """Return particles: x m, y m, heading rad."""
    return [(x, y, heading) for x, y, heading in _POSE.iter_unpack(payload)]
