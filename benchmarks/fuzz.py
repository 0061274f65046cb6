"""A million malformed inputs to every parser of the service; none may crash it.

hypothesis draws seeds; each seed makes a hundred inputs out of sound ones by changing members,
types, numbers and bytes. They go through the application itself: JSON bodies of all routes, maps,
gzip, websocket messages. An answer of 500 or above, or an answer without a problem, is a failure.
"""

import argparse
import asyncio
import gzip
import json
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from homsense_service.app import create_app
from homsense_service.settings import Settings
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

TOGETHER = 100
SERVER_ERROR, BAD_REQUEST = 500, 400
SQUARE = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0], [0.0, 0.0]]
FEATURE = {
    "type": "Feature",
    "properties": {"role": "structure"},
    "geometry": {"type": "Polygon", "coordinates": [SQUARE]},
}
MAP = {"type": "FeatureCollection", "frame": "local", "features": [FEATURE]}
SCAN = {
    "device": "p",
    "scan_id": "1",
    "observed_at": "2026-11-24T10:00:00Z",
    "landmarks": ["a", {"id": "b", "rssi": -60.0, "age_s": 0.5, "ssid": "x"}],
    "track": {"id": "w", "x_m": 1.0, "y_m": 2.0, "heading_rad": 0.1},
}
STEP = {
    "seq": 1,
    "t": 1.0,
    "delta": {"forward_m": 1.0, "left_m": 0.0, "turn_rad": 0.1, "std": [0.1, 0.1, 0.1]},
    "landmarks": ["a", "b"],
}
SESSION = {
    "particles": 20,
    "seed": 1,
    "prior": {"type": "gaussian", "x_m": 30.0, "y_m": 30.0, "std_m": 5.0},
    "motion": {"type": "odometry", "translation_per_m": 0.1},
    "sensor": {"type": "homology", "hops": [1], "expected": "geometric", "sigma": 1.0},
    "recovery": {"type": "relocation", "probability": 0.1},
    "adaptive": {"least": 5, "most": 50},
}
SITE = {
    "name": "A",
    "s_max_m": 20.0,
    "hops": [1, 2],
    "r_geo_m": [10.0, 20.0],
    "retention": {"epoch_days": 7.0, "epochs": 4},
    "origin": {"lat": 1.0, "lon": 2.0},
}
QUESTION = {"landmarks": ["a", "b"], "hops": [1, 2], "lasting": True, "cycles": True}
KEY = {"name": "a", "scopes": ["read"], "sites": ["a"]}
WALKED = {**STEP, "delta": None, "walked": {"length_m": 1.0, "heading_rad": 0.1}}
PUSHED = {**STEP, "delta": None, "imu": [{"dt_s": 0.1, "forward": 1.0, "left": 0.0, "turn": 0.1}]}
BODIES: list[tuple[str, str, Any]] = [
    ("POST", "/v1/sites/yard/scans", {"scans": [SCAN, SCAN]}),
    ("POST", "/v1/sites/yard/scans", {"scans": [SCAN]}),
    ("POST", "/v1/sites/yard/local-homology", QUESTION),
    ("POST", "/v1/sites/yard/sessions", SESSION),
    ("POST", "/v1/sessions/{}/steps", {"steps": [STEP, PUSHED]}),
    ("POST", "/v1/sessions/{}/steps", {"steps": [WALKED]}),
    ("PUT", "/v1/sites/other", SITE),
    ("PUT", "/v1/sites/other/map", MAP),
    ("POST", "/v1/keys", {**KEY, "scopes": ["nothing"]}),
]
ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2**31, 2**53, 2**64, -(2**70), 0.0, -0.0, 1e-320, 1e308, 1e400,
    -1e400, float("nan"), "", "a", "\x00", "\ud800", "é" * 300, "0", "1e9", "2026-13-45", [], {},
    [[]], [[[]]], {"": ""}, [None], ["a"] * 50, "a" * 5000, [0.0] * 9, {"type": "uniform"},
]  # fmt: skip
RAW = [
    b"", b"\x00", b"\xff\xfe", b"[" * 3000, b'{"a":' * 3000, b"9" * 6000, b"1e999999", b"NaN",
    b"-", b'"\\ud800"', b"\xef\xbb\xbf{}", b"{}{}", b'{"a":1,"a":2}',
]  # fmt: skip


