"""Laws of the store: what goes in comes out, and one failure undoes nothing else."""

import sqlite3
import threading
from pathlib import Path

import pytest
from homsense_service.errors import StoreError
from homsense_service.records import StoredReading
from homsense_service.store.packing import landmark_numbers, packed, unpacked
from homsense_service.store.writer import Writer
from hypothesis import given
from hypothesis import strategies as st

STRENGTH = st.one_of(
    st.none(), st.integers(-127, 100).map(float), st.floats(-200, 100, allow_nan=False)
)
READING = st.builds(
    StoredReading,
    st.text(min_size=1, max_size=20),
    STRENGTH,
    st.one_of(st.just(0.0), st.floats(0, 1e9, allow_nan=False)),
)


@given(st.lists(READING, max_size=30))
def test_readings_are_unpacked_as_they_were_packed(readings: list[StoredReading]) -> None:
    names: list[str] = []

    def number_of(name: str) -> int:
        if name not in names:
            names.append(name)
        return names.index(name)

    body = packed(readings, number_of)
    assert unpacked(body, names.__getitem__) == tuple(readings)
    assert {names[number] for number in landmark_numbers(body)} == {r.landmark for r in readings}


def test_a_plain_scan_is_small() -> None:
    readings = [StoredReading(f"aa:bb:cc:dd:ee:{n:02x}", -60.0 - n) for n in range(12)]
    assert len(packed(readings, lambda name: int(name[-2:], 16))) == 6 + 12 * 5


def writer(path: Path) -> tuple[Writer, list[int]]:
    connection = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
    connection.execute("CREATE TABLE IF NOT EXISTS entry (value INTEGER UNIQUE)")
    sizes: list[int] = []
    found = Writer(connection, lambda: 0.0, lambda: None)
    found.on_commit = lambda _seconds, jobs: sizes.append(jobs)
    return found, sizes


def insert(value: int, *, then_fail: bool = False) -> object:
    def job(db: sqlite3.Connection) -> int:
        db.execute("INSERT INTO entry VALUES (?)", (value,))
        if then_fail:
            raise LookupError(value)
        return value

    return job


@given(outcomes=st.lists(st.booleans(), min_size=1, max_size=40))
def test_a_job_that_fails_undoes_itself_and_no_other(
    tmp_path_factory: pytest.TempPathFactory, outcomes: list[bool]
) -> None:
    path = tmp_path_factory.mktemp("writer") / "db"
    running, sizes = writer(path)
    told: list[int] = []
    failed: list[int] = []

    def caller(value: int, *, fails: bool) -> None:
        try:
            running.run(insert(value, then_fail=fails), told.append)  # type: ignore[arg-type]
        except LookupError:
            failed.append(value)

    callers = [
        threading.Thread(target=caller, args=(value,), kwargs={"fails": fails})
        for value, fails in enumerate(outcomes)
    ]
    for thread in callers:
        thread.start()
    for thread in callers:
        thread.join()
    running.close()
    with sqlite3.connect(path) as db:
        found = [value for (value,) in db.execute("SELECT value FROM entry ORDER BY rowid")]
    db.close()
    assert found == told
    assert sorted(found) == [value for value, fails in enumerate(outcomes) if not fails]
    assert sorted(failed) == [value for value, fails in enumerate(outcomes) if fails]
    assert sum(sizes) == len(outcomes)


def test_after_the_end_nothing_is_promised(tmp_path: Path) -> None:
    running, _ = writer(tmp_path / "db")
    running.close()
    with pytest.raises(StoreError, match="closed"):
        running.run(insert(1))  # type: ignore[arg-type]
