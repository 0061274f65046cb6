"""Readers and a writer at the same tables."""

import random
import threading

import pytest

from homsense import LandmarkComplex, sense_local_homology
from homsense.engine import PYTHON, Engine, compiled

ENGINES = [engine for engine in (PYTHON, compiled()) if engine]


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_an_older_version_is_read_while_another_thread_adds(engine: Engine) -> None:
    rng = random.Random(1)
    names = [f"l{n:03d}" for n in range(300)]
    scans = [
        [names[(start + step) % 300] for step in rng.sample(range(9), 5)]
        for start in (rng.randrange(300) for _ in range(4000))
    ]
    before = LandmarkComplex.from_observations(scans[:300], engine)
    grown = [before]

    def add() -> None:
        for first in range(300, 4000, 20):
            grown.append(grown[-1].with_observations(scans[first : first + 20]))

    asked = [frozenset(scan) for scan in scans[:20]]
    known = [sense_local_homology(before, scan, [1, 2])[1].betti for scan in asked]
    writer = threading.Thread(target=add)
    writer.start()
    rounds = 0
    while writer.is_alive() or not rounds:
        found = [sense_local_homology(before, scan, [1, 2])[1].betti for scan in asked]
        assert found == known
        rounds += 1
    writer.join()
    assert grown[-1] == LandmarkComplex.from_observations(scans, PYTHON)


def test_whoever_comes_second_adds_to_a_copy() -> None:
    k = LandmarkComplex.from_observations([{"a", "b"}])
    assert k._table.claim(k.version)
    other = k.with_observation({"c"})
    assert other._table is not k._table
    k._table.release()
    assert k.with_observation({"d"})._table is k._table
    assert other.landmarks == {"a", "b", "c"}
