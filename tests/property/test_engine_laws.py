"""Laws of the engines: the compiled one gives what the reference gives, version by version."""

import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.oracles import all_faces
from support.strategies import HOPS, LANDMARKS, OBSERVATION, OBSERVATIONS

from homsense import LandmarkComplex
from homsense.engine import PYTHON, compiled
from homsense.facet_table import Ragged

NUMBA = compiled()
MANY = 700
Observations = list[frozenset[str]]
ENDS = st.lists(st.integers(0, 30), min_size=1, max_size=4)
ROWS = st.lists(st.frozensets(st.integers(0, 40), max_size=7), max_size=30)

pytestmark = pytest.mark.skipif(NUMBA is None, reason="numba is not installed")


@given(ROWS, ENDS)
def test_both_engines_tell_the_same_history(rows: list[frozenset[int]], ends: list[int]) -> None:
    assert NUMBA
    ragged = Ragged.of([sorted(row) for row in rows])
    stages = sorted(min(end, len(rows)) for end in ends)
    assert NUMBA.history(ragged, stages) == PYTHON.history(ragged, stages)


@pytest.mark.parametrize("seed", range(3))
def test_both_engines_tell_the_same_history_of_hundreds_of_holes(seed: int) -> None:
    assert NUMBA
    rng = random.Random(seed)
    most = 0
    for _ in range(60):
        points, size = rng.randint(1, 300), rng.choice([2, 3, 5, 12])
        rows = [
            sorted(rng.sample(range(points), min(points, rng.randint(0, size))))
            for _ in range(rng.randint(0, 400))
        ]
        ends = sorted(rng.randint(0, len(rows)) for _ in range(3))
        reference = PYTHON.history(Ragged.of(rows), ends)
        assert NUMBA.history(Ragged.of(rows), ends) == reference
        most = max(most, reference.betti(2)[1])
    assert most > 64


@pytest.mark.parametrize("seed", range(8))
def test_both_engines_tell_the_same_history_of_many_overlapping_rows(seed: int) -> None:
    """Of so many rows the compiled engine leaves out what is needless before it counts."""
    assert NUMBA
    rng = np.random.default_rng(seed)
    rows, points = rng.random((MANY, 1, 2)), rng.random((1, 300, 2))
    holds = np.linalg.norm(rows - points, axis=2) < 0.04 + 0.02 * seed
    holds &= rng.random(holds.shape) > (0.0, 0.2)[seed % 2]
    ragged, stages = Ragged.of([np.flatnonzero(row).tolist() for row in holds]), [90, 400, MANY]
    assert NUMBA.history(ragged, stages) == PYTHON.history(ragged, stages)


@pytest.mark.parametrize("seed", range(4))
def test_both_engines_sense_the_same_in_large_neighborhoods(seed: int) -> None:
    """There the compiled engine knows of most facets that nothing dominates them."""
    assert NUMBA
    rng = np.random.default_rng(seed)
    scans, landmarks = rng.random((500, 1, 2)), rng.random((1, 2 * MANY, 2))
    apart = np.linalg.norm(scans - landmarks, axis=2)
    heard = (apart < 0.08) & (apart > 0.03 * (seed % 2)) & (rng.random(apart.shape) > 0.1)
    seen = [frozenset(str(landmark) for landmark in np.flatnonzero(scan)) for scan in heard]
    k = LandmarkComplex.from_observations(seen, PYTHON)
    middle = seen[int(np.abs(scans - 0.5).sum(axis=2).argmin())]
    reference, other = (k.run_by(e).sense(middle, [2, 3, 4]) for e in (PYTHON, NUMBA))
    assert other.homology == reference.homology
    assert other.ends == reference.ends
    assert reference.ends[1] > MANY


@given(OBSERVATIONS, OBSERVATION, HOPS)
def test_both_engines_sense_the_same(
    observations: Observations, visible: frozenset[str], hops: list[int]
) -> None:
    assert NUMBA
    k = LandmarkComplex.from_observations(observations, PYTHON)
    left_out = sorted(k.landmarks)[::3] if len(hops) > 1 else []
    reference, other = (
        k.run_by(e).sense(visible, sorted(hops), left_out) for e in (PYTHON, NUMBA)
    )
    assert other.homology == reference.homology
    assert other.ends == reference.ends
    for start, end in pairwise([0, *reference.ends]):
        assert set(other.order[start:end].tolist()) == set(reference.order[start:end].tolist())


@given(st.lists(OBSERVATIONS, max_size=5))
def test_both_engines_build_the_same_complex(batches: list[Observations]) -> None:
    assert NUMBA
    built = LandmarkComplex(PYTHON), LandmarkComplex(NUMBA)
    for batch in batches:
        built = built[0].with_observations(batch), built[1].with_observations(batch)
        assert built[0].digest() == built[1].digest()


@given(st.lists(OBSERVATIONS, max_size=6), st.randoms(use_true_random=False))
def test_every_version_stays_what_it_was(batches: list[Observations], rng: random.Random) -> None:
    """Versions share their tables, also when engines take turns and versions branch."""
    versions = [LandmarkComplex(PYTHON)]
    known: list[Observations] = [[]]
    for batch in batches:
        parent = rng.randrange(len(versions))
        engine = rng.choice([e for e in (PYTHON, NUMBA) if e])
        versions.append(versions[parent].run_by(engine).with_observations(batch))
        known.append([*known[parent], *batch])
    for version, observations in zip(versions, known, strict=True):
        fresh = LandmarkComplex.from_observations(observations)
        assert version.digest() == fresh.digest()
        assert version.landmarks == fresh.landmarks
        assert version.betti_numbers() == fresh.betti_numbers()


@given(OBSERVATIONS, OBSERVATIONS, OBSERVATION, st.integers(0, 3))
def test_nothing_changes_where_the_complex_agrees(
    before: Observations, more: Observations, visible: frozenset[str], hops: int
) -> None:
    earlier = LandmarkComplex.from_observations(before)
    order, _, homology = earlier.sense(visible, [hops])
    later = earlier.with_observations(more)
    if later.agrees_on(earlier, order) and visible <= earlier.landmarks:
        assert later.sense(visible, [hops]).homology == homology
    ball = earlier.names(order)
    touched = any(scan & ball and scan not in all_faces(earlier.facets) for scan in more if scan)
    if not touched and later._table is earlier._table:
        assert later.agrees_on(earlier, order)


def test_tables_stay_small_when_facets_are_swallowed_again_and_again() -> None:
    k = LandmarkComplex()
    scan: set[str] = set()
    for n in range(300):
        scan.add(f"l{n}")
        k = k.with_observation(scan)
    assert k.facets == {frozenset(scan)}
    assert k._table.n_bytes < 100_000


@given(st.lists(st.frozensets(LANDMARKS, min_size=1, max_size=3), max_size=60))
def test_a_copy_of_the_tables_holds_the_same(observations: Observations) -> None:
    k = LandmarkComplex.from_observations(observations)
    one, other = k.with_observation({"x"}), k.with_observation({"y"})
    assert one.facets == k.facets | {frozenset("x")}
    assert other.facets == k.facets | {frozenset("y")}
    landmarks = np.arange(other.n_landmarks, dtype=np.int32)
    assert other.names(landmarks) == other.landmarks
