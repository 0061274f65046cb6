"""Draw a recorded crowd before and after it has found its place, for docs/accuracy/.

Above: every walk by its own account, from a common start. Below: the same scans on the map, and
the ground that they cover. Prints how far the places are from the true ones, before and after each
walk was smoothed. Needs the folder of recorded data.
"""

import sys
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from accuracy import OUT
from homsense_cli.accuracy.crowd import walk_scan
from homsense_cli.accuracy.walks import CELL_M
from homsense_cli.figures import STYLE
from homsense_cli.recorded import WALL_TOLERANCE_M, Floor, crowd_scans, floor_names, read_floor
from matplotlib import pyplot as plt

from homsense import FreeSpace, SiteMap, register_crowd, smooth
from homsense.registered.registration import COMPASS_RAD

GROUND, COVERED, WALK = "#e4e6ea", "#c5d9e6", "#2f6f9f"


def true_places(floor: Floor, posted: list[dict[str, Any]]) -> np.ndarray:
    """Return where scans were made; for judging only."""
    made = [(floor.traces[scan["device"]], scan["observed_at"]) for scan in posted]
    return np.array([trace.position(t_s - trace.t0_s) for trace, t_s in made])


def main() -> int:
    """Draw; return the exit code."""
    directory = Path(sys.argv[1]) / "ilc20"
    names = floor_names(directory)
    mpl.use("Agg")
    with mpl.rc_context(STYLE):
        _, axes = plt.subplots(2, len(names), figsize=(10, 7.5))
        for name, above, below in zip(names, *axes, strict=True):
            floor = read_floor(directory, name)
            site_map = SiteMap.from_geojson(floor.map_document)
            space = FreeSpace.of(site_map, CELL_M)
            posted = list(crowd_scans(floor, []))
            scans = list(map(walk_scan, posted))
            marks = [time.process_time()]
            raw = register_crowd(scans, space, rotation_sd_rad=COMPASS_RAD)
            marks.append(time.process_time())
            found = smooth(raw, scans, site_map, space.widened(WALL_TOLERANCE_M))
            marks.append(time.process_time())
            truth = true_places(floor, posted)[found.source]
            errors = [np.median(np.linalg.norm(one.xy - truth, axis=1)) for one in (raw, found)]
            print(
                f"{name}: {found.size} scans, median error {errors[0]:.1f} m, smoothed "
                f"{errors[1]:.1f} m; {marks[1] - marks[0]:.1f} and {marks[2] - marks[1]:.1f} s CPU"
            )
            own = np.array([(scan.x_m, scan.y_m) for scan in scans])[found.source]
            ground = space.grid.centers()[space.free[:-1]]
            covered = ground[found.covers(ground)]
            below.plot(*ground.T, "s", color=GROUND, markersize=1.1, zorder=0)
            below.plot(*covered.T, "s", color=COVERED, markersize=1.1, zorder=1)
            for walk in np.unique(found.walk):
                here = found.walk == walk
                above.plot(*own[here].T, color=WALK, linewidth=0.6, alpha=0.7)
                below.plot(*found.xy[here].T, color=WALK, linewidth=0.6, alpha=0.7)
            above.set_title(f"{name}: {len(np.unique(found.walk))} walks, {found.size} scans")
            below.set_title(
                f"cost {found.registration.cost_m:.1f} m, covered {len(covered) / len(ground):.0%}"
            )
            for ax in (above, below):
                ax.set_aspect("equal")
                ax.set_xlabel("m")
        plt.savefig(OUT / "registered.png")
    print("wrote registered.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
