"""What was acknowledged is there after a restart, to the last bit; damage is told, not hidden."""

import json
import sqlite3
import time
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from homsense_service import sites
from homsense_service.app import create_app
from homsense_service.records import NumberedScan, StoredReading
from homsense_service.runs import Step
from homsense_service.sessions import RestingError
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore
from support.builders import SITE_MAP, feature, local_map, square
from support.corridors import Building

from homsense import Delta

YARD = "/v1/sites/yard"
RING = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]]


def scan(number: int, *landmarks: Any, **more: Any) -> dict[str, Any]:
    return {
        "device": "phone", "scan_id": str(number), "observed_at": 1.7e9 + number,
        "landmarks": list(landmarks), **more,
    }  # fmt: skip


def step(seq: int, **more: Any) -> dict[str, Any]:
    motion = {"delta": {"forward_m": 1.5, "turn_rad": 0.1 * (seq % 5)}}
    heard = {"landmarks": RING[seq % 4]} if seq % 2 else {}
    return {"seq": seq, "t": 10.0 + seq / 2.0, **motion, **heard, **more}


class Restarting:
    """A service that can be ended and started again on the same data."""

    def __init__(self, data: Path) -> None:
        self.settings = Settings(data=data)
        self.store: SqliteStore
        self.api = self._started()

    def _started(self) -> TestClient:
        def opened(directory: Path) -> SqliteStore:
            self.store = SqliteStore(directory)
            return self.store

        api = TestClient(create_app(self.settings, opened), base_url="http://test")
        api.__enter__()
        return api

    def restart(self) -> TestClient:
        self.end()
        self.api = self._started()
        return self.api

    def end(self) -> None:
        self.api.__exit__(None, None, None)

    def run(self, session: str, first: int, count: int, **more: Any) -> dict[str, Any]:
        steps = [step(seq, **more) for seq in range(first, first + count)]
        answer = self.api.post(f"/v1/sessions/{session}/steps", json={"steps": steps})
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        return found


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Restarting]:
    running = Restarting(tmp_path / "data")
    api = running.api
    api.put(YARD, json={"s_max_m": 20.0, "hops": [1, 2]}).raise_for_status()
    api.put(f"{YARD}/map", json=SITE_MAP).raise_for_status()
    scans = [scan(number, *seen) for number, seen in enumerate(RING)]
    api.post(f"{YARD}/scans", json={"scans": scans}).raise_for_status()
    yield running
    running.end()


def opened(service: Restarting, site: str = YARD, **options: Any) -> str:
    answer = service.api.post(f"{site}/sessions", json={"particles": 300, "seed": 5, **options})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["session"])


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return {**one, "session": ""} == {**other, "session": ""}


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"motion": {"type": "imu"}, "recovery": {"type": "amcl"}, "scheme": "residual"},
        {"adaptive": {"least": 50, "most": 200}, "prior": {"type": "polygon", "ring": [
            [-10.0, -10.0], [60.0, -10.0], [60.0, 60.0], [-10.0, 60.0]]}},
    ],
)  # fmt: skip
def test_a_session_goes_on_after_a_restart_as_its_uninterrupted_twin(
    service: Restarting, options: dict[str, Any]
) -> None:
    session = opened(service, **options)
    before = service.run(session, 1, 7)
    api = service.restart()
    assert api.get("/v1/info").json()["sessions"] == 1
    assert api.get(f"/v1/sessions/{session}/pose").json() == before
    after = service.run(session, 8, 6)
    twin = opened(service, **options)
    assert same(service.run(twin, 1, 7), before)
    assert same(service.run(twin, 8, 6), after)


def test_scans_before_the_last_count_over_a_restart(service: Restarting) -> None:
    """What was heard in one of the last three scans is in view, also after a restart."""
    config = {"expected": "geometric", "hops": [0, 2], "detection": [1, 3]}
    service.api.put(YARD, json={**config, "detection": [1, 1]}).raise_for_status()
    alone = service.run(opened(service), 1, 7)
    service.api.put(YARD, json=config).raise_for_status()
    session, twin = opened(service), opened(service)
    before = service.run(session, 1, 7)
    assert before["measurement"]["holes"] == [1, 1]
    assert alone["measurement"]["holes"] == [0, 1]
    api = service.restart()
    assert api.get(f"/v1/sessions/{session}/pose").json() == before
    assert same(service.run(twin, 1, 7), before)
    after = service.run(session, 8, 4)
    assert same(service.run(twin, 8, 4), after)
    assert api.get(YARD).json()["config"]["detection"] == [1, 3]


