"""Kill a service again and again under load; nothing that it acknowledged may be missing.

Threads post scans to one site and steps to sessions on another. At random moments the process is
killed (SIGKILL, now and then SIGTERM) and started again; each request that got no answer is sent
once more. At the end every acknowledged scan must be in the log, none twice, the complex must be
the one of the log, and every answer to every step must be the one that an uninterrupted twin
gives, digest by digest. Exits 1 when anything differs.
"""

import argparse
import http.client
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import closing
from http import HTTPStatus
from pathlib import Path
from typing import Any

from homsense_cli.local_service import free_port
from homsense_service.store import SqliteStore

import homsense

POSTERS, ROBOTS, PARTICLES = 4, 6, 500
SERVER_ERROR = 500
RING = [[f"l{n}", f"l{(n + 1) % 12}", f"l{(n + 2) % 12}"] for n in range(12)]


class Killed:
    """A service that is killed and started again on the same port and data."""

    def __init__(self, data: Path, **settings: str) -> None:
        self.data, self.port, self._settings = data, free_port(), settings
        self.starts = 0
        self.start()

    def start(self) -> None:
        """Start it and wait until it is ready."""
        settings = {"DATA": self.data, "PORT": self.port, "ENGINE": "python", **self._settings}
        given = {f"HOMSENSE_{name}": str(value) for name, value in settings.items()}
        command = [sys.executable, "-m", "homsense_service"]
        self.process = subprocess.Popen(
            command, env={**os.environ, **given}, stderr=subprocess.DEVNULL
        )
        self.starts += 1
        for _ in range(1200):
            try:
                if self.ask("GET", "/readyz") is not None:
                    return
            except OSError:
                time.sleep(0.02)
        message = "the service does not start"
        raise RuntimeError(message)

    def kill(self, with_signal: int) -> None:
        """End it."""
        self.process.send_signal(with_signal)
        self.process.wait(30)

    def ask(self, method: str, path: str, body: Any = None) -> Any:  # noqa: ANN401 - JSON
        """Return the answer to one request; OSError when there is none."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        try:
            text = None if body is None else json.dumps(body)
            connection.request(method, path, text, {"content-type": "application/json"})
            answer = connection.getresponse()
            read = answer.read()
        except http.client.HTTPException as error:
            raise OSError(str(error)) from error
        finally:
            connection.close()
        if answer.status == HTTPStatus.SERVICE_UNAVAILABLE:
            message = "not now"
            raise OSError(message)
        if answer.status >= HTTPStatus.BAD_REQUEST:
            message = f"{method} {path}: {answer.status} {read.decode()}"
            raise AssertionError(message)
        return json.loads(read) if read else {}


class Load:
    """What was sent, and what was acknowledged."""

    def __init__(self, service: Killed, seed: int) -> None:
        self.service, self.seed = service, seed
        self.over = threading.Event()
        self.acknowledged: set[tuple[str, str]] = set()
        self.answers: dict[int, list[tuple[list[dict[str, Any]], dict[str, Any]]]] = {}
        self.sessions: dict[int, str] = {}
        self.again = 0
        self.failures: list[str] = []

    def run(self) -> list[threading.Thread]:
        """Begin."""
        jobs = [(self._post, number) for number in range(POSTERS)]
        jobs += [(self._drive, number) for number in range(ROBOTS)]
        threads = [threading.Thread(target=self._guarded, args=job) for job in jobs]
        for thread in threads:
            thread.start()
        return threads

    def _guarded(self, job: Any, number: int) -> None:  # noqa: ANN401 - a method
        try:
            job(number)
        except AssertionError as error:
            self.failures.append(str(error))

    def insist(self, method: str, path: str, body: Any) -> Any:  # noqa: ANN401 - JSON
        """Ask until there is an answer."""
        while True:
            try:
                return self.service.ask(method, path, body)
            except OSError:
                self.again += 1
                time.sleep(0.1)

    def _post(self, number: int) -> None:
        rng, count = random.Random(f"{self.seed} scans {number}"), 0
        while not self.over.is_set():
            scans: list[dict[str, Any]] = []
            for _ in range(rng.randint(1, 20)):
                count += 1
                seen = rng.sample(range(60), rng.randint(2, 6))
                scans.append(
                    {
                        "device": f"p{number}",
                        "scan_id": str(count),
                        "observed_at": 1.7e9 + count,
                        "landmarks": [{"id": f"t{n}", "rssi": -60.0 - n} for n in seen],
                    }
                )
            told = self.insist("POST", "/v1/sites/crowd/scans", {"scans": scans})
            assert told["accepted"] + told["duplicate"] == len(scans), told
            self.acknowledged |= {(scan["device"], scan["scan_id"]) for scan in scans}

    def _drive(self, number: int) -> None:
        rng, seq = random.Random(f"{self.seed} steps {number}"), 0
        session = self.sessions[number]
        history = self.answers.setdefault(number, [])
        while not self.over.is_set():
            steps = []
            for _ in range(rng.randint(1, 4)):
                seq += 1
                steps.append(step(rng, seq))
            path = f"/v1/sessions/{session}/steps"
            history.append((steps, self.insist("POST", path, {"steps": steps})))


def step(rng: random.Random, seq: int) -> dict[str, Any]:
    """Return one step of a robot."""
    motion = {"forward_m": rng.uniform(0.0, 2.0), "turn_rad": rng.gauss(0.0, 0.2)}
    heard = {"landmarks": rng.choice(RING)} if rng.random() < 0.5 else {}  # noqa: PLR2004
    return {"seq": seq, "t": float(seq), "delta": motion, **heard}


def prepare(service: Killed, seed: int) -> dict[int, str]:
    """Make both sites and open the sessions."""
    house = [[0, 0], [30, 0], [30, 30], [0, 30], [0, 0]]
    document = {"type": "Polygon", "coordinates": [house], "frame": "local"}
    service.ask("PUT", "/v1/sites/crowd", {})
    service.ask("PUT", "/v1/sites/yard", {"hops": [1, 2], "s_max_m": 20.0})
    service.ask("PUT", "/v1/sites/yard/map", document)
    scans = [
        {"device": "p", "scan_id": str(n), "observed_at": 1.7e9, "landmarks": seen}
        for n, seen in enumerate(RING)
    ]
    service.ask("POST", "/v1/sites/yard/scans", {"scans": scans})
    opened = {}
    for number in range(ROBOTS):
        wanted = {"particles": PARTICLES, "seed": seed * 100 + number}
        opened[number] = service.ask("POST", "/v1/sites/yard/sessions", wanted)["session"]
    return opened


def storm(data: Path, kills: int, seed: int) -> Load:
    """Run the load through all kills."""
    rng = random.Random(seed)
    service = Killed(data)
    load = Load(service, seed)
    load.sessions = prepare(service, seed)
    threads = load.run()
    for number in range(kills):
        time.sleep(rng.uniform(0.0, 1.2))
        service.kill(signal.SIGTERM if rng.random() < 0.1 else signal.SIGKILL)  # noqa: PLR2004
        service.start()
        if number % 20 == 19:  # noqa: PLR2004
            print(f"  {number + 1} kills, {len(load.acknowledged)} scans acknowledged", flush=True)
    load.over.set()
    for thread in threads:
        thread.join(60)
    told = service.ask("GET", "/v1/sites/crowd/complex")
    load.told = told  # type: ignore[attr-defined]
    service.kill(signal.SIGTERM)
    return load


def check_scans(data: Path, load: Load) -> list[str]:
    """Return what is wrong with the log of scans."""
    with closing(SqliteStore(data)) as store:
        logged = [entry.scan for entry in store.scans("crowd")]
    keys = {(scan.device, scan.scan_id) for scan in logged}
    wrong = [f"acknowledged and missing: {key}" for key in load.acknowledged - keys]
    if len(keys) != len(logged):
        wrong.append("scans are in the log twice")
    told = load.told  # type: ignore[attr-defined]
    if told["observations"] != len(logged):
        wrong.append(f"{told['observations']} counted, {len(logged)} in the log")
    seen = ({reading.landmark for reading in scan.readings} for scan in logged)
    if told["digest"] != homsense.LandmarkComplex.from_observations(seen).digest():
        wrong.append("the complex is not the one of the log")
    print(f"scans: {len(load.acknowledged)} acknowledged, {len(logged)} in the log")
    return wrong


def check_steps(data: Path, load: Load, seed: int) -> list[str]:
    """Return what differs from a twin that is never interrupted."""
    twin, wrong, answers = Killed(data), [], 0
    sessions = prepare(twin, seed)
    for number, history in load.answers.items():
        path = f"/v1/sessions/{sessions[number]}/steps"
        for steps, answer in history:
            told = twin.ask("POST", path, {"steps": steps})
            answers += 1
            if {**told, "session": ""} != {**answer, "session": ""}:
                wrong.append(f"robot {number}, step {answer['seq']} differs from its twin")
                break
    twin.kill(signal.SIGTERM)
    print(f"steps: {answers} answers of {ROBOTS} sessions, compared with their twins")
    return wrong


def main() -> int:
    """Run the storm; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        started = time.monotonic()
        load = storm(Path(first), given.kills, given.seed)
        wrong = load.failures + check_scans(Path(first), load)
        wrong += check_steps(Path(second), load, given.seed)
    print(
        f"{given.kills} kills, seed {given.seed}, {time.monotonic() - started:.0f} s, "
        f"{load.again} requests sent again: {'nothing missing' if not wrong else 'FAILED'}"
    )
    for line in wrong[:20]:
        print(f"  {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
