"""Both engines against GUDHI: random relations, persistent ranks, city and mall neighborhoods.

Exits with 1 when one answer differs.
"""

import random
import sys

import gudhi_peer
import numpy as np
from mall import FLOORS, mall_scans
from synthetic_city import city, scans

from homsense import LandmarkComplex, sense_local_homology
from homsense.engine import PYTHON, compiled
from homsense.facet_table import Ragged

SEED, N_RELATIONS, N_RANKS, N_CITY, N_MALL = 1, 10_000, 1_000, 1_000, 60
MOST_TRIANGLES = 3_000_000
ENGINES = [engine for engine in (PYTHON, compiled()) if engine]


def table() -> list[str]:
    """Return what was compared and how often an answer differed."""
    rows = [
        f"Seed {SEED}; engines: {', '.join(engine.name for engine in ENGINES)}.",
        "",
        "| compared with GUDHI | cases | mismatches | seen among them |",
        "|---|---|---|---|",
        _relations(),
        _ranks(),
        _cities(),
    ]
    return rows + [_mall(floor) for floor in FLOORS]


def _random_relation(rng: random.Random) -> list[list[int]]:
    """Return rows that may be empty, single, repeated, sparse (many holes) or dense."""
    points, size = rng.randint(1, 90), rng.choice([1, 2, 2, 3, 5, 9])
    rows = [
        sorted(rng.sample(range(points), min(points, rng.randint(0, size))))
        for _ in range(rng.randint(0, 220))
    ]
    return [*rows, *rng.choices(rows, k=3)] if rows else rows


def _named(rows: list[list[int]]) -> list[frozenset[str]]:
    return [frozenset(map(str, row)) for row in rows]


def _relations() -> str:
    rng = random.Random(SEED)
    wrong = most_holes = most_parts = empty = 0
    for _ in range(N_RELATIONS):
        rows = _random_relation(rng)
        grown = LandmarkComplex.from_observations(_named(rows), PYTHON)
        known = gudhi_peer.betti(gudhi_peer.two_skeleton(grown)) if grown.n_facets else (0, 0)
        wrong += any(grown.run_by(engine).betti_numbers() != known for engine in ENGINES)
        most_holes, most_parts = max(most_holes, known[1]), max(most_parts, known[0])
        empty += not grown.n_facets
    seen = f"b1 up to {most_holes}, b0 up to {most_parts}, {empty} empty"
    return f"| (b0, b1) of random relations | {N_RELATIONS} | {wrong} | {seen} |"


def _ranks() -> str:
    rng = random.Random(SEED + 1)
    wrong = most = 0
    for _ in range(N_RANKS):
        rows = [row for row in _random_relation(rng)[:60] if row]
        end = rng.randint(0, len(rows))
        known = gudhi_peer.rank(rows[:end], rows)
        for engine in ENGINES:
            wrong += engine.history(Ragged.of(rows), [end, len(rows)]).rank(0, 1) != known
        most = max(most, known)
    return f"| persistent ranks of H_1 | {N_RANKS} | {wrong} | rank up to {most} |"


def _cities() -> str:
    wrong = cases = most = 0
    for town in range(10):
        dropout = 0.15 if town % 2 else 0.0
        rng = np.random.Generator(np.random.PCG64([SEED, town]))
        heard = [
            frozenset(name for name in sorted(scan) if rng.random() >= dropout)
            for scan in scans(city(town, 400, (55.0, 90.0)[town // 5]), town, 4000).named()
        ]
        grown = LandmarkComplex.from_observations(heard, PYTHON)
        for visible in [scan for scan in heard if scan][: N_CITY // 10]:
            wrong += _differs(grown, visible, town % 2 + 1) is True
            cases += 1
            most = max(most, sense_local_homology(grown, visible, [town % 2 + 1])[0].holes)
    return f"| (b0, b1) of city neighborhoods | {cases} | {wrong} | b1 up to {most} |"


def _differs(grown: LandmarkComplex, visible: frozenset[str], hops: int) -> bool | None:
    """Tell whether an engine differs from GUDHI; None when GUDHI could not hold it."""
    (level,) = sense_local_homology(grown, visible, [hops])
    sizes = [len(facet) for facet in level.subcomplex.facets]
    if sum(n * (n - 1) * (n - 2) // 6 for n in sizes) > 40 * MOST_TRIANGLES:
        return None
    skeleton = gudhi_peer.two_skeleton(level.subcomplex)
    if skeleton[2].shape[1] > MOST_TRIANGLES:
        return None
    known = gudhi_peer.betti(skeleton)
    return any(
        sense_local_homology(grown.run_by(engine), visible, [hops])[0].betti != known
        for engine in ENGINES
    )


def _mall(name: str) -> str:
    heard = mall_scans(name, -60.0)
    if not heard:
        return f"| (b0, b1) on the mall floor {name} | 0 | - | no recordings at hand |"
    grown = LandmarkComplex.from_observations(heard, PYTHON)
    asked = heard[:: len(heard) // N_MALL][:N_MALL]
    found = [_differs(grown, visible, hops) for visible in asked for hops in (1, 2)]
    finished = [answer for answer in found if answer is not None]
    seen = f"-60 dBm, 1 and 2 hops; {len(found) - len(finished)} too large for GUDHI"
    return f"| (b0, b1) on the mall floor {name} | {len(finished)} | {sum(finished)} | {seen} |"


if __name__ == "__main__":
    lines = table()
    print("\n".join(lines))
    sys.exit(any(line.split("|")[3].strip() not in {"0", "-"} for line in lines[4:]))