def test_scans_made_far_away_are_forgotten(service: Restarting) -> None:
    config = {"expected": "geometric", "hops": [0], "detection": [1, 5]}
    service.api.put(YARD, json=config).raise_for_status()
    session = opened(service)
    service.run(session, 1, 1, landmarks=["a", "b", "c"])
    assert service.run(session, 2, 1, landmarks=["d"])["measurement"]["holes"] == [1]
    far = {"delta": {"forward_m": 500.0}}
    service.run(session, 3, 1, landmarks=[], **far)
    assert service.run(session, 4, 1, landmarks=["d"])["measurement"]["holes"] == [0]


def test_every_kind_of_motion_is_replayed(service: Restarting) -> None:
    session = opened(service)
    path = f"/v1/sessions/{session}/steps"
    push = [{"dt_s": 0.5, "forward": 2.0, "left": 0.0, "turn": 0.1}] * 2
    steps = [
        {"seq": 1, "imu": push},
        {"seq": 2, "imu": push, "landmarks": [{"id": "a", "rssi": -60.5, "age_s": 1.0}, "b"]},
        {"seq": 3, "walked": {"length_m": 0.7, "heading_rad": 1.0}},
        {"seq": 4, "walked": {"length_m": 0.7, "heading_rad": 1.5}},
        {"seq": 5, "delta": {"forward_m": 1.0, "std": [0.1, 0.1, 0.01]}},
        {"seq": 6, "delta": {"left_m": 1.0, "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.001]}},
    ]
    before = service.api.post(path, json={"steps": steps}).json()
    api = service.restart()
    assert api.get(f"/v1/sessions/{session}/pose").json() == before
    assert api.post(path, json={"steps": steps}).json() == before


def test_a_long_session_resumes_from_a_snapshot(
    service: Restarting, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = opened(service, particles=40)
    for first in range(1, 900, 100):
        before = service.run(session, first, 100)
    early = service.run(session, 801, 50)
    kept = service.store.snapshots(session)
    assert len(kept) == 2
    api = service.restart()
    read: list[int] = []
    events = SqliteStore.events

    def watched(store: SqliteStore, name: str, after: int = 0) -> Any:
        read.append(after)
        return events(store, name, after)

    monkeypatch.setattr(SqliteStore, "events", watched)
    assert api.get(f"/v1/sessions/{session}/pose").json() == before
    assert read[-1] == max(one.number for one in service.store.snapshots(session)) >= 600
    assert service.run(session, 801, 50) == early


def test_a_damaged_snapshot_is_not_believed(service: Restarting) -> None:
    session = opened(service, particles=40)
    for first in range(1, 600, 100):
        before = service.run(session, first, 100)
    service.end()
    with sqlite3.connect(service.settings.data / "homsense.sqlite3") as db:
        db.execute("UPDATE snapshot SET body = zeroblob(length(body))")
    db.close()
    service.api = service._started()
    assert service.api.get(f"/v1/sessions/{session}/pose").json() == before


def test_steps_are_answered_as_before_after_a_restart(service: Restarting) -> None:
    session = opened(service)
    answers = [service.run(session, seq, 1) for seq in range(1, 31)]
    api = service.restart()
    for seq in (30, 29, 7, 1):
        assert service.run(session, seq, 1) == answers[seq - 1]
    other = {**step(7), "t": 99.0}
    refused = api.post(f"/v1/sessions/{session}/steps", json={"steps": [other]})
    assert refused.json()["code"] == "sequence_conflict"
    service.run(session, 31, 1)


def test_what_lies_too_far_back_is_refused(service: Restarting) -> None:
    session = opened(service, particles=20)
    first = service.run(session, 1, 1)
    assert service.run(session, 1, 1) == first
    for start in range(2, 402, 40):
        service.run(session, start, 40)
    again = service.api.post(f"/v1/sessions/{session}/steps", json={"steps": [step(1)]})
    assert (again.status_code, again.json()["code"]) == (409, "sequence_conflict")


def test_a_session_that_moved_to_another_map_is_there_on_both(service: Restarting) -> None:
    session = opened(service)
    early = service.run(session, 1, 5)
    other = local_map(feature(square(0, 0, 20)), feature(square(40, 0, 25)))
    api = service.api
    api.put(f"{YARD}/map", json=other).raise_for_status()
    api.post(f"/v1/sessions/{session}/map").raise_for_status()
    late = service.run(session, 6, 5)
    assert late["map_version"] != early["map_version"]
    api.put(f"{YARD}/map", json=SITE_MAP).raise_for_status()
    api = service.restart()
    assert api.get(f"/v1/sessions/{session}/pose").json() == late
    assert service.run(session, 5, 1) == early
    assert service.run(session, 6, 5) == late


def test_contributed_scans_and_their_steps_are_one(service: Restarting) -> None:
    session = opened(service, contribute=True)
    service.run(session, 1, 5)
    numbers = service.api.get(f"{YARD}/complex").json()
    assert numbers["observations"] == 4 + 3
    api = service.restart()
    service.run(session, 1, 5)
    assert api.get(f"{YARD}/complex").json() == numbers


def test_a_closed_session_stays_closed_and_leaves_nothing(service: Restarting) -> None:
    first, second = opened(service), opened(service)
    service.run(first, 1, 3)
    assert service.api.delete(f"/v1/sessions/{first}").status_code == 204
    api = service.restart()
    assert api.get(f"/v1/sessions/{first}/pose").status_code == 404
    assert api.get(f"/v1/sessions/{second}/pose").status_code == 200
    api.delete(f"/v1/sessions/{second}")
    service.end()
    with sqlite3.connect(service.settings.data / "homsense.sqlite3") as db:
        for table in ("session", "event", "snapshot", "artifact", "artifact_of_session"):
            assert db.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)
    db.close()
    service.api = service._started()


def test_a_registered_session_goes_on_after_a_restart(tmp_path: Path) -> None:
    building = Building.of(1)
    service = Restarting(tmp_path / "data")
    service.settings = Settings(data=tmp_path / "data", cell_m=1.0, expectation_wait_s=120.0)
    api = service.restart()
    outline = {"type": "Feature", "properties": {"role": "domain"},
        "geometry": building.site_map.domain.__geo_interface__}  # fmt: skip
    api.put(YARD, json={"wall_tolerance_m": 1.0, "hops": [1]}).raise_for_status()
    api.put(f"{YARD}/map", json=local_map(outline, feature(square(20, 15, 15)))).raise_for_status()
    crowd = [
        scan(
            number,
            *({"id": r.landmark, "rssi": r.rssi_dbm} for r in walked.readings),
            track={"id": walked.walk, "x_m": walked.x_m, "y_m": walked.y_m},
        )
        for number, walked in enumerate(building.crowd(6, 40))
    ]
    api.post(f"{YARD}/scans", json={"scans": crowd}).raise_for_status()
    sensor = {"type": "both", "expected": "geometric"}
    session = opened(service, sensor=sensor)
    heard = {"landmarks": crowd[100]["landmarks"]}
    before = service.run(session, 1, 6, **heard)
    assert before["measurement"]["resembled"] > 0
    more = [{**entry, "device": "new"} for entry in crowd]
    api.post(f"{YARD}/scans", json={"scans": more}).raise_for_status()
    twin = opened(service, sensor=sensor)
    assert same(service.run(twin, 1, 6, **heard), before)
    uninterrupted = service.run(twin, 7, 6, **heard)
    api = service.restart()
    assert api.get(f"/v1/sessions/{session}/pose").json() == before
    assert same(service.run(session, 7, 6, **heard), uninterrupted)
    service.end()


@pytest.mark.parametrize(
    "config", [{}, {"quorum": 2}, {"retention": {"epoch_days": 1, "epochs": 3}}]
)
def test_a_start_reads_the_checkpoint_and_the_end_of_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, config: dict[str, Any]
) -> None:
    monkeypatch.setattr(sites, "_LEAST_TAIL", 10)
    service = Restarting(tmp_path)
    api = service.api
    api.put(YARD, json=config)
    for first in range(0, 30, 3):
        batch = [
            scan(n, f"l{n}", f"l{n + 1}", f"l{n * n % 31}", device=f"d{n % 3}",
                observed_at=1.79e9 - 20_000.0 * n)
            for n in range(first, first + 3)
        ]  # fmt: skip
        api.post(f"{YARD}/scans", json={"scans": batch}).raise_for_status()
    before = api.get(f"{YARD}/complex").json()
    after: list[int] = []
    scans = SqliteStore.scans

    def watched(store: SqliteStore, site: str, behind: int = 0) -> Iterator[NumberedScan]:
        after.append(behind)
        return scans(store, site, behind)

    monkeypatch.setattr(SqliteStore, "scans", watched)
    api = service.restart()
    assert api.get(f"{YARD}/complex").json() == before
    assert after
    assert min(after) >= 20
    api.put(YARD, json={**config, "min_rssi_dbm": -70.0})
    assert min(after) == 0
    service.end()


def test_scans_of_a_store_of_the_first_form_are_there(tmp_path: Path) -> None:
    text = files("homsense_service.store").joinpath("migrations", "0001.sql").read_text()
    with sqlite3.connect(tmp_path / "homsense.sqlite3") as db:
        db.executescript(text)
        db.execute('INSERT INTO site VALUES (\'yard\', \'{"name": "Old", "hops": [1, 2]}\')')
        db.execute("INSERT INTO map VALUES ('yard', ?)", (json.dumps(SITE_MAP),))
        for number, seen in enumerate(RING):
            heard = json.dumps([(seen[0], -60.5, 0.0), (seen[1], None, 2.5)])
            track = json.dumps({"id": "w", "x_m": 1.0, "y_m": 2.0, "heading_rad": None})
            row = ("yard", "phone", str(number), 1.7e9 + number, heard, track)
            db.execute(
                "INSERT INTO scan (site, device, scan_id, observed_at, readings, track) "
                "VALUES (?, ?, ?, ?, ?, ?)",
                row,
            )
    db.close()
    service = Restarting(tmp_path)
    found = [entry.scan for entry in service.store.scans("yard")]
    assert found[0].readings == (StoredReading("a", -60.5, 0.0), StoredReading("b", None, 2.5))
    assert found[0].track == {"id": "w", "x_m": 1.0, "y_m": 2.0, "heading_rad": None}
    assert service.api.get(YARD).json()["config"]["name"] == "Old"
    assert service.api.get(f"{YARD}/complex").json()["betti"] == [1, 1]
    assert service.api.get(f"{YARD}/map").json() == SITE_MAP
    service.end()


def spoil(data: Path, statement: str) -> None:
    with sqlite3.connect(data / "homsense.sqlite3") as db:
        db.execute(statement)
    db.close()


def test_a_store_of_a_later_release_is_refused(service: Restarting) -> None:
    service.end()
    spoil(service.settings.data, "PRAGMA user_version = 99")
    with pytest.raises(Exception, match="form 99"):
        SqliteStore(service.settings.data)
    spoil(service.settings.data, "PRAGMA user_version = 3")
    service.api = service._started()


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        ("UPDATE event SET body = x'00' WHERE number = 3", "damaged"),
        ("DELETE FROM event WHERE number = 3", "missing"),
        (
            "UPDATE event SET body = CAST(replace(body, '1.5', '2.5') AS BLOB) WHERE number = 3",
            "replay",
        ),
    ],
)
def test_a_damaged_journal_is_told_and_spoils_nothing_else(
    service: Restarting, statement: str, told: str
) -> None:
    sound, hurt = opened(service), opened(service)
    before = service.run(sound, 1, 5)
    service.run(hurt, 1, 5)
    service.end()
    of_hurt = f"session = (SELECT number FROM session WHERE name = '{hurt}')"
    spoil(service.settings.data, f"{statement} AND {of_hurt}")
    service.api = service._started()
    answer = service.api.get(f"/v1/sessions/{hurt}/pose")
    assert (answer.status_code, answer.json()["code"]) == (503, "store")
    assert told in answer.json()["detail"]
    assert service.api.get(f"/v1/sessions/{sound}/pose").json() == before
    assert service.api.delete(f"/v1/sessions/{hurt}").status_code == 204


