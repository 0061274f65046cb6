"""Kill and freeze a service again and again while robots stream over zenoh.

Robots move at 100 Hz and scan now and then; they only ever ask again. Every scan that was
acknowledged must be in the journal of its session with the digest that the robot was told, no
number twice, and the whole store must verify. Gaps and lost motions, which nobody promised, are
counted. Exits 1 when anything is amiss.
"""

import argparse
import json
import random
import signal
import sys
import tempfile
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

from homsense_cli.local_service import free_port
from homsense_cli.stored import verify
from homsense_client import Retry
from homsense_client.streaming import Network, Robot, connect
from homsense_service.store import SqliteStore
from kill_storm import RING, Killed
from rich.console import Console

ROBOTS, PARTICLES = 8, 300
PATIENT = Retry(attempts=200, longest_s=1.0)
SQUARE = [[0, 0], [60, 0], [60, 60], [0, 60], [0, 0]]


class Walker:
    """A robot that never gives up, and what it was told."""

    def __init__(self, network: Network, number: int) -> None:
        self._robot = Robot(network, f"r{number}", retry=PATIENT, timeout_s=1.0)
        self.told: list[tuple[int, str]] = []
        self.gaps = self.lost = self.sent = 0
        self._robot.on_event(self._take)
        options: dict[str, Any] = {
            "particles": PARTICLES,
            "seed": number,
            "sensor": {"type": "homology"},
        }
        self.session = self._robot.open("ring", **options).id

    def _take(self, event: dict[str, Any]) -> None:
        if event["code"] == "gap":
            self.gaps += 1
            self.lost += event["lost"]

    def walk(self, over: threading.Event, rng: random.Random) -> None:
        """Move and scan until it is over."""
        while not over.is_set():
            for _ in range(rng.randrange(5, 60)):
                self._robot.move({"forward_m": 0.02, "turn_rad": 0.01}, dt_s=0.01)
                self.sent += 1
                time.sleep(0.01)
            pose = self._robot.scan(rng.choice(RING))
            self.told.append((pose.seq, pose.digest))
        self._robot.leave()


def main() -> int:
    """Run the storm; return 1 when anything is amiss."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as directory:
        service = Killed(Path(directory), ZENOH_LISTEN=json.dumps([endpoint]))
        fill(service)
        with connect(endpoint, timeout_s=20.0) as network:
            walkers = [Walker(network, number) for number in range(ROBOTS)]
            over = threading.Event()
            threads = [
                threading.Thread(target=w.walk, args=(over, random.Random(f"{chosen.seed} {n}")))
                for n, w in enumerate(walkers)
            ]
            for thread in threads:
                thread.start()
            storm(service, rng, chosen.kills)
            over.set()
            for thread in threads:
                thread.join()
        service.kill(signal.SIGTERM)
        return report(Path(directory), walkers, service, chosen)


def storm(service: Killed, rng: random.Random, kills: int) -> None:
    """Kill, end or freeze the service."""
    for _ in range(kills):
        time.sleep(rng.uniform(0.5, 3.0))
        how = rng.choices(["kill", "end", "freeze"], [7, 1, 2])[0]
        if how == "freeze":
            service.process.send_signal(signal.SIGSTOP)
            time.sleep(rng.uniform(0.2, 6.0))
            service.process.send_signal(signal.SIGCONT)
            continue
        service.kill(signal.SIGKILL if how == "kill" else signal.SIGTERM)
        service.start()
    time.sleep(3.0)


def report(data: Path, walkers: list[Walker], service: Killed, chosen: argparse.Namespace) -> int:
    """Compare what was told with what is on disk; print it."""
    missing = twice = 0
    with closing(SqliteStore(data)) as store:
        for walker in walkers:
            events = list(store.events(walker.session))
            digests = {event.seq: json.loads(event.body)[3] for event in events}
            twice += len(events) - len(digests)
            missing += sum(digests.get(seq) != digest for seq, digest in walker.told)
    is_sound = verify(data, Console(quiet=True))
    told = sum(len(walker.told) for walker in walkers)
    sent, gaps, lost = (
        sum(getattr(walker, name) for walker in walkers) for name in ("sent", "gaps", "lost")
    )
    print(
        f"{chosen.kills} kills, ends and freezes (seed {chosen.seed}), {service.starts} starts, "
        f"{ROBOTS} robots: {told} scans acknowledged, {missing} of them missing or different, "
        f"{twice} steps twice; {sent} motions sent, {lost} told as lost in {gaps} gaps; the store "
        f"{'verifies' if is_sound else 'DOES NOT VERIFY'}"
    )
    return 1 if missing or twice or not is_sound else 0


def fill(service: Killed) -> None:
    """Make a site with a map and scans round it."""
    service.ask("PUT", "/v1/sites/ring", {"s_max_m": 30.0, "hops": [1, 2]})
    polygon = {"type": "Polygon", "coordinates": [SQUARE], "frame": "local"}
    service.ask("PUT", "/v1/sites/ring/map", polygon)
    scans = [
        {"device": "phone", "scan_id": str(n), "observed_at": 1.7e9 + n, "landmarks": seen}
        for n, seen in enumerate(RING)
    ]
    service.ask("POST", "/v1/sites/ring/scans", {"scans": scans})


if __name__ == "__main__":
    sys.exit(main())
