"""Halves of recorded crowds: where they come to lie, and whether they know when that is wrong.

Each half has the phones that a hash of its own chooses. Rewrites docs/accuracy/thin.md; needs the
folder of recorded data. Fails when too few of those that lie wrong are called doubtful, or too
many of the others.
"""

import hashlib
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from accuracy import OUT
from homsense_cli.accuracy.crowd import walk_scan
from homsense_cli.accuracy.walks import CELL_M
from homsense_cli.recorded import crowd_scans, floor_names, read_floor
from registered_figure import true_places

from homsense import FreeSpace, SiteMap, register_crowd
from homsense.registered.registration import COMPASS_RAD, Registration

HALVES, WRONG_M = 12, 10.0
ALARMED, DISTURBED = 0.8, 0.2
HEADINGS = "floor | half | scans | cost m | next | mirror | strain | doubtful | m from the truth"


class Half(NamedTuple):
    """Where a half of a crowd lies."""

    floor: str
    number: int
    scans: int
    registration: Registration
    error_m: float

    @property
    def cells(self) -> tuple[object, ...]:
        """What a row of the table says."""
        found = self.registration
        return (
            self.floor,
            self.number,
            self.scans,
            f"{found.cost_m:.2f}",
            f"{found.margin_m:+.2f}" if len(found.placements) > 1 else "none",
            f"{found.mirror_margin_m:+.2f}",
            f"{found.strain:.2f}",
            "yes" if found.is_doubtful else "",
            f"{self.error_m:.1f}",
        )


def half(folder: Path, which: tuple[str, int]) -> Half:
    """Place one half of a crowd."""
    name, number = which
    floor = read_floor(folder, name)
    posted = [scan for scan in crowd_scans(floor, []) if is_in(scan["device"], number)]
    space = FreeSpace.of(SiteMap.from_geojson(floor.map_document), CELL_M)
    found = register_crowd(map(walk_scan, posted), space, rotation_sd_rad=COMPASS_RAD)
    errors = np.linalg.norm(found.xy - true_places(floor, posted)[found.source], axis=1)
    return Half(name, number, found.size, found.registration, float(np.median(errors)))


def is_in(device: str, number: int) -> bool:
    """Tell whether a phone belongs to a half."""
    return hashlib.sha256(f"{number}{device}".encode()).digest()[0] % 2 == 0


def table(halves: list[Half]) -> Iterator[str]:
    """Yield the lines of the document."""
    yield "# Halves of the recorded crowds"
    yield ""
    yield "By rising strain. Made by `benchmarks/thin_crowds.py`."
    yield ""
    yield f"| {HEADINGS} |"
    yield "|---" * (1 + HEADINGS.count("|")) + "|"
    for one in sorted(halves, key=lambda one: one.registration.strain):
        yield "| " + " | ".join(map(str, one.cells)) + " |"


def main() -> int:
    """Measure, write, and say what is wrong; return the exit code."""
    folder = Path(sys.argv[1]) / "ilc20"
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        which = product(floor_names(folder), range(HALVES))
        halves = list(pool.map(partial(half, folder), which))
    lines = list(table(halves))
    (OUT / "thin.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines[4:]))
    wrong = [one.registration.is_doubtful for one in halves if one.error_m > WRONG_M]
    right = [one.registration.is_doubtful for one in halves if one.error_m <= WRONG_M]
    print(
        f"median of the halves {np.median([one.error_m for one in halves]):.1f} m, mean "
        f"{np.mean([one.error_m for one in halves]):.1f} m; called doubtful: {sum(wrong)} of "
        f"{len(wrong)} that lie more than {WRONG_M:.0f} m off, {sum(right)} of {len(right)} others"
    )
    return int(sum(wrong) < ALARMED * len(wrong) or sum(right) > DISTURBED * len(right))


if __name__ == "__main__":
    sys.exit(main())
