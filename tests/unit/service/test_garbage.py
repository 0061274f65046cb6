"""What stays is not looked at again; what goes is still found, and hardly anything has to be."""

import gc
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from json import JSONDecodeError
from pathlib import Path
from weakref import ref

import pytest
from fastapi.exceptions import RequestValidationError
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.errors import ServiceError, SiteNotFoundError, StoreError
from homsense_service.operations import Operations
from homsense_service.settings import Settings
from homsense_service.store.writer import Writer
from support.builders import SITE_MAP
from support.collecting import uncollected
from support.networks import until

ERRORS = (RequestValidationError, JSONDecodeError, ServiceError)

SETTLED = """
import gc, weakref
from homsense_service.garbage import settle

class Ring: pass

before = len(gc.get_objects())
settle()
assert gc.get_freeze_count() > 0.9 * before
assert len(gc.get_objects()) < 0.1 * before
ring = Ring()
ring.itself = ring
gone = weakref.ref(ring)
del ring
gc.collect()
assert gone() is None
"""

SERVED = """
import gc, os, signal, sys, threading, time
from pathlib import Path
from homsense_service.server import serve
from homsense_service.settings import Settings

def stop():
    while not gc.get_freeze_count():
        time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGTERM)

threading.Thread(target=stop, daemon=True).start()
serve(Settings(data=Path(sys.argv[1]), port=0, engine="python"))
"""


def run(script: str, *arguments: str) -> int:
    return subprocess.run(
        [sys.executable, "-c", script, *arguments], check=False, timeout=60
    ).returncode


def test_what_is_there_is_left_alone_and_a_later_ring_is_found() -> None:
    assert run(SETTLED) == 0


def test_a_service_that_has_started_is_settled(tmp_path: Path) -> None:
    assert run(SERVED, str(tmp_path)) == -signal.SIGTERM


def test_no_error_waits_for_the_collector_with_the_body_it_is_about(tmp_path: Path) -> None:
    bodies = (b"{", b"x" * 1000, b"[]", b'{"scans": [{"t": NaN}], "more": 1}')
    with TestClient(create_app(Settings(data=tmp_path, engine="python"))) as api:
        api.headers["content-type"] = "application/json"
        api.put("/v1/sites/yard", json={})
        with uncollected():
            codes = [
                api.post("/v1/sites/yard/scans", content=body).json()["code"] for body in bodies
            ]
            codes.append(api.get("/v1/sites/nowhere").json()["code"])
            left = [thing for thing in gc.get_objects() if isinstance(thing, ERRORS)]
    assert codes == [
        "malformed_json",
        "malformed_json",
        *2 * ["invalid_request"],
        "site_not_found",
    ]
    assert not left


@pytest.mark.parametrize(
    ("statement", "error"),
    [
        ("SELECT * FROM nothing", StoreError),
        ("COMMIT", StoreError),
        ("", SiteNotFoundError),
        ("", ZeroDivisionError),
    ],
    ids=["refused", "all undone", "expected", "unexpected"],
)
def test_no_failure_of_the_store_waits_for_the_collector(
    statement: str, error: type[Exception]
) -> None:
    def job(connection: sqlite3.Connection) -> None:
        if not statement:
            raise error(connection)
        connection.execute(statement)

    connection = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
    with closing(Writer(connection, time.monotonic, lambda: None)) as writer, uncollected():
        with pytest.raises(error) as told:
            writer.run(job)
        where = "".join(getattr(told.value, "__notes__", ()))
        del told
        until(lambda: not any(isinstance(thing, error) for thing in gc.get_objects()))
    assert ("in job" in where) == (error is ZeroDivisionError)


def has_come_to(api: TestClient, path: str, state: str) -> bool:
    return bool(api.get(path).json()["state"] == state)


def test_what_was_deleted_is_gone_at_once(tmp_path: Path) -> None:
    scans = [
        {
            "device": f"d{number % 9}", "scan_id": str(number), "observed_at": number,
            "landmarks": [f"a{number % 7}", f"b{number % 5}"],
            "track": {"id": "walk", "x_m": number / 2, "y_m": 0.0},
        }
        for number in range(90)
    ]  # fmt: skip
    learnt = {"registration": "failed", "expectation": "ready"}
    with TestClient(create_app(Settings(data=tmp_path, engine="python"))) as api:
        operations: Operations = api.app.state.operations  # type: ignore[attr-defined]
        with uncollected():
            for path, body in (("", {}), ("/map", SITE_MAP)):
                api.put(f"/v1/sites/yard{path}", json=body).raise_for_status()
            api.post("/v1/sites/yard/scans", json={"scans": scans}).raise_for_status()
            opened = api.post("/v1/sites/yard/sessions", json={"particles": 50}).json()["session"]
            step = {"seq": 1, "delta": {"forward_m": 1.0}, "landmarks": ["a1"]}
            api.post(f"/v1/sessions/{opened}/steps", json={"steps": [step]}).raise_for_status()
            for what, state in learnt.items():
                path = f"/v1/sites/yard/{what}"
                api.post(path).raise_for_status()
                until(partial(has_come_to, api, path, state))
            site = ref(operations.sites.get("yard"))
            session = ref(operations.sessions.get(opened))
            assert site() is not None
            assert session() is not None
            api.delete("/v1/sites/yard").raise_for_status()
            until(lambda: site() is None and session() is None)