def test_a_full_disk_refuses_and_loses_nothing(service: Restarting) -> None:
    session = opened(service)
    before = service.run(session, 1, 3)
    limits: list[Callable[[sqlite3.Connection], Any]] = [
        lambda db: db.execute("PRAGMA max_page_count = 1"),
        lambda db: db.execute("PRAGMA max_page_count = 1000000"),
    ]
    service.store._write(limits[0])
    many = [scan(100 + n, *(f"l{m}" for m in range(50 * n, 50 * n + 50))) for n in range(500)]
    full = service.api.post(f"{YARD}/scans", json={"scans": many})
    assert (full.status_code, full.json()["code"]) == (503, "store")
    assert "full" in full.json()["detail"]
    assert service.api.get(f"{YARD}/complex").json()["observations"] == 4
    refused = 0
    for seq in range(4, 200):
        batch = {"steps": [step(seq)]}
        answer = service.api.post(f"/v1/sessions/{session}/steps", json=batch)
        refused += answer.status_code == 503
        if refused:
            break
        before = answer.json()
    assert service.api.get(f"/v1/sessions/{session}/pose").json() == before
    service.store._write(limits[1])
    assert service.api.post(f"{YARD}/scans", json={"scans": many}).json()["accepted"] == 500
    after = service.run(session, before["seq"] + 1, 2)
    api = service.restart()
    assert api.get(f"/v1/sessions/{session}/pose").json() == after
    assert api.get(f"{YARD}/complex").json()["observations"] == 504