class Fuzzed:
    """The application, and how it is asked."""

    def __init__(self, app: FastAPI) -> None:
        self.app = app
        self.session = ""
        self.told: Counter[int] = Counter()
        self.failures: list[str] = []

    async def ask(
        self, method: str, path: str, body: bytes, headers: list[tuple[bytes, bytes]]
    ) -> tuple[int, bytes]:
        """Return status and body of the answer to one request."""
        given = [{"type": "http.request", "body": body, "more_body": False}]
        status, parts = 0, list[bytes]()

        async def receive() -> Any:  # noqa: ANN401 - a message
            return given.pop() if given else {"type": "http.disconnect"}

        async def send(message: Any) -> None:  # noqa: ANN401 - a message
            nonlocal status
            status = message.get("status", status)
            parts.append(message.get("body", b""))

        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method,
            "path": path, "raw_path": path.encode(), "query_string": b"", "root_path": "",
            "scheme": "http", "headers": headers, "client": ("127.0.0.1", 1),
            "server": ("test", 80), "state": {},
        }  # fmt: skip
        try:
            await self.app(scope, receive, send)
        except Exception as error:  # noqa: BLE001 - the failure that is looked for
            self.failures.append(f"{method} {path}: {error!r} for {body[:300]!r}")
        return status, b"".join(parts)

    def judge(self, what: str, status: int, answer: bytes, body: bytes) -> None:
        """Take note of an answer."""
        self.told[status] += 1
        if status >= SERVER_ERROR or (status >= BAD_REQUEST and b'"code":' not in answer):
            self.failures.append(f"{what}: {status} {answer[:200]!r} for {body[:300]!r}")

    async def bodies(self, rng: random.Random) -> None:
        """Send malformed bodies, some of them gzipped."""
        for _ in range(TOGETHER):
            method, path, sound = rng.choice(BODIES)
            path = path.format(self.session)
            body = malformed(sound, rng)
            headers = [(b"content-type", b"application/json")]
            if rng.random() < 0.1:  # noqa: PLR2004
                body = damaged(gzip.compress(body, 1), rng)
                headers.append((b"content-encoding", b"gzip"))
            if rng.random() < 0.02:  # noqa: PLR2004
                headers[0] = (b"content-type", rng.choice([b"text/plain", b"", b"\xff", b"a/b;c"]))
            status, answer = await self.ask(method, path, body, headers)
            self.judge(f"{method} {path}", status, answer, body)

    async def messages(self, rng: random.Random) -> None:
        """Send malformed messages over one websocket; each is answered once."""
        path = f"/v1/sessions/{self.session}/stream"
        sent: asyncio.Queue[Any] = asyncio.Queue()
        given: asyncio.Queue[Any] = asyncio.Queue()
        scope = {
            "type": "websocket", "asgi": {"version": "3.0"}, "path": path, "headers": [],
            "raw_path": path.encode(), "query_string": b"", "root_path": "", "scheme": "ws",
            "client": ("127.0.0.1", 1), "server": ("test", 80), "subprotocols": [], "state": {},
        }  # fmt: skip
        given.put_nowait({"type": "websocket.connect"})
        running = asyncio.create_task(self.app(scope, given.get, sent.put))
        for _ in range(2):
            await sent.get()
        for _ in range(TOGETHER):
            sound = rng.choice([{"steps": [STEP]}, {"steps": [WALKED, STEP]}, {"steps": [PUSHED]}])
            body = malformed(sound, rng)
            kind = rng.choice(["text", "bytes"])
            given.put_nowait(
                {
                    "type": "websocket.receive",
                    kind: body.decode("utf-8", "replace") if kind == "text" else body,
                }
            )
            answer = await asyncio.wait_for(sent.get(), 20.0)
            told = json.loads(answer.get("text") or "{}")
            status = told["status"] if "code" in told else 200
            self.judge("message", status, answer["text"].encode(), body)
        given.put_nowait({"type": "websocket.disconnect", "code": 1000})
        await asyncio.wait_for(running, 20.0)


