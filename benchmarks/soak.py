"""Whether memory stays flat: steady work for a long time, resident memory once a minute.

Robots step, sessions come and go, readers of live poses too, phones post scans of places that are
known already. Exits 1 when the last third of the time needs 5 % more memory than the second.
"""

import argparse
import json
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from statistics import mean

import httpx
from kill_storm import RING
from load import resident_kib, serving

LIVE, PARTICLES, GROWN = 40, 2000, 1.05


def main() -> int:
    """Run; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    given = parser.parse_args()
    samples: list[float] = []
    with tempfile.TemporaryDirectory() as directory, serving(Path(directory)) as (port, pid):
        over = threading.Event()
        work = Work(f"http://127.0.0.1:{port}", over)
        jobs = (work.robots, work.phones, work.readers)
        threads = [threading.Thread(target=job) for job in jobs]
        for thread in threads:
            thread.start()
        for _ in range(max(3, round(given.minutes * 2))):
            time.sleep(30.0 * min(1.0, given.minutes))
            samples.append(resident_kib(pid) / 1024)
        over.set()
        for thread in threads:
            thread.join()
    third = len(samples) // 3
    before, after = mean(samples[third : 2 * third]), mean(samples[-third:])
    print(
        f"{given.minutes:.0f} minutes, {work.steps} steps, {work.scans} scans, "
        f"{work.opened} sessions opened and closed, {work.read} readers: resident memory "
        f"{samples[0]:.0f} MiB at first, {before:.1f} in the second third, {after:.1f} in the last"
    )
    print("MiB: " + " ".join(f"{sample:.0f}" for sample in samples))
    return int(after > GROWN * before)


class Work:
    """What is done all the time."""

    def __init__(self, url: str, over: threading.Event) -> None:
        self.url, self.over = url, over
        self.steps = self.scans = self.opened = self.read = 0
        self.names: list[str] = []
        with httpx.Client(base_url=url) as client:
            house = [[0, 0], [30, 0], [30, 30], [0, 30], [0, 0]]
            document = {"type": "Polygon", "coordinates": [house], "frame": "local"}
            client.put("/v1/sites/yard", json={"hops": [1, 2], "expected": "geometric"})
            client.put("/v1/sites/yard/map", json=document)

    def robots(self) -> None:
        """Step all sessions in turn; the oldest makes room for a new one after each round."""
        with httpx.Client(base_url=self.url, timeout=30.0) as client:
            seqs: dict[str, int] = {}
            while not self.over.is_set():
                if len(seqs) >= LIVE:
                    oldest = next(iter(seqs))
                    del seqs[oldest]
                    client.delete(f"/v1/sessions/{oldest}").raise_for_status()
                wanted = {"particles": PARTICLES, "contribute": False}
                answer = client.post("/v1/sites/yard/sessions", json=wanted)
                seqs[answer.json()["session"]] = 0
                self.opened += 1
                self.names = list(seqs)
                for name in list(seqs):
                    seqs[name] += 1
                    delta = {"forward_m": 1.0, "turn_rad": 0.3}
                    step = {"seq": seqs[name], "delta": delta, "landmarks": RING[self.steps % 12]}
                    path = f"/v1/sessions/{name}/steps"
                    client.post(path, json={"steps": [step]}).raise_for_status()
                    self.steps += 1
                    time.sleep(0.003)

    def phones(self) -> None:
        """Post scans of places that are known after the first round."""
        with httpx.Client(base_url=self.url, timeout=30.0) as client:
            while not self.over.is_set():
                scans = []
                for _ in range(10):
                    self.scans += 1
                    number = self.scans
                    scans.append(
                        {
                            "device": f"p{number % 50}",
                            "scan_id": str(number),
                            "observed_at": 1.7e9 + number,
                            "landmarks": RING[number % 12],
                        }
                    )
                body = {"scans": scans}
                client.post("/v1/sites/yard/scans", json=body).raise_for_status()
                time.sleep(0.1)

    def readers(self) -> None:
        """Read some live poses of a session, then of another."""
        with httpx.Client(base_url=self.url, timeout=5.0) as client:
            while not self.over.is_set():
                if not self.names:
                    time.sleep(0.1)
                    continue
                path = f"/v1/sessions/{self.names[-1]}/events"
                with suppress(httpx.ReadTimeout), client.stream("GET", path) as stream:
                    for number, line in enumerate(stream.iter_lines()):
                        if number > 8 or self.over.is_set():  # noqa: PLR2004
                            break
                        if line.startswith("data: "):
                            json.loads(line.removeprefix("data: "))
                self.read += 1


if __name__ == "__main__":
    sys.exit(main())
