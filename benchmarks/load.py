"""Durable scans and steps of a service against a bare endpoint that parses and answers the same.

One process serves, the generator runs beside it. The bare endpoint is FastAPI, asynchronous, with
the same request models; it answers a constant of the same size. Rounds alternate; the ratio is of
the CPU time of the serving process for one request, which neighbors disturb least. What the site
learns in the background is waited for; scans go to a site of their own.
"""

import http.client
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from homsense_cli.local_service import free_port
from homsense_fleet.device import phone_scans
from homsense_fleet.world import World, downtown_44

CONNECTIONS, ROUNDS = 16, 3
STEP_REQUESTS, SCAN_REQUESTS = 2400, 120
BATCH, PARTICLES, SESSIONS, IDLE = 50, 8000, 64, 400
MOST_KIB, LEAST_RATIO = 200.0, 0.5
_TICKS, _PAGE = os.sysconf("SC_CLK_TCK"), os.sysconf("SC_PAGE_SIZE")

BARE = """
import sys, uvicorn
from fastapi import FastAPI
from homsense_service import schemas

app = FastAPI()
pose = schemas.PoseOut.model_validate_json(sys.argv[2])
done = schemas.ScansOut(accepted=50, duplicate=0, dropped=[], complex_version=123456)

@app.post("/steps")
async def steps(batch: schemas.StepsIn) -> schemas.PoseOut:
    return pose

@app.post("/scans")
async def scans(batch: schemas.ScansIn) -> schemas.ScansOut:
    return done

uvicorn.run(app, port=int(sys.argv[1]), log_level="warning")
"""


class Load(NamedTuple):
    """What a round has cost."""

    requests_per_s: float
    cpu_ms: float
    p50_ms: float
    p99_ms: float


def main() -> int:
    """Print the comparison; return 1 when a bar is missed."""
    world = downtown_44(0)
    with tempfile.TemporaryDirectory() as directory, serving(Path(directory)) as (port, pid):
        sessions = prepared(port, world)
        pose = call(port, "POST", f"/v1/sessions/{sessions[0]}/steps", one_step(1, world))
        fits = idle_sessions(port, pid, world) <= MOST_KIB
        with bare(pose) as (bare_port, bare_pid):
            ratios = compare((port, pid), (bare_port, bare_pid), sessions, world)
    return 0 if fits and min(ratios) >= LEAST_RATIO else 1


def idle_sessions(port: int, pid: int, world: World) -> float:
    """Print and return how much memory a session takes that has stepped and waits, KiB."""
    before = resident_kib(pid)
    for seed in range(IDLE):
        body = json.dumps({"particles": PARTICLES, "seed": seed}).encode()
        session = json.loads(call(port, "POST", "/v1/sites/town/sessions", body))["session"]
        for seq in (1, 2):
            call(port, "POST", f"/v1/sessions/{session}/steps", one_step(seq, world))
    each = (resident_kib(pid) - before) / IDLE
    print(f"memory: {each:.0f} KiB a session of {PARTICLES} particles, of {IDLE}")
    return each


def resident_kib(pid: int) -> float:
    """Return the resident memory of a process, KiB."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE / 1024


def compare(
    ours_at: tuple[int, int], bare_at: tuple[int, int], sessions: list[str], world: World
) -> list[float]:
    """Run the rounds and print them; return the ratios of CPU time."""
    print(f"{CONNECTIONS} connections, {ROUNDS} rounds, one process each, {os.cpu_count()} cores")
    seqs = dict.fromkeys(sessions, 1)
    fresh = scan_batches(world, ROUNDS * SCAN_REQUESTS)
    rows: dict[str, list[tuple[Load, Load]]] = {"steps": [], "scans": []}
    for _ in range(ROUNDS):
        steps = step_requests(sessions, seqs, world)
        ours = drive(*ours_at, steps)
        plain = drive(*bare_at, [("/steps", body) for _, body in steps])
        rows["steps"].append((ours, plain))
        batches = [next(fresh) for _ in range(SCAN_REQUESTS)]
        ours = drive(*ours_at, [("/v1/sites/crowd/scans", body) for body in batches])
        plain = drive(*bare_at, [("/scans", body) for body in batches])
        rows["scans"].append((ours, plain))
    ratios: list[float] = []
    for name, what, of in (
        ("steps", f"a step, {PARTICLES} particles, durable", 1),
        ("scans", f"{BATCH} scans, durable", BATCH),
    ):
        ours, plain = (best(pair[side] for pair in rows[name]) for side in (0, 1))
        ratio = plain.cpu_ms / ours.cpu_ms
        ratios.append(ratio)
        print(
            f"{what}: {ours.requests_per_s * of:.0f}/s, CPU {ours.cpu_ms:.2f} ms, "
            f"p50 {ours.p50_ms:.1f} p99 {ours.p99_ms:.1f} ms; bare {plain.requests_per_s * of:.0f}"
            f"/s, CPU {plain.cpu_ms:.2f} ms, p50 {plain.p50_ms:.1f} p99 {plain.p99_ms:.1f} ms; "
            f"CPU ratio {ratio:.2f}"
        )
    return ratios


def best(loads: Iterator[Load]) -> Load:
    """Return the medians."""
    return Load(*map(median, zip(*loads, strict=True)))


def drive(port: int, pid: int, requests: list[tuple[str, bytes]]) -> Load:
    """Post requests over some connections at once; each connection keeps its order."""
    waits: list[float] = []
    shares = [requests[number::CONNECTIONS] for number in range(CONNECTIONS)]

    def run(share: list[tuple[str, bytes]]) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port)
        for path, body in share:
            started = time.perf_counter()
            connection.request("POST", path, body, {"content-type": "application/json"})
            answer = connection.getresponse()
            text = answer.read()
            assert answer.status == HTTPStatus.OK, text
            waits.append(time.perf_counter() - started)
        connection.close()

    threads = [threading.Thread(target=run, args=(share,)) for share in shares]
    cpu, started = cpu_s(pid), time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    wall, spent = time.perf_counter() - started, cpu_s(pid) - cpu
    p50, p99 = np.percentile(np.array(waits) * 1e3, [50, 99])
    count = len(requests)
    return Load(count / wall, 1e3 * spent / count, float(p50), float(p99))


def cpu_s(pid: int) -> float:
    """Return the CPU time that a process has spent, seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def seeded(*seed: int) -> np.random.Generator:
    """Return random numbers of a seed."""
    return np.random.Generator(np.random.PCG64(seed))