def test_idle_sessions_leave_the_memory_and_wake_as_they_were(service: Restarting) -> None:
    now = [1000.0]
    operations = service.api.app.state.operations  # type: ignore[attr-defined]
    operations.sessions._clock = lambda: now[0]
    first, second = opened(service), opened(service)
    before = service.run(first, 1, 5)
    now[0] += 500.0
    service.run(second, 1, 5)
    resting = operations.sessions.get(second)
    now[0] += 200.0
    assert operations.tidy() == []
    assert operations.sessions.awake == 1
    assert len(operations.sessions) == 2
    assert service.api.get(f"/v1/sessions/{first}/pose").json() == before
    assert operations.sessions.awake == 2
    now[0] += 700.0
    operations.tidy()
    assert operations.sessions.awake == 0
    with pytest.raises(RestingError):
        resting.apply([Step(6, None, Delta())], lambda fix: fix.seq, lambda _: None)
    assert service.run(second, 6, 1)["seq"] == 6
    now[0] += 604_000.0
    service.run(second, 7, 1)
    now[0] += 1000.0
    assert operations.tidy() == [first]
    assert service.api.get(f"/v1/sessions/{first}/pose").status_code == 404
    assert service.api.get("/v1/sites/yard/sessions").json()["sessions"] == [second]
    api = service.restart()
    assert api.get("/v1/info").json()["sessions"] == 1


def test_what_no_longer_counts_is_deleted_from_the_log(service: Restarting) -> None:
    api, now = service.api, time.time()
    api.put(YARD, json={"retention": {"epoch_days": 1.0, "epochs": 2}}).raise_for_status()
    old = [scan(100 + n, f"old{n}", "a", observed_at=now - 20 * 86_400.0) for n in range(5)]
    new = [scan(200 + n, f"new{n}", "a", observed_at=now) for n in range(5)]
    api.post(f"{YARD}/scans", json={"scans": [*old, *new]}).raise_for_status()
    before = api.get(f"{YARD}/complex").json()
    api.app.state.operations.tidy()  # type: ignore[attr-defined]
    logged = [entry.scan.scan_id for entry in service.store.scans("yard")]
    assert logged == [entry["scan_id"] for entry in new]
    api = service.restart()
    after = api.get(f"{YARD}/complex").json()
    assert after["digest"] == before["digest"]
    assert after["version"] == before["version"]
    with service.store._reading() as db:
        kept = {name for (name,) in db.execute("SELECT name FROM landmark")}
    assert kept == {"a", *(f"new{n}" for n in range(5))}
