"""What stays is not looked at again; what goes is still found, and hardly anything has to be."""

import gc
import signal
import subprocess
import sys
from json import JSONDecodeError
from pathlib import Path

from fastapi.exceptions import RequestValidationError
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.errors import ServiceError
from homsense_service.settings import Settings

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
        gc.collect()
        gc.disable()
        try:
            codes = [
                api.post("/v1/sites/yard/scans", content=body).json()["code"] for body in bodies
            ]
            codes.append(api.get("/v1/sites/nowhere").json()["code"])
            left = [thing for thing in gc.get_objects() if isinstance(thing, ERRORS)]
        finally:
            gc.enable()
    assert codes == [
        "malformed_json",
        "malformed_json",
        *2 * ["invalid_request"],
        "site_not_found",
    ]
    assert not left
