"""Messages of a robot -> inputs of its session. Time comes from the messages alone."""

import json
import math
from typing import Any

import numpy as np

import homsense
from homsense_service.bridge.encodings import ScanBody
from homsense_service.bridge.inputs import Deltas, Readings
from homsense_service.ros2 import cdr

LONGEST_PAUSE_S = 1.0
_KNOWN = 1e3
_STRONGEST_DBM, _WEAKEST_DBM = 20.0, -150.0


class Reckoning:
    """What a robot has said last, to find out what has changed.

    Parameters
    ----------
    max_speed_mps : float
        Odometry that says more has jumped, and is left out.
    """

    def __init__(self, max_speed_mps: float) -> None:
        self._max_speed_mps = max_speed_mps
        self._odometry: cdr.Odometry | None = None
        self._imu_t: float | None = None
        self._turned_rad: float | None = None
        self.t: float | None = None

    def by_odometry(self, now: cdr.Odometry, number: int) -> Deltas | None:
        """Return the motion since the odometry before; None for the first, and after a jump."""
        before, self._odometry = self._odometry, now
        turned, self._turned_rad = self._turned_rad, None
        self.t = now.t
        if before is None or now.frame != before.frame:
            return None
        dt_s = now.t - before.t
        east, north = now.x_m - before.x_m, now.y_m - before.y_m
        if not dt_s > 0.0 or math.hypot(east, north) > self._max_speed_mps * dt_s:
            return None
        cosine, sine = math.cos(before.yaw_rad), math.sin(before.yaw_rad)
        turn = math.remainder(now.yaw_rad - before.yaw_rad, math.tau)
        motion = (
            cosine * east + sine * north,
            cosine * north - sine * east,
            turn if turned is None else turned,
        )
        variances = now.twist_variances
        stated = None
        if all(0.0 < variance < _KNOWN for variance in variances):
            stated = np.diag(np.array(variances) * dt_s**2)[np.newaxis]
        return Deltas(number, np.array([motion]), np.array([dt_s]), stated)

    def by_gyroscope(self, now: cdr.Imu) -> None:
        """Let the turn of the next odometry be that of the gyroscope."""
        dt_s = self._pause_s(now)
        if dt_s is not None:
            self._turned_rad = (self._turned_rad or 0.0) + now.rate[2] * dt_s

    def by_imu(self, now: cdr.Imu, number: int) -> Readings | None:
        """Return a reading of a level IMU; None for the first, and after a pause."""
        dt_s = self._pause_s(now)
        self.t = now.t
        if dt_s is None:
            return None
        sample = homsense.ImuSample(dt_s, now.acceleration[0], now.acceleration[1], now.rate[2])
        return Readings(number, (sample,))

    def _pause_s(self, now: cdr.Imu) -> float | None:
        before, self._imu_t = self._imu_t, now.t
        if before is None or not 0.0 < now.t - before <= LONGEST_PAUSE_S:
            return None
        return now.t - before


def scan_of_diagnostics(payload: bytes) -> ScanBody:
    """Return the landmarks of key-value pairs: identifier and signal strength in dBm."""
    _, pairs = cdr.diagnostics(payload)
    landmarks: list[dict[str, Any]] = []
    for identifier, value in pairs.items():
        try:
            rssi = float(value)
        except ValueError:
            continue
        if _WEAKEST_DBM <= rssi <= _STRONGEST_DBM:
            landmarks.append({"id": identifier, "rssi": rssi})
    return ScanBody.model_validate({"landmarks": landmarks})


def scan_of_json(payload: bytes) -> ScanBody:
    """Return the landmarks of a JSON text: a list, or an object with ``landmarks``."""
    given = json.loads(cdr.text(payload))
    return ScanBody.model_validate({"landmarks": given} if isinstance(given, list) else given)