def one_step(seq: int, world: World) -> bytes:
    """Return a step with a scan of twelve landmarks or so."""
    rng = seeded(seq % 512)
    (scan,) = list(phone_scans(world, "robot", rng, count=1))
    heard = [entry if isinstance(entry, str) else entry["id"] for entry in scan["landmarks"]]
    turn = 0.2 * float(rng.standard_normal())
    delta = {"forward_m": 1.0, "left_m": 0.0, "turn_rad": turn}
    return json.dumps(
        {"steps": [{"seq": seq, "t": float(seq), "delta": delta, "landmarks": heard[:12]}]}
    ).encode()


def step_requests(
    sessions: list[str], seqs: dict[str, int], world: World
) -> list[tuple[str, bytes]]:
    """Return one step after the other for each session; a connection has its own sessions."""
    requests = []
    for number in range(STEP_REQUESTS):
        session = sessions[number % SESSIONS]
        seqs[session] += 1
        requests.append((f"/v1/sessions/{session}/steps", one_step(seqs[session], world)))
    return requests


def scan_batches(world: World, count: int) -> Iterator[bytes]:
    """Yield batches of fresh scans of a crowd."""
    for number in range(count):
        scans = phone_scans(world, f"b{number}", seeded(number), count=BATCH)
        yield json.dumps({"scans": list(scans)}).encode()


def prepared(port: int, world: World) -> list[str]:
    """Map the site and open the sessions."""
    call(port, "PUT", "/v1/sites/crowd", b"{}")
    call(port, "PUT", "/v1/sites/town", b"{}")
    call(port, "PUT", "/v1/sites/town/map", json.dumps(world.map_document()).encode())
    for phone in range(40):
        scans = list(phone_scans(world, f"p{phone}", seeded(phone), count=130))
        call(port, "POST", "/v1/sites/town/scans", json.dumps({"scans": scans}).encode())
    opened = []
    for seed in range(SESSIONS):
        body = json.dumps({"particles": PARTICLES, "seed": seed}).encode()
        opened.append(json.loads(call(port, "POST", "/v1/sites/town/sessions", body))["session"])
    wait_until_learnt(port)
    return opened


def wait_until_learnt(port: int) -> None:
    """Wait until the site works no more in the background; that is not what is measured."""
    for what in ("expectation", "registration"):
        while b'"building"' in call(port, "GET", f"/v1/sites/town/{what}", b""):
            time.sleep(0.2)


def call(port: int, method: str, path: str, body: bytes) -> bytes:
    """Return the answer to one request."""
    connection = http.client.HTTPConnection("127.0.0.1", port)
    connection.request(method, path, body, {"content-type": "application/json"})
    answer = connection.getresponse()
    text = answer.read()
    assert answer.status < HTTPStatus.MULTIPLE_CHOICES, text
    connection.close()
    return text


@contextmanager
def serving(data: Path, engine: str = "numba") -> Iterator[tuple[int, int]]:
    """Run a service."""
    environment = {
        "HOMSENSE_DATA": str(data),
        "HOMSENSE_ENGINE": engine,
        "HOMSENSE_EXPECTATION_WAIT_S": "300",
        "HOMSENSE_REQUESTS_PER_MINUTE": "0",
    }
    with process([sys.executable, "-m", "homsense_service"], environment, "/healthz") as found:
        yield found


@contextmanager
def bare(pose: bytes) -> Iterator[tuple[int, int]]:
    """Run the bare endpoint."""
    port = free_port()
    command = [sys.executable, "-c", BARE, str(port), pose.decode()]
    with process(command, {}, "/openapi.json", port) as found:
        yield found


@contextmanager
def process(
    command: list[str], environment: dict[str, str], path: str, port: int | None = None
) -> Iterator[tuple[int, int]]:
    """Run a process until it is no more needed, from when it answers."""
    chosen = port or free_port()
    given = {**os.environ, **environment, "HOMSENSE_PORT": str(chosen)}
    running = subprocess.Popen(command, env=given)
    try:
        wait_for(lambda: call(chosen, "GET", path, b""))
        yield chosen, running.pid
    finally:
        running.terminate()
        running.wait(20)


def wait_for(probe: Callable[[], Any]) -> None:
    """Try until it works."""
    for _ in range(600):
        try:
            probe()
        except OSError:
            time.sleep(0.1)
        else:
            return
    message = "no answer"
    raise TimeoutError(message)


if __name__ == "__main__":
    sys.exit(main())
