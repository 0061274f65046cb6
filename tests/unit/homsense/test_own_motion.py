"""Motion from an IMU and from steps."""

import math
from inspect import unwrap
from types import ModuleType

import numpy as np
import pytest

from homsense import (
    Delta,
    FieldNoise,
    ImuSample,
    InvalidInputError,
    OdometryMotion,
    Velocity,
    imu,
    motion,
    noise,
    preintegrate,
    walked,
)


def test_a_turn_at_constant_speed_is_an_arc() -> None:
    rate, speed = math.pi / 2, 2.0
    samples = [ImuSample(0.01, 0.0, speed * rate, rate)] * 100
    delta, after = preintegrate(samples, Velocity(forward=speed))
    radius = speed / rate
    assert (delta.forward_m, delta.left_m) == pytest.approx((radius, radius), abs=0.01)
    assert delta.turn_rad == pytest.approx(math.pi / 2)
    assert (after.forward, after.left) == pytest.approx((speed, 0.0), abs=0.02)


def test_a_split_batch_is_the_same_motion() -> None:
    samples = [ImuSample(0.1, 0.3 * n, -0.2, 0.2) for n in range(10)]
    whole, end = preintegrate(samples, Velocity(1.0, 0.5))
    first, middle = preintegrate(samples[:4], Velocity(1.0, 0.5))
    second, last = preintegrate(samples[4:], middle)
    cos, sin = math.cos(first.turn_rad), math.sin(first.turn_rad)
    x = first.forward_m + cos * second.forward_m - sin * second.left_m
    y = first.left_m + sin * second.forward_m + cos * second.left_m
    assert (x, y) == pytest.approx((whole.forward_m, whole.left_m))
    assert (last.forward, last.left) == pytest.approx((end.forward, end.left))


def test_a_device_that_stops_has_no_velocity_and_one_that_glides_has() -> None:
    quiet = [ImuSample(0.1, 0.01, -0.02, 0.001)] * 5
    delta, after = preintegrate(quiet, Velocity(0.2, 0.0, variance=1.0))
    assert (delta.length_m, after) == (0.0, Velocity())
    gliding, after = preintegrate(quiet, Velocity(3.0))
    assert gliding.forward_m == pytest.approx(1.5, abs=0.01)
    assert after.forward == pytest.approx(3.0, abs=0.01)


def test_uncertainty_of_the_velocity_grows_until_the_device_stops() -> None:
    push = [ImuSample(0.1, 2.0, 0.0, 0.1)] * 10
    delta, after = preintegrate(push, Velocity())
    later, latest = preintegrate(push, after)
    assert later.covariance
    assert delta.covariance
    assert later.covariance[0] > delta.covariance[0] > 0.0
    assert latest.variance > after.variance > 0.0


@pytest.mark.parametrize(
    "samples",
    [
        [],
        [ImuSample(0.0, 0.0, 0.0, 0.0)],
        [ImuSample(math.nan, 0.0, 0.0, 0.0)],
        [ImuSample(0.1, math.inf, 0.0, 0.0)],
        [ImuSample(0.1, 0.0, 0.0, 1e9)],
    ],
)
def test_readings_that_make_no_sense_are_refused(samples: list[ImuSample]) -> None:
    with pytest.raises(InvalidInputError, match="sample"):
        preintegrate(samples, Velocity())


def test_steps_follow_their_headings() -> None:
    first = walked(0.7, 3.0, before_rad=None)
    assert first.forward_m == pytest.approx(0.7)
    assert first.turn_rad == 0.0
    back = walked(1.0, 3.0 + math.pi, before_rad=3.0)
    assert back.forward_m == pytest.approx(-1.0)
    assert abs(back.turn_rad) == pytest.approx(math.pi)
    for length, heading in ((-1.0, 0.0), (math.nan, 0.0), (1.0, math.inf), (1.0, 1e308)):
        with pytest.raises(InvalidInputError, match="step"):
            walked(length, heading, None)
    for before_rad in (-1e308, math.nan):
        with pytest.raises(InvalidInputError, match="step"):
            walked(1.0, 0.0, before_rad)


@pytest.mark.parametrize("module", [imu, motion, noise])
def test_no_version_of_python_adds_up_otherwise(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From 3.12 on `sum` makes up for what it rounds off."""
    monkeypatch.setattr(noise, "_root", unwrap(vars(noise)["_root"]))

    def reckoned() -> list[object]:
        found: list[object] = []
        rng = np.random.Generator(np.random.Philox(key=5))
        for a, b, c in rng.uniform(0.05, 0.3, (200, 3)).tolist():
            still = [ImuSample(dt, 0.0, 0.0, 0.0) for dt in (a, b, c)]
            related = tuple(
                tuple(1.0 if i == j else 0.6 * (a, b, c)[(i + j) % 3] for j in range(6))
                for i in range(6)
            )
            weigher = FieldNoise(related, (1.0,) * 6, (0.0,) * 6, 20.0, 80.0).weigher
            found += [
                OdometryMotion(a, b, c, a, b, c).deviations(Delta(a, b, c, a)),
                preintegrate(still, Velocity()),
                weigher(np.ones((1, 12)))((99.0 * a, 99.0 * b, 99.0 * c) * 2).tobytes(),
            ]
        return found

    here = reckoned()
    monkeypatch.setattr(module, "sum", math.fsum, raising=False)
    assert reckoned() == here
