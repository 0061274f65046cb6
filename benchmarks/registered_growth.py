"""What a registration costs as the crowd grows: ten times the scans, step by step.

Phones walk one generated town; each of the three sizes is laid out, placed and smoothed from
nothing, but for a twentieth of the walks, and those of a large crowd beyond what is laid out at
once, which join at last.
"""

import sys
import time
from itertools import pairwise

from homsense_cli.accuracy.crowd import walk_scan
from homsense_cli.accuracy.scene import WEAKEST_DBM
from homsense_fleet.driver import Crowd
from homsense_fleet.world import downtown_44

from homsense import (
    FreeSpace,
    Hearing,
    RadioMapLikelihood,
    SiteMap,
    extend,
    register_crowd,
    smooth,
)
from homsense.registered.placing import STAGES
from homsense.registered.registration import COMPASS_RAD

SEED, CELL_M, SCANS_EACH, QUERIES = 0, 2.0, 130, 200
SIZES = (1_000, 10_000, 100_000)
LATE = 20
AFTERWARDS = "smoothed", "joined", "mapped", "ms a scan"


def main() -> int:
    """Print a line for each size; return the exit code."""
    world = downtown_44(SEED)
    site_map = SiteMap.from_geojson(world.map_document())
    free_space = FreeSpace.of(site_map, CELL_M)
    sizes = [int(size) for size in sys.argv[1:]] or SIZES
    print(f"seed {SEED}, {len(world.ids)} transmitters; seconds of CPU")
    print(" scans placed", *(f"{stage:>11}" for stage in (*STAGES, *AFTERWARDS)))
    for size in sizes:
        phones = Crowd(SEED, -(-size // SCANS_EACH), SCANS_EACH)
        early = size - max(1, phones.phones // LATE) * SCANS_EACH
        scans = [
            walk_scan(scan)
            for number in range(phones.phones)
            for scan in phones.scans(world, number)
        ][:size]
        marks = [time.process_time()]
        found = register_crowd(
            scans[:early],
            free_space,
            hearing=Hearing(weakest_dbm=WEAKEST_DBM),
            rotation_sd_rad=COMPASS_RAD,
            on_stage=lambda _stage, marks=marks: marks.append(time.process_time()),  # type: ignore[misc]
        )
        found = smooth(found, scans, site_map, free_space)
        marks.append(time.process_time())
        found = extend(found, scans, site_map, free_space)
        marks.append(time.process_time())
        n_placed, found = found.size, found.thinned()
        weigh = RadioMapLikelihood(found, free_space)
        marks.append(time.process_time())
        begun = time.process_time()
        for scan in scans[:: max(1, size // QUERIES)]:
            sighting = found.sighting(scan.readings)
            if sighting is not None:
                weigh(sighting)
        each_ms = 1e3 * (time.process_time() - begun) / len(scans[:: max(1, size // QUERIES)])
        spent = [later - before for before, later in pairwise(marks)]
        print(
            f"{size:>6} {n_placed:>6}",
            *(f"{seconds:11.1f}" for seconds in (*spent, each_ms)),
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
