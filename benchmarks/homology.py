"""Local hole counts of city neighborhoods: ours against GUDHI, CPU time, same run.

GUDHI gets its best case: the edges and triangles of the neighborhood are listed for it beforehand
and are not charged. Ours is the whole query: hop search, extraction, b0 and b1.
"""

import time
from collections.abc import Callable
from itertools import combinations
from statistics import median
from typing import Any

import gudhi
import numpy as np
from homsense_fleet.device import phone_scans
from homsense_fleet.world import Radio, downtown_44

from homsense import LandmarkComplex, sense_local_homology

SEED, QUERIES, HOPS = 1, 60, (2,)
CASES = [(197, 72.0), (600, 72.0), (1200, 72.0)]


def main() -> None:
    """Print one row for each density of transmitters."""
    print(f"seed {SEED}, {QUERIES} queries a row, {HOPS[0]} hops, median CPU milliseconds")
    print(f"{'landmarks':>9} {'a scan':>6} {'facets':>6} {'ours':>8} {'GUDHI-2D':>9} {'ratio':>6}")
    for count, range_m in CASES:
        world = downtown_44(SEED, n_transmitters=count, radio=Radio(s_max_m=range_m))
        scans = [
            frozenset(entry["id"] for entry in scan["landmarks"])
            for phone in range(40)
            for scan in phone_scans(
                world, str(phone), np.random.Generator(np.random.PCG64([SEED, phone])), count=130
            )
        ]
        grown = LandmarkComplex.from_observations(scans)
        ours, theirs = [], []
        for visible in scans[:: len(scans) // QUERIES][:QUERIES]:
            spent, (level,) = _timed(sense_local_homology, grown, visible, HOPS)
            other, betti = _timed(_gudhi, _two_skeleton(level.subcomplex))
            if betti != level.betti:
                message = f"GUDHI counts {betti}, we count {level.betti}"
                raise AssertionError(message)
            ours.append(spent)
            theirs.append(other)
        size = sum(map(len, scans)) / len(scans)
        print(
            f"{count:9d} {size:6.1f} {len(grown.facets):6d} {1e3 * median(ours):8.2f} "
            f"{1e3 * median(theirs):9.2f} {median(theirs) / median(ours):6.1f}"
        )


def _timed(question: Callable[..., Any], *arguments: object) -> tuple[float, Any]:
    started = time.thread_time()
    answer = question(*arguments)
    return time.thread_time() - started, answer


def _two_skeleton(local: LandmarkComplex) -> list[list[int]]:
    number = {landmark: n for n, landmark in enumerate(sorted(local.landmarks))}
    faces = {
        face
        for facet in local.facets
        for size in (1, 2, 3)
        for face in combinations(sorted(number[landmark] for landmark in facet), size)
    }
    return [list(face) for face in sorted(faces, key=lambda face: (len(face), face))]


def _gudhi(faces: list[list[int]]) -> tuple[int, int]:
    tree = gudhi.SimplexTree()
    for size in (1, 2, 3):
        batch = [face for face in faces if len(face) == size]
        if batch:
            tree.insert_batch(np.array(batch).T, np.zeros(len(batch)))
    tree.compute_persistence(
        homology_coeff_field=2, min_persistence=-1.0, persistence_dim_max=True
    )
    betti = [*tree.betti_numbers(), 0, 0]
    return betti[0], betti[1]


if __name__ == "__main__":
    main()
