"""Streaming over zenoh beside raw zenoh in the same run: round trips, cost of a delta, a fleet.

One process serves, one answers raw queries of the same sizes, the robots run here. What the
step itself takes (the operation, its answer, the disk) is told by the service's own metrics.
Absolute times mean little.
"""

import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import zenoh
from homsense_cli.local_service import free_port
from homsense_client.streaming import Network, Robot, connect
from homsense_fleet.world import World, downtown_44
from load import call, cpu_s, one_step, prepared, serving, wait_until_learnt

ROUNDS, TRIPS = 3, 400
DELTA_ROBOTS, DELTA_S = 20, 15.0
ROBOTS, LARGE, LARGE_PARTICLES, SMALL_PARTICLES, FLEET_S = 300, 8, 8000, 1000, 30.0
MOST_RATIO, MOST_US, MOST_DELAY_MS = 2.0, 15.0, 50.0
SITE = "town"
FROZEN = Path(__file__).with_name("frozen_robot.py")
COUNTING = {"type": "homology"}

RAW = """
import json, sys, time, zenoh
config = zenoh.Config()
for path, value in {"mode": "peer", "listen/endpoints": [sys.argv[1]],
                    "scouting/multicast/enabled": False}.items():
    config.insert_json5(path, json.dumps(value))
answer = b"x" * int(sys.argv[2])
def reply(query):
    with query:
        ready = time.perf_counter() + 1e-6 * float(query.parameters.get("busy_us") or 0.0)
        query.payload.to_bytes()
        while time.perf_counter() < ready:
            pass
        query.reply(query.key_expr, answer)
with zenoh.open(config) as session:
    session.declare_queryable("raw", reply)
    sys.stdin.read()
"""


def main() -> int:
    """Print all figures; return 1 when a bar is missed."""
    chosen = sys.argv[1:] or ["trips", "deltas", "frozen", "fleet"]
    world = downtown_44(0)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    os.environ["HOMSENSE_ZENOH_LISTEN"] = json.dumps([endpoint])
    with tempfile.TemporaryDirectory() as directory, serving(Path(directory)) as (port, pid):
        prepared(port, world)
        wait_until_learnt(port)
        with connect(endpoint, timeout_s=20.0) as network:
            parts = {
                "trips": partial(round_trips, network, port, world),
                "deltas": partial(deltas, network, port, pid),
                "frozen": partial(frozen, network, endpoint, world),
                "fleet": partial(fleet, network, port, pid, world),
            }
            held = [parts[name]() for name in chosen]
    return 0 if all(held) else 1


def scans_of(world: World, count: int) -> list[list[str]]:
    """Return what a robot hears at some places."""
    steps = (json.loads(one_step(seq, world))["steps"][0] for seq in range(1, count + 1))
    return [step["landmarks"] for step in steps]


def round_trips(network: Network, port: int, world: World) -> bool:
    """Print a step over zenoh beside a raw query and the step itself, microseconds.

    The bar is a raw query that is answered at once. One that is answered after as long as the step
    takes costs more itself: meanwhile the others have gone to sleep. It is printed beside.
    """
    heard = scans_of(world, TRIPS)
    rows: dict[str, list[float]] = {"sdk": [], "ours": [], "raw": [], "late": [], "own": []}
    with Robot(network, "trips") as robot:
        robot.open(SITE, particles=SMALL_PARTICLES, seed=1, sensor=COUNTING)
        session, token = network.session, robot._token  # noqa: SLF001 - to send bytes of our own
        key = "homsense/@v1/dev/trips/rpc/scan"
        pose = ask(session, key, body_of(heard[0]), struct.pack("<Q8s", 1, token))
        with raw(len(pose)) as plain:
            for _ in range(ROUNDS):
                before = step_s(port)
                first = robot.last().seq + 1
                requests = [
                    (body_of(scan), struct.pack("<Q8s", first + 2 * n, token))
                    for n, scan in enumerate(heard)
                ]
                rows["ours"].append(mean_us([partial(ask, session, key, *r) for r in requests]))
                own_us = 1e6 * (step_s(port) - before) / len(heard)
                rows["own"].append(own_us)
                rows["raw"].append(mean_us([partial(ask, plain, "raw", *r) for r in requests]))
                late = f"raw?busy_us={own_us}"
                late_us = mean_us([partial(ask, plain, late, *r) for r in requests])
                rows["late"].append(late_us - own_us)
                robot._number = robot.last().seq  # noqa: SLF001
                rows["sdk"].append(mean_us([partial(step, robot, scan) for scan in heard]))
    sdk_us, ours_us, raw_us, late_us, own_us = (median(rows[name]) for name in rows)
    ratio = (ours_us - own_us) / raw_us
    print(
        f"round trip of a step, {SMALL_PARTICLES} particles, durable, {ROUNDS} times {TRIPS}: "
        f"{ours_us:.0f} us ({sdk_us:.0f} with the SDK); the step itself {own_us:.0f} us; raw "
        f"zenoh, the same sizes, {raw_us:.0f} us; (ours - step) / raw = {ratio:.2f} (at most "
        f"{MOST_RATIO}); raw zenoh that answers as late as the step, {late_us:.0f} us: "
        f"{(ours_us - own_us) / late_us:.2f}"
    )
    return ratio <= MOST_RATIO


