"""Scans of real mall floors, where the recordings are at hand; and what they cost."""

import os
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from homsense_cli.recorded import read_floor
from numpy.typing import NDArray
from timing import best_of

from homsense import LandmarkComplex, sense_local_homology
from homsense.engine import PYTHON, compiled

FLOORS = ("site1_F2", "site1_F3", "site1_F4")
FRESH_S = 3.0
N_QUERIES, N_NUMPY = 60, 3


def mall_scans(floor: str, min_rssi_dbm: float) -> list[frozenset[str]]:
    """Return what was heard on a floor, scan by scan; nothing when there are no recordings."""
    where = Path(os.environ.get("HOMSENSE_RECORDINGS", "../shared/data")) / "ilc20"
    if not where.is_dir():
        return []
    heard = [
        frozenset(r["id"] for r in readings if r["rssi"] >= min_rssi_dbm and r["age_s"] <= FRESH_S)
        for trace in read_floor(where, floor).traces.values()
        for _, readings in trace.scans
    ]
    return [scan for scan in heard if scan]


def table() -> list[str]:
    """Return what local hole counts on real floors cost, beside a plain numpy transcription."""
    rows = [
        (
            "Recorded scans at -60 dBm, 2 hops; CPU milliseconds, median over "
            f"{N_QUERIES} neighborhoods, of {N_NUMPY} for numpy (edges and triangles from a cone "
            "in each facet, elimination over GF(2) on packed rows)."
        ),
        "",
        (
            "| floor | scans | facets | landmarks in the neighborhood | plain numpy | numba "
            "| ratio | Python | ratio |"
        ),
        "|---|---|---|---|---|---|---|---|---|",
    ]
    return rows + [_row(floor) for floor in FLOORS]


def _row(floor: str) -> str:
    heard = mall_scans(floor, -60.0)
    if not heard:
        return f"| {floor} | no recordings at hand |"
    fast = compiled()
    assert fast
    grown = LandmarkComplex.from_observations(heard, fast)
    reference = grown.run_by(PYTHON)
    asked = heard[:: len(heard) // N_QUERIES][:N_QUERIES]
    ours, python, plain, sizes = [], [], [], []
    sense_local_homology(grown, heard[0], [2])
    for number, visible in enumerate(asked):
        level = sense_local_homology(grown, visible, [2])[0]
        ours.append(best_of(3, partial(sense_local_homology, grown, visible, [2]))[0])
        python.append(best_of(1, partial(sense_local_homology, reference, visible, [2]))[0])
        sizes.append(level.n_landmarks)
        if number % (N_QUERIES // N_NUMPY) == 0:
            spent, b1 = best_of(1, partial(_plain_numpy, level.subcomplex))
            plain.append(spent)
            if b1 != level.holes:
                message = f"numpy counts {b1} holes, we count {level.holes}"
                raise AssertionError(message)
    return (
        f"| {floor} | {len(heard)} | {grown.n_facets} | {median(sizes):.0f} "
        f"| {1e3 * median(plain):.0f} | {1e3 * median(ours):.2f} "
        f"| **{median(plain) / median(ours):.0f}** | {1e3 * median(python):.1f} "
        f"| {median(plain) / median(python):.0f} |"
    )


def _plain_numpy(local: LandmarkComplex) -> int:
    """Return b1 as edges - rank d1 - rank d2, with b0 for rank d1."""
    number = {landmark: n for n, landmark in enumerate(sorted(local.landmarks))}
    facets = [np.sort([number[landmark] for landmark in facet]) for facet in local.facets]
    pairs = np.concatenate([_pairs(facet) for facet in facets])
    edges = np.unique(pairs[:, 0] * len(number) + pairs[:, 1])
    cones = np.concatenate(
        [
            np.column_stack([np.full(len(rest), facet[0]), rest])
            for facet in facets
            for rest in [_pairs(facet[1:])]
        ]
    )
    cones = np.unique(cones, axis=0)
    sides = [cones[:, [0, 1]], cones[:, [0, 2]], cones[:, [1, 2]]]
    columns = [np.searchsorted(edges, s[:, 0] * len(number) + s[:, 1]) for s in sides]
    matrix = np.zeros((len(cones), len(edges)), np.bool_)
    for column in columns:
        matrix[np.arange(len(cones)), column] = True
    parts = local.betti_numbers()[0]
    return len(edges) - (len(number) - parts) - _rank(np.packbits(matrix, axis=1), len(edges))


def _pairs(facet: NDArray[Any]) -> NDArray[Any]:
    first, second = np.triu_indices(len(facet), 1)
    return np.column_stack([facet[first], facet[second]]).astype(np.int64)


def _rank(rows: NDArray[np.uint8], n_columns: int) -> int:
    found = 0
    for column in range(n_columns):
        byte, bit = column // 8, np.uint8(128 >> column % 8)
        holders = np.flatnonzero(rows[found:, byte] & bit) + found
        if len(holders):
            rows[[found, holders[0]]] = rows[[holders[0], found]]
            rows[holders[1:]] ^= rows[found]
            found += 1
    return found
