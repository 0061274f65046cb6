"""How inserting, asking and memory grow: with the number of scans, and with the site."""

import time
from statistics import median

import numpy as np
from synthetic_city import Scans, city, scans
from timing import best_of

from homsense import LandmarkComplex, sense_local_homology
from homsense.engine import compiled
from homsense.facet_table import FacetTable, Ragged

SEED, BATCH, EDGE_M, TRIES = 1, 1000, 220.0, 15
SATURATING = [(197, 110.0, 1_000_000), (1100, 55.0, 1_000_000), (2200, 55.0, 200_000)]
SITES = [(7, 400), (22, 3_950), (70, 40_000), (111, 100_600)]


def insertion_table() -> list[str]:
    """Return what a scan costs after 10^3 to 10^6 scans of the same site."""
    marks = [1_000, 10_000, 100_000, 1_000_000]
    rows = [
        (
            f"Seed {SEED}; CPU microseconds a scan over the block of scans before the mark, "
            f"batches of {BATCH}: from identifiers, and (in brackets) from numbers."
        ),
        "",
        "| transmitters, range | " + " | ".join(f"{mark:,}" for mark in marks) + " | facets |",
        "|---|" + "---|" * (len(marks) + 1),
    ]
    for count, range_m, total in SATURATING:
        heard = scans(city(SEED, count, range_m), SEED, total)
        named = heard.named()
        grown = LandmarkComplex()
        table = FacetTable()
        for number in range(count):
            table.number(f"{number:06x}")
        cells, spent, bare, since = [], 0.0, 0.0, 0
        for first in range(0, total, BATCH):
            started = time.thread_time()
            grown = grown.with_observations(named[first : first + BATCH])
            spent += time.thread_time() - started
            bare += _inserted(table, heard, first)
            if first + BATCH in marks:
                block = first + BATCH - since
                cells.append(f"{1e6 * spent / block:.1f} ({1e6 * bare / block:.2f})")
                spent, bare, since = 0.0, 0.0, first + BATCH
        cells += ["-"] * (len(marks) - len(cells))
        rows.append(
            f"| {count}, {range_m:.0f} m | " + " | ".join(cells) + f" | {grown.n_facets} |"
        )
    return rows


def _inserted(table: FacetTable, heard: Scans, first: int) -> float:
    engine = compiled()
    assert engine
    ends = heard.ends[first : first + BATCH + 1]
    ends, values = ends[np.append(True, np.diff(ends) > 0)], heard.heard[ends[0] : ends[-1]]
    started = time.thread_time()
    engine.insert(table, Ragged(ends - ends[0], values))
    return time.thread_time() - started


def site_table() -> list[str]:
    """Return what a query costs, and what a landmark takes, on larger and larger sites."""
    rows = [
        (
            f"Seed {SEED}, 55 m, about 7 landmarks and 10 scans a landmark; near is 2 hops. "
            "Microseconds of CPU, median of 300 neighborhoods at least "
            f"{EDGE_M:.0f} m from the edge, each the best of {TRIES} tries."
        ),
        "",
        "| transmitters | scans | facets | near | far | bytes a landmark, packed (as grown) |",
        "|---|---|---|---|---|---|",
    ]
    for blocks, count in SITES:
        town = city(SEED, count, 55.0, blocks)
        named = scans(town, SEED, 10 * count).named()
        grown = LandmarkComplex()
        for first in range(0, len(named), 50 * BATCH):
            grown = grown.with_observations(named[first : first + 50 * BATCH])
        asked = [scan for scan in scans(town, SEED + 1, 300, EDGE_M).named() if scan]
        near, far = ([_best(grown, scan, hops) for scan in asked] for hops in (2, 3))
        table = grown._table  # noqa: SLF001
        packed = FacetTable.holding(grown.version, table.names)
        rows.append(
            f"| {count:,} | {len(named):,} | {grown.n_facets:,} | {1e6 * median(near):.0f} "
            f"| {1e6 * median(far):.0f} "
            f"| {packed.n_bytes / grown.n_landmarks:.0f} "
            f"({table.n_bytes / grown.n_landmarks:.0f}) |"
        )
    return rows


def density_table() -> list[str]:
    """Return what a landmark takes at the densities of the first table."""
    rows = ["| a scan | bytes a landmark, packed |", "|---|---|"]
    for count, range_m in ((450, 55.0), (1100, 55.0), (2200, 55.0), (3300, 55.0)):
        heard = scans(city(SEED, count, range_m), SEED, 20_000)
        grown = LandmarkComplex.from_observations(heard.named())
        packed = FacetTable.holding(grown.version, grown._table.names)  # noqa: SLF001
        a_scan = len(heard.heard) / 20_000
        rows.append(f"| {a_scan:.1f} | {packed.n_bytes / grown.n_landmarks:.0f} |")
    return rows


def _best(grown: LandmarkComplex, visible: frozenset[str], hops: int) -> float:
    return best_of(TRIES, lambda: sense_local_homology(grown, visible, [hops]))[0]