def body_of(scan: list[str]) -> bytes:
    """Return a scan with one motion before it."""
    return json.dumps({"landmarks": scan, "deltas": [{"forward_m": 1.0, "dt_s": 0.1}]}).encode()


def ask(session: zenoh.Session, key: str, payload: bytes, attachment: bytes) -> bytes:
    """Return the answer to a query."""
    for reply in session.get(key, payload=payload, attachment=attachment, timeout=5.0):
        assert reply.ok is not None
        return reply.ok.payload.to_bytes()
    raise TimeoutError


def step(robot: Robot, scan: list[str]) -> None:
    """Take a step by the SDK."""
    robot.move({"forward_m": 1.0}, dt_s=0.1)
    robot.scan(scan)


def mean_us(jobs: list[Callable[[], object]]) -> float:
    """Return the mean time of some jobs, one after the other, microseconds."""
    started = time.perf_counter()
    for job in jobs:
        job()
    return 1e6 * (time.perf_counter() - started) / len(jobs)


@contextmanager
def raw(size: int) -> Iterator[Any]:
    """Run a process that answers raw queries, and give a session that asks it."""
    where = f"tcp/127.0.0.1:{free_port()}"
    command = [sys.executable, "-c", RAW, where, str(size)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as running:
        with connect(where, timeout_s=20.0) as network:
            while not list(network.session.get("raw", payload=b"", timeout=1.0)):
                time.sleep(0.05)
            yield network.session
        assert running.stdin is not None
        running.stdin.close()


def deltas(network: Network, port: int, pid: int) -> bool:
    """Print what deltas at 100 Hz cost the service beside the steps they become."""
    robots = [Robot(network, f"delta-{number}") for number in range(DELTA_ROBOTS)]
    for robot in robots:
        robot.open(SITE, particles=100, pose_hz=0.1)
    time.sleep(1.0)
    cpu, started = cpu_s(pid), time.perf_counter()
    time.sleep(3.0)
    idle = (cpu_s(pid) - cpu) / (time.perf_counter() - started)
    cpu, filtering, started, sent = cpu_s(pid), filter_s(port), time.perf_counter(), 0
    while time.perf_counter() - started < DELTA_S:
        for robot in robots:
            for _ in range(10):
                robot.move({"forward_m": 0.01, "std": (0.001, 0.001, 0.001)}, dt_s=0.01)
        sent += 10 * DELTA_ROBOTS
        time.sleep(max(0.0, started + sent / DELTA_ROBOTS * 0.01 - time.perf_counter()))
    wall = time.perf_counter() - started
    filtering = filter_s(port) - filtering
    each_us = 1e6 * (cpu_s(pid) - cpu - idle * wall - filtering) / sent
    for robot in robots:
        robot.close()
    print(
        f"deltas: {DELTA_ROBOTS} robots at 100 Hz, batched by 10, {sent} in {wall:.0f} s: "
        f"{each_us:.1f} us of CPU each, beside idling and {filtering:.2f} s of filtering (at most "
        f"{MOST_US:.0f})"
    )
    return each_us <= MOST_US


def frozen(network: Network, endpoint: str, world: World) -> bool:
    """Print how much a frozen robot with pending questions delays a healthy one."""
    heard = scans_of(world, 100)

    def asked(robot: Robot) -> list[float]:
        taken = []
        for _ in heard:
            started = time.perf_counter()
            robot.last()
            taken.append(1e3 * (time.perf_counter() - started))
            time.sleep(0.03)
        return taken

    with Robot(network, "healthy") as robot:
        robot.open(SITE, particles=200)
        before = asked(robot)
        command = [sys.executable, str(FROZEN), endpoint, SITE]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
            assert other.stdout is not None
            other.stdout.readline()
            after = asked(robot)
            other.send_signal(signal.SIGKILL)
        robot.close()
    more = max(after) - max(before)
    print(
        f"a frozen robot with 6000 pending questions: a healthy one is answered in p50 "
        f"{median(after):.1f}, at most {max(after):.1f} ms; without p50 {median(before):.1f}, at "
        f"most {max(before):.1f} ms (at most {MOST_DELAY_MS:.0f} more)"
    )
    return more <= MOST_DELAY_MS


def fleet(network: Network, port: int, pid: int, world: World) -> bool:
    """Print how many robots are served, and whether anything acknowledged is lost."""
    heard = scans_of(world, 64)
    robots = [Robot(network, f"fleet-{number}", timeout_s=20.0) for number in range(ROBOTS)]
    for number, robot in enumerate(robots):
        particles = LARGE_PARTICLES if number < LARGE else SMALL_PARTICLES
        robot.open(SITE, particles=particles, seed=number, sensor=COUNTING)
    poses = 0

    def count(_sample: object) -> None:
        nonlocal poses
        poses += 1

    watching = network.session.declare_subscriber("homsense/@v1/dev/*/pose", count)
    acknowledged: dict[str, int] = {}
    waits: list[float] = []
    lock = threading.Lock()

    def scan(robot: Robot, number: int) -> None:
        started = time.perf_counter()
        seq = robot.scan(heard[number % len(heard)]).seq
        with lock:
            waits.append(time.perf_counter() - started)
            acknowledged[robot.device] = max(seq, acknowledged.get(robot.device, 0))

    before = steps_taken(port)
    cpu, started, ticks = cpu_s(pid), time.perf_counter(), 0
    pending = []
    with ThreadPoolExecutor(64) as pool:
        while time.perf_counter() - started < FLEET_S:
            for number, robot in enumerate(robots):
                for _ in range(10):
                    robot.move({"forward_m": 0.01}, dt_s=0.01)
                if (number + ticks) % 10 == 0:
                    pending.append(pool.submit(scan, robot, number + ticks))
            ticks += 1
            time.sleep(max(0.0, started + 0.1 * ticks - time.perf_counter()))
        sent_s = time.perf_counter() - started
        for job in pending:
            job.result()
    wall = time.perf_counter() - started
    share = (cpu_s(pid) - cpu) / wall
    taken = steps_taken(port) - before
    short = [r.device for r in robots if r.last().seq < acknowledged.get(r.device, 0)]
    lost = metric(port, "homsense_device_inputs_lost_total")
    watching.undeclare()  # type: ignore[no-untyped-call]
    for robot in robots:
        robot.close()
    p50, p99 = np.percentile(np.array(waits) * 1e3, [50, 99])
    print(
        f"fleet: {ROBOTS} robots at 10 Hz ({LARGE} of {LARGE_PARTICLES} particles, the rest of "
        f"{SMALL_PARTICLES}), 10 deltas a message, a scan a second each, {sent_s:.0f} s: "
        f"{ticks / sent_s:.1f} messages a second each, {len(waits)} scans acknowledged in p50 "
        f"{p50:.0f} p99 {p99:.0f} ms, {len(short)} of them lost; {lost:.0f} motions lost; "
        f"{taken:.0f} steps, {poses} poses; CPU {100 * share:.0f} % of a core"
    )
    return not short


def step_s(port: int) -> float:
    """Return how long the service has been at steps, seconds."""
    return metric(port, 'homsense_stage_seconds_sum{stage="step"}')


def filter_s(port: int) -> float:
    """Return how long the filter has run, seconds."""
    return metric(port, 'homsense_stage_seconds_sum{stage="filter"}')


def steps_taken(port: int) -> float:
    """Return how many steps the service has taken."""
    return metric(port, "homsense_steps_total")


def metric(port: int, name: str) -> float:
    """Return a metric of the service."""
    lines = call(port, "GET", "/metrics", b"").decode().splitlines()
    return sum(float(line.split()[-1]) for line in lines if line.startswith(name))


if __name__ == "__main__":
    sys.exit(main())
