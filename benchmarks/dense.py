"""Scans of hundreds of landmarks, which no list of faces could hold."""

import random
import time
from functools import partial

from timing import best_of

from homsense import LandmarkComplex, sense_local_homology

SEED, N_SCANS, N_NAMES, SIZE = 1, 200, 3000, 400


def table() -> list[str]:
    """Return what scans of 400 landmarks cost."""
    rng = random.Random(SEED)
    names = [f"{n:06x}" for n in range(N_NAMES)]
    starts = [rng.randrange(N_NAMES) for _ in range(N_SCANS)]
    heard = [
        frozenset(names[(start + i) % N_NAMES] for i in rng.sample(range(SIZE * 5 // 4), SIZE))
        for start in starts
    ]
    grown = LandmarkComplex.from_observations(heard[:1])
    sense_local_homology(grown, heard[0], [2])
    started = time.thread_time()
    for scan in heard[1:]:
        grown = grown.with_observation(scan)
    inserted = (time.thread_time() - started) / (N_SCANS - 1)
    mebibytes = grown._table.n_bytes / 2**20  # noqa: SLF001
    rows = [
        (
            f"Seed {SEED}; {N_SCANS} scans of {SIZE} landmarks out of windows of "
            f"{SIZE * 5 // 4} on a ring of {N_NAMES}; the complex takes {mebibytes:.1f} MiB."
        ),
        "",
        "| insert, ms a scan | hops | landmarks | (b0, b1) | query, ms |",
        "|---|---|---|---|---|",
    ]
    for hops in (1, 2, 4):
        spent, (level,) = best_of(1, partial(sense_local_homology, grown, heard[0], [hops]))
        rows.append(
            f"| {1e3 * inserted:.2f} | {hops} | {level.n_landmarks} | {level.betti} "
            f"| {1e3 * spent:.1f} |"
        )
    return rows