def malformed(sound: Any, rng: random.Random) -> bytes:  # noqa: ANN401 - JSON
    """Return a body that is like a sound one."""
    if rng.random() < 0.03:  # noqa: PLR2004
        return rng.choice(RAW)
    document = deepcopy(sound)
    for _ in range(rng.randint(1, 3)):
        spoil(document, rng)
    body = json.dumps(document).encode()
    return damaged(body, rng) if rng.random() < 0.2 else body  # noqa: PLR2004


def spoil(document: Any, rng: random.Random) -> None:  # noqa: ANN401 - JSON
    """Change one member somewhere."""
    while True:
        keys = list(document) if isinstance(document, dict) else list(range(len(document)))
        if not keys:
            return
        key = rng.choice(keys)
        inside = document[key]
        if isinstance(inside, dict | list) and inside and rng.random() < 0.75:  # noqa: PLR2004
            document = inside
            continue
        change = rng.random()
        if change < 0.15:  # noqa: PLR2004
            del document[key]
        elif change < 0.25 and isinstance(document, dict):  # noqa: PLR2004
            document[rng.choice(["x", "", "seq", "type", "__class__"])] = deepcopy(rng.choice(ODD))
        elif change < 0.35 and isinstance(document, list):  # noqa: PLR2004
            document.extend(deepcopy(inside) for _ in range(rng.choice([1, 2, 300])))
        else:
            document[key] = deepcopy(rng.choice(ODD))
        return


def damaged(body: bytes, rng: random.Random) -> bytes:
    """Return a body with some bytes changed, lost or added."""
    found = bytearray(body)
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(found) + 1)
        change = rng.random()
        if change < 0.4 and place < len(found):  # noqa: PLR2004
            found[place] = rng.randrange(256)
        elif change < 0.7:  # noqa: PLR2004
            del found[place : place + rng.randint(1, 20)]
        else:
            found[place:place] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 4)))
    return bytes(found)


async def prepare(fuzzed: Fuzzed) -> None:
    """Make the site and open a session."""
    kind = [(b"content-type", b"application/json")]

    async def ask(method: str, path: str, document: object) -> bytes:
        body = json.dumps(document).encode()
        status, answer = await fuzzed.ask(method, path, body, kind)
        assert status < BAD_REQUEST, answer
        return answer

    await ask("PUT", "/v1/sites/yard", {"hops": [1], "expected": "geometric"})
    await ask("PUT", "/v1/sites/yard/map", MAP)
    opened = await ask("POST", "/v1/sites/yard/sessions", {"particles": 20})
    fuzzed.session = json.loads(opened)["session"]


def run(inputs: int, only: Callable[[Fuzzed, random.Random], Any] | None = None) -> Fuzzed:
    """Send so many inputs and return what was told."""
    with tempfile.TemporaryDirectory() as directory, asyncio.Runner() as runner:
        chosen = Settings(
            data=Path(directory), engine="python", requests_per_minute=0, max_sessions=10**7
        )
        fuzzed = Fuzzed(create_app(chosen))
        lifespan = fuzzed.app.router.lifespan_context(fuzzed.app)
        runner.run(lifespan.__aenter__())
        runner.run(prepare(fuzzed))

        @settings(
            max_examples=-(-inputs // TOGETHER),
            deadline=None,
            database=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        )
        @given(st.integers(0, 2**64))
        def send(seed: int) -> None:
            rng = random.Random(seed)
            over_websocket = rng.random() < 0.2  # noqa: PLR2004
            chosen = Fuzzed.messages if over_websocket else Fuzzed.bodies
            runner.run((only or chosen)(fuzzed, rng))
            assert not fuzzed.failures, fuzzed.failures[0]

        try:
            send()
        finally:
            runner.run(lifespan.__aexit__(None, None, None))
    return fuzzed


def main() -> int:
    """Run; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    given_ = parser.parse_args()
    started = time.monotonic()
    fuzzed = run(given_.inputs)
    told = ", ".join(f"{count} x {status}" for status, count in sorted(fuzzed.told.items()))
    taken = time.monotonic() - started
    print(f"{sum(fuzzed.told.values())} malformed inputs in {taken:.0f} s: {told}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
