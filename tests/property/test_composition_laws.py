"""Laws of composing motions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from homsense import Delta, InvalidInputError, Travel, composed

FloatArray = NDArray[np.float64]
SMALL = st.floats(-2.0, 2.0)
MOTION = st.tuples(SMALL, SMALL, SMALL)
MOTIONS = st.lists(MOTION, min_size=2, max_size=12)


def _durations(count: int) -> FloatArray:
    return np.full(count, 0.01)


def _covariances(motions: list[tuple[float, float, float]]) -> FloatArray:
    roots = np.array([np.diag(motion) + 0.1 * np.outer(motion, motion) for motion in motions])
    return np.asarray(roots @ roots.transpose(0, 2, 1))


@given(MOTIONS)
def test_the_whole_is_the_way_step_by_step(motions: list[tuple[float, float, float]]) -> None:
    whole = composed(np.array(motions), _durations(len(motions)))
    way = Travel(credit_m=0.0)
    for motion in motions:
        way = way.onward(Delta(*motion))
    assert (whole.forward_m, whole.left_m) == pytest.approx((way.forward_m, way.left_m), abs=1e-9)
    assert math.cos(whole.turn_rad) == pytest.approx(math.cos(way.turns * math.tau), abs=1e-9)
    assert whole.dt_s == pytest.approx(0.01 * len(motions))


@given(MOTIONS, st.integers(1, 11))
def test_it_does_not_matter_where_a_way_is_split(
    motions: list[tuple[float, float, float]], where: int
) -> None:
    cut = min(where, len(motions) - 1)
    covariances = _covariances(motions)
    whole = composed(np.array(motions), _durations(len(motions)), covariances)
    parts = [
        composed(np.array(motions[part]), _durations(len(motions[part])), covariances[part])
        for part in (slice(cut), slice(cut, None))
    ]
    joined = composed(
        np.array([part[:3] for part in parts]),
        np.array([part.dt_s for part in parts]),
        np.array([part.covariance for part in parts]).reshape(2, 3, 3),
    )
    assert joined[:4] == pytest.approx(whole[:4], abs=1e-9)
    assert joined.covariance == pytest.approx(whole.covariance, abs=1e-6)
    whole.checked()


@given(MOTION)
def test_a_single_motion_keeps_every_bit(motion: tuple[float, float, float]) -> None:
    assert composed(np.array([motion]), np.array([0.1])) == Delta(*motion, 0.1)


def test_the_covariance_is_that_of_many_runs() -> None:
    rng = np.random.default_rng(1)
    motions = np.array([[0.5, 0.1, 0.2]] * 8)
    covariance = np.diag([0.02, 0.01, 0.03]) ** 2
    stated = composed(motions, _durations(8), np.array([covariance] * 8)).covariance
    noise = rng.multivariate_normal(np.zeros(3), covariance, (20_000, 8))
    ends = np.array([composed(motions + wrong, _durations(8))[:3] for wrong in noise])
    assert np.cov(ends.T).ravel() == pytest.approx(stated, abs=6e-4)


def test_no_motion_is_an_error() -> None:
    with pytest.raises(InvalidInputError, match="at least one"):
        composed(np.zeros((0, 3)), np.zeros(0))
