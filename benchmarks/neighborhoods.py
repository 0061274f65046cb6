"""Local hole counts of city neighborhoods: ours against GUDHI, CPU time, same run.

GUDHI gets its best case: vertices, edges and triangles of the neighborhood are listed for it
beforehand and are not charged. Ours is the whole query from identifiers to b0 and b1: hop search,
extraction, homology. Each figure is the median over neighborhoods of the best of some tries, as
many for everyone; every answer is compared.
"""

from collections.abc import Callable
from functools import partial
from statistics import median
from typing import NamedTuple

import gudhi_peer
from synthetic_city import city, scans
from timing import best_of

from homsense import LandmarkComplex, LocalHomology, sense_local_homology
from homsense.engine import PYTHON, Engine, compiled

SEED, N_SCANS, NEAR, FAR = 1, 20_000, 2, 3
SOME, FEW, MANY = 8, 3, 15


class Case(NamedTuple):
    """A density of transmitters."""

    transmitters: int
    range_m: float
    queries: int


CASES = [
    Case(197, 110.0, 100),
    Case(450, 55.0, 100),
    Case(490, 110.0, 40),
    Case(1100, 55.0, 40),
    Case(1000, 110.0, 8),
    Case(2200, 55.0, 8),
    Case(1450, 110.0, 4),
    Case(3300, 55.0, 4),
]


def table() -> list[str]:
    """Return the table, one row for each case."""
    rows = [
        (
            f"Seed {SEED}, {N_SCANS} scans of a city of 44 buildings at a pitch of 86 m; near is "
            f"{NEAR} hops, far {FAR}; CPU milliseconds, medians of the best of {MANY} tries "
            f"(of {FEW} where there are {SOME} neighborhoods or fewer)."
        ),
        "",
        (
            "| transmitters, range | a scan | neighborhoods | landmarks, facets, triangles "
            "| GUDHI-2D | numba | ratio | Python | ratio | far | near + far, to far |"
        ),
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    return rows + [_row(case) for case in CASES]


def _row(case: Case) -> str:
    heard = scans(city(SEED, case.transmitters, case.range_m), SEED, N_SCANS).named()
    fast = compiled()
    assert fast
    grown = LandmarkComplex.from_observations(heard, fast)
    sense_local_homology(grown, heard[0], [NEAR, FAR])
    asked = [scan for scan in heard[7 :: N_SCANS // case.queries] if scan][: case.queries]
    ours, python, theirs, far, both = ([] for _ in range(5))
    sizes = []
    best = partial(best_of, FEW if case.queries <= SOME else MANY)
    for visible in asked:
        spent, level = best(_question(grown, fast, visible, [NEAR]))
        ours.append(spent)
        spent, other = best(_question(grown, PYTHON, visible, [NEAR]))
        python.append(spent)
        skeleton = gudhi_peer.two_skeleton(level.subcomplex)
        spent, betti = best(partial(gudhi_peer.betti, skeleton))
        theirs.append(spent)
        if not betti == level.betti == other.betti:
            message = f"GUDHI counts {betti}, we count {level.betti} and {other.betti}"
            raise AssertionError(message)
        far.append(best(_question(grown, fast, visible, [FAR]))[0])
        both.append(best(_question(grown, fast, visible, [NEAR, FAR]))[0])
        sizes.append((level.n_landmarks, level.n_facets, skeleton[2].shape[1]))
    typical = " / ".join(f"{median(size):.0f}" for size in zip(*sizes, strict=True))
    peer = median(theirs)
    return (
        f"| {case.transmitters}, {case.range_m:.0f} m | {sum(map(len, heard)) / N_SCANS:.1f} "
        f"| {len(asked)} | {typical} | {1e3 * peer:.1f} | {1e3 * median(ours):.3f} "
        f"| **{peer / median(ours):.0f}** | {1e3 * median(python):.1f} "
        f"| **{peer / median(python):.1f}** | {1e3 * median(far):.3f} "
        f"| {median(both) / median(far):.2f} |"
    )


def _question(
    grown: LandmarkComplex, engine: Engine, visible: frozenset[str], hops: list[int]
) -> Callable[[], LocalHomology]:
    run = grown.run_by(engine)
    return lambda: sense_local_homology(run, visible, hops)[0]
