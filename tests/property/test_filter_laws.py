"""Laws of poses, weights and the pose distribution."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.strategies import FINITE

from homsense import Delta, PoseDistribution
from homsense.estimate import persistent_labels
from homsense.pose import compose, wrap_angle
from homsense.resample import effective_sample_size, normalize, systematic

WEIGHTS = arrays(np.float64, st.integers(1, 40), elements=st.floats(-50.0, 0.0)).map(normalize)
ANGLES = arrays(np.float64, 8, elements=FINITE)
SEEDS = st.integers(0, 2**32)


def _rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=seed))


@given(ANGLES)
def test_wrapping_keeps_the_direction(angles: np.ndarray) -> None:
    wrapped = wrap_angle(angles)
    assert ((wrapped > -math.pi) & (wrapped <= math.pi)).all()
    assert np.allclose(np.exp(1j * wrapped), np.exp(1j * angles))


@given(arrays(np.float64, (5, 3), elements=FINITE), arrays(np.float64, (5, 3), elements=FINITE))
def test_a_turn_of_the_heading_turns_the_motion(poses: np.ndarray, moves: np.ndarray) -> None:
    moved = compose(poses, moves)
    assert np.allclose(
        np.linalg.norm(moved[:, :2] - poses[:, :2], axis=1), np.linalg.norm(moves[:, :2], axis=1)
    )
    again = compose(poses + np.array([0.0, 0.0, 2 * math.pi]), moves)
    assert np.allclose(again[:, :2], moved[:, :2])


@given(arrays(np.float64, 20, elements=st.floats(-700.0, 0.0)), FINITE)
def test_adding_a_constant_to_log_weights_changes_nothing(
    log_weights: np.ndarray, constant: float
) -> None:
    assert np.allclose(normalize(log_weights), normalize(log_weights + constant))


@given(WEIGHTS)
def test_the_effective_sample_size_lies_between_one_and_all(weights: np.ndarray) -> None:
    assert 1.0 - 1e-9 <= effective_sample_size(weights) <= len(weights) + 1e-9


@given(WEIGHTS, SEEDS)
def test_systematic_resampling_draws_each_as_often_as_its_weight_says(
    weights: np.ndarray, seed: int
) -> None:
    drawn = systematic(weights, _rng(seed))
    times = np.bincount(drawn, minlength=len(weights))
    due = len(weights) * weights
    assert len(drawn) == len(weights)
    assert (times >= np.floor(due - 1e-9)).all()
    assert (times <= np.ceil(due + 1e-9)).all()


def test_mean_offspring_is_the_weight() -> None:
    weights = np.array([0.55, 0.25, 0.12, 0.08])
    rng = _rng(1)
    times = [np.bincount(systematic(weights, rng), minlength=4) for _ in range(20_000)]
    assert np.mean(times, axis=0) == pytest.approx(4 * weights, abs=0.02)


@given(arrays(np.float64, (9, 11), elements=st.sampled_from([0.0, 1.0, 2.0, 5.0, 9.0])))
def test_every_cell_with_mass_belongs_to_a_peak(density: np.ndarray) -> None:
    labels = persistent_labels(density)
    peaks = np.unique(labels[density > 0])
    for peak in peaks:
        assert density.ravel()[peak] == density[labels == peak].max()


@given(
    arrays(np.float64, (60, 2), elements=st.floats(-200.0, 200.0)),
    arrays(np.float64, 60, elements=st.floats(-10.0, 0.0)),
)
def test_modes_share_the_whole_mass(places: np.ndarray, log_weights: np.ndarray) -> None:
    poses = np.column_stack([places, np.zeros(60)])
    pose = PoseDistribution(poses, normalize(log_weights))
    assert sum(mode.weight for mode in pose.modes) == pytest.approx(1.0)
    assert [mode.weight for mode in pose.modes] == sorted(
        (mode.weight for mode in pose.modes), reverse=True
    )
    for mode in pose.modes:
        assert np.linalg.eigvalsh(mode.covariance).min() >= -1e-6
        assert mode.accuracy_m >= 0.0
    areas = [pose.region_area_m2(level) for level in (0.5, 0.9, 0.95)]
    assert areas == sorted(areas)
    assert pose.density.sum() == pytest.approx(1.0)


@given(FINITE, FINITE, FINITE)
def test_a_sound_motion_passes_its_check(forward: float, left: float, turn: float) -> None:
    delta = Delta(forward, left, turn)
    assert delta.checked() is delta
