"""A service that starts with a long log: from the start of the process to its first answer.

Scans of a simulated crowd are copied under new names until there are enough; the complex grows as
it would, since copies of a scan are other scans of the same places. Exits 1 beyond 5 s.
"""

import argparse
import sys
import tempfile
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from homsense_fleet.device import phone_scans
from homsense_fleet.world import downtown_44
from homsense_service.records import SiteConfig, StoredScan
from homsense_service.schemas import ScanIn, readings
from homsense_service.settings import Settings
from homsense_service.sites import SiteRegistry
from homsense_service.store import SqliteStore
from load import cpu_s, seeded, serving

from homsense.engine import warmed

MOST_S, PHONES, COUNT, BATCH = 5.0, 100, 200, 5000


def main() -> int:
    """Fill a store, start a service on it, return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=1_000_000)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        data = Path(directory)
        facets, tail = fill(data, given.scans)
        size = (data / "homsense.sqlite3").stat().st_size / 2**20
        started = time.monotonic()
        with serving(data, "auto") as (_, pid):
            wall, cpu = time.monotonic() - started, cpu_s(pid)
        started = time.monotonic()
        with serving(data / "empty", "auto") as (_, pid):
            empty_wall, empty_cpu = time.monotonic() - started, cpu_s(pid)
    print(
        f"{given.scans} scans, {facets} facets, {tail} behind the checkpoint, {size:.0f} MiB: "
        f"{wall:.1f} s to the first answer, CPU {cpu:.1f} s; an empty store {empty_wall:.1f} s, "
        f"CPU {empty_cpu:.1f} s"
    )
    return int(wall > MOST_S)


def fill(data: Path, count: int) -> tuple[int, int]:
    """Write a site of so many scans; return its facets, and scans behind the checkpoint."""
    world = downtown_44(0)
    walked = [
        stored(scan)
        for phone in range(PHONES)
        for scan in phone_scans(world, f"p{phone}", seeded(phone), count=COUNT)
    ]
    with closing(SqliteStore(data)) as store:
        sites = SiteRegistry(store, Settings(data=data), warmed, time.time)
        with closing(sites):
            site, _ = sites.put("town", SiteConfig())
            sites.put_map(site, world.map_document())
            for first in range(0, count, BATCH):
                numbers = range(first, min(count, first + BATCH))
                scans = [
                    replace(walked[n % len(walked)], scan_id=f"copy {n // len(walked)} {n}")
                    for n in numbers
                ]
                sites.add_scans(site, scans)
            found = site.complex.landmark_complex.n_facets
        kept = store.checkpoint("town")
        assert kept is not None
        tail = sum(1 for _ in store.scans("town", kept.through))
    return found, tail


def stored(scan: dict[str, object]) -> StoredScan:
    """Return a posted scan as it is kept."""
    heard = readings(ScanIn.model_validate(scan).landmarks)
    return StoredScan(str(scan["device"]), str(scan["scan_id"]), 1.7e9, heard)


if __name__ == "__main__":
    sys.exit(main())
