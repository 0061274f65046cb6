"""Live poses over loopback: a real service, its streams, and how it ends."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from homsense_cli import stored
from homsense_service.app import create_app
from homsense_service.errors import OverloadError
from homsense_service.operations import Operations
from homsense_service.sessions import Session
from homsense_service.settings import Settings
from homsense_service.streams import KEPT, PATIENCE, Reader
from starlette.websockets import WebSocketDisconnect
from support.builders import SITE_MAP


class Running:
    """A service in a process of its own."""

    def __init__(self, data: Path) -> None:
        command = [sys.executable, "-m", "homsense_cli", "serve", "--port", "0", "--data"]
        self.process = subprocess.Popen([*command, str(data)], stderr=subprocess.PIPE, text=True)
        assert self.process.stderr is not None
        self.url = self.process.stderr.readline().split()[2]
        self.log: list[str] = []
        self._reading = threading.Thread(target=self._read)
        self._reading.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        self.log.extend(self.process.stderr)

    def end(self, with_signal: signal.Signals = signal.SIGTERM) -> float:
        """Return how long it took to end, seconds."""
        started = time.monotonic()
        self.process.send_signal(with_signal)
        self.process.wait(20)
        taken = time.monotonic() - started
        self._reading.join()
        assert self.process.stderr is not None
        self.process.stderr.close()
        return taken


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    service = Running(tmp_path)
    with httpx.Client(base_url=service.url) as client:
        for _ in range(100):
            try:
                client.get("/healthz")
                break
            except httpx.TransportError:
                time.sleep(0.1)
        client.put("/v1/sites/a", json={})
        client.put("/v1/sites/a/map", json=SITE_MAP)
    yield service
    if service.process.poll() is None:
        service.end(signal.SIGKILL)


def opened(url: str) -> str:
    answer = httpx.post(f"{url}/v1/sites/a/sessions", json={"particles": 50, "seed": 1})
    return str(answer.json()["session"])


def events(lines: Iterator[str]) -> Iterator[dict[str, Any]]:
    for line in lines:
        if line.startswith("data: "):
            yield json.loads(line.removeprefix("data: "))


def test_events_bring_each_pose_and_end_with_the_service(running: Running) -> None:
    session = opened(running.url)
    path = f"{running.url}/v1/sessions/{session}"
    with httpx.stream("GET", f"{path}/events", timeout=20) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        told = events(stream.iter_lines())
        assert next(told)["seq"] == 0
        for seq in (1, 2):
            posted = httpx.post(f"{path}/steps", json={"steps": [{"seq": seq}]}).json()
            assert next(told) == posted
        assert running.end() < 3.0
        assert list(told) == []
    assert running.process.returncode in (0, -signal.SIGTERM)
    for line in running.log:
        assert json.loads(line)["level"] in {"info", "warning"}


def test_events_end_with_their_session(running: Running) -> None:
    path = f"{running.url}/v1/sessions/{opened(running.url)}"
    with httpx.stream("GET", f"{path}/events", timeout=20) as stream:
        told = events(stream.iter_lines())
        next(told)
        httpx.delete(path)
        assert list(told) == []


def test_a_reader_that_stands_still_is_cut_off_and_hinders_nobody(running: Running) -> None:
    session = opened(running.url)
    host, port = running.url.removeprefix("http://").split(":")
    still = socket.socket()
    still.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    still.connect((host, int(port)))
    request = f"GET /v1/sessions/{session}/events HTTP/1.1\r\nhost: x\r\n\r\n"
    still.sendall(request.encode())
    path = f"{running.url}/v1/sessions/{session}/steps"
    with httpx.Client() as client:
        for first in range(1, 1500):
            answer = client.post(path, json={"steps": [{"seq": first}]})
            assert answer.status_code == 200
            metrics = client.get(f"{running.url}/metrics").text if first % 50 == 0 else ""
            if first > 100 and "homsense_readers 0.0" in metrics:
                break
        else:
            raise AssertionError(metrics)
    still.close()


def test_a_reader_that_was_refused_is_none(
    api: TestClient, site: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = api.post(f"/v1/sites/{site}/sessions", json={"particles": 50}).json()["session"]

    def refuse(_session: Session, _answer: object) -> None:
        message = "not now"
        raise OverloadError(message)

    monkeypatch.setattr(Session, "answered", refuse)
    assert api.get(f"/v1/sessions/{session}/events").status_code == 503
    assert "homsense_readers 0.0" in api.get("/metrics").text


def test_a_websocket_takes_steps_and_brings_poses(api: TestClient, site: str) -> None:
    session = api.post(f"/v1/sites/{site}/sessions", json={"particles": 50}).json()["session"]
    path = f"/v1/sessions/{session}"
    with (
        api.websocket_connect(f"{path}/stream") as robot,
        api.websocket_connect(f"{path}/stream") as watcher,
    ):
        assert robot.receive_json()["seq"] == watcher.receive_json()["seq"] == 0
        robot.send_json({"steps": [{"seq": 1, "landmarks": ["a"]}]})
        pose = robot.receive_json()
        assert pose["seq"] == 1
        assert watcher.receive_json() == pose == api.get(f"{path}/pose").json()
        for text, code in (
            ("{", "malformed_json"),
            ("[]", "invalid_request"),
            ('{"steps": [{"seq": NaN}]}', "invalid_request"),
            ('{"steps": [{"seq": 0}]}', "invalid_request"),
            ('{"steps": [{"seq": 1}]}', "sequence_conflict"),
            (
                '{"steps": [{"seq": 2, "delta": {"covariance": [-1, 0,0,0,0,0,0,0,0]}}]}',
                "invalid_input",
            ),
        ):
            robot.send_text(text)
            told = robot.receive_json()
            assert told["code"] == code, told
        robot.send_bytes(b'{"steps": [{"seq": 2}]}')
        assert robot.receive_json()["seq"] == 2
        posted = api.post(f"{path}/steps", json={"steps": [{"seq": 3}]}).json()
        assert [robot.receive_json()["seq"], posted["seq"]] == [3, 3]
        api.delete(path)
        with pytest.raises(WebSocketDisconnect):
            robot.receive_json()


def test_a_websocket_of_nobody_is_refused_by_name(tmp_path: Path) -> None:
    token = stored.add_key(tmp_path, "reader", ["read"], None)
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        for headers, code in (
            ({}, "unauthorized"),
            ({"authorization": f"Bearer {token}"}, "forbidden"),
        ):
            with api.websocket_connect("/v1/sessions/x/stream", headers=headers) as socket_:
                assert socket_.receive_json()["code"] == code
                with pytest.raises(WebSocketDisconnect):
                    socket_.receive_json()


def test_readers_are_limited(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data=tmp_path, max_readers=1))) as api:
        api.put("/v1/sites/a", json={})
        api.put("/v1/sites/a/map", json=SITE_MAP)
        session = api.post("/v1/sites/a/sessions", json={"particles": 10}).json()["session"]
        with api.websocket_connect(f"/v1/sessions/{session}/stream") as reader:
            reader.receive_json()
            refused = api.get(f"/v1/sessions/{session}/events")
            assert (refused.status_code, refused.json()["code"]) == (503, "overload")


def test_a_slow_reader_misses_the_oldest_and_then_ends() -> None:
    async def run() -> None:
        reader = Reader()
        for number in range(10):
            reader.offer(str(number).encode())
        assert [await reader.next() for _ in range(KEPT)] == [b"8", b"9"]
        sent = asyncio.create_task(stand_still(reader))
        await asyncio.sleep(0)
        for _ in range(PATIENCE + KEPT + 1):
            reader.offer(b"x")
        await asyncio.wait((sent,), timeout=5.0)
        assert sent.cancelled()
        assert await reader.next() is None
        reader.offer(b"x")
        reader.end()

    async def stand_still(reader: Reader) -> None:
        await reader.next()
        await asyncio.sleep(60.0)

    asyncio.run(run())


def test_too_many_requests_at_once_are_refused(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path, max_pending_requests=2))
    go_on = threading.Event()

    @app.get("/slow")
    def slow() -> str:
        go_on.wait(10)
        return "done"

    with TestClient(app) as api:
        waiting = [threading.Thread(target=api.get, args=("/slow",)) for _ in range(2)]
        for thread in waiting:
            thread.start()
        for _ in range(100):
            told = api.get("/readyz").json()
            if told["pending_requests"] >= 3:
                break
            time.sleep(0.02)
        refused = api.get("/v1/sites")
        assert (refused.status_code, refused.json()["code"]) == (503, "overload")
        assert refused.headers["retry-after"] == "5"
        go_on.set()
        for thread in waiting:
            thread.join()
        assert api.get("/v1/sites").status_code == 200


def test_an_unforeseen_failure_of_a_message_is_logged(
    api: TestClient, site: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    session = api.post(f"/v1/sites/{site}/sessions", json={"particles": 10}).json()["session"]

    def fail(*_arguments: object) -> None:
        message = "a secret"
        raise RuntimeError(message)

    monkeypatch.setattr(Operations, "take_steps", fail)
    with api.websocket_connect(f"/v1/sessions/{session}/stream") as robot:
        robot.receive_json()
        robot.send_json({"steps": [{"seq": 1}]})
        told = robot.receive_json()
    assert told["code"] == "internal"
    assert "secret" not in json.dumps(told)
    assert "a secret" in caplog.text
