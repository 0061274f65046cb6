"""How far errors go together, measured on fields whose correlation is known."""

import numpy as np
import pytest

from homsense.correlation import between_levels, correlation_m, independent

SCALE_M = 60.0


def fields(places: np.ndarray, worlds: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    root = np.linalg.cholesky(np.exp(-apart / SCALE_M) + 1e-9 * np.eye(len(places)))
    drawn: np.ndarray = np.einsum("pq,wql->wpl", root, rng.normal(size=(worlds, len(places), 2)))
    return drawn


def lattice(apart_m: float, side_m: float = 600.0) -> np.ndarray:
    axis = np.arange(0.0, side_m, apart_m)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("apart_m", [4.0 * 5.0, 12.0, 30.0])
def test_the_correlation_length_does_not_depend_on_the_cells_of_the_map(apart_m: float) -> None:
    places = lattice(apart_m)
    measured = correlation_m(places, fields(places, 40))
    assert measured == pytest.approx(2.0 * SCALE_M, rel=0.15)


def test_places_that_are_all_the_same_are_alike() -> None:
    assert correlation_m(np.zeros((50, 2)), np.ones((1, 50, 1))) > 0.0


def test_noise_is_new_at_each_place() -> None:
    places = np.random.default_rng(1).uniform(0.0, 300.0, (800, 2))
    noise = np.random.default_rng(2).normal(size=(10, 800, 2))
    assert correlation_m(places, noise) <= 10.0


def test_levels_are_made_independent_by_their_own_correlation() -> None:
    rng = np.random.default_rng(3)
    truth = np.array([[1.0, 0.7, 0.2], [0.7, 1.0, 0.4], [0.2, 0.4, 1.0]])
    errors = rng.normal(size=(100_000, 3)) @ np.linalg.cholesky(truth).T
    correlation = between_levels(errors.T @ errors)
    assert correlation == pytest.approx(truth, abs=0.03)
    made_of = independent(errors, correlation)
    assert made_of.T @ made_of / len(errors) == pytest.approx(np.eye(3), abs=0.05)
