"""Recorded walks: each against the complex of all other phones of its floor."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from scipy.spatial import cKDTree

from homsense import (
    Delta,
    FreeSpace,
    HeadingPrior,
    Hearing,
    Prior,
    SiteMap,
    UniformPrior,
    WalkScan,
)
from homsense import visible_landmarks as visible
from homsense_cli.accuracy.crowd import RegisteredCrowd, heard, walk_scan
from homsense_cli.accuracy.legs import Leg, sightings
from homsense_cli.accuracy.scene import Scene, tuned
from homsense_cli.recorded import (
    HEADING_STD_RAD,
    MIN_CHAIN_M,
    STEP_STD,
    WALL_TOLERANCE_M,
    Floor,
    WalkEvent,
    body_motion,
    crowd_scans,
    read_floor,
    start_heading,
    walk_events,
)

Seen = Callable[[list[dict[str, Any]]], frozenset[str]]

CELL_M = 1.0
BINARY_DBM, COVERED_M = -65.0, 8.0


@dataclass(frozen=True, slots=True)
class Recorded:
    """Which recordings, and what of a scan counts.

    Parameters
    ----------
    directory : pathlib.Path
        The recordings.
    floors : tuple of str
        Which floors; all when empty.
    min_rssi_dbm : float
        Weakest strength that counts as visible, dBm.
    max_age_s : float
        Oldest sighting that counts, seconds.
    limit : int, optional
        Most walks of a floor.
    min_chain_m : float
        Shortest walk, metres.
    binary : bool
        Whether the registered complex knows only which transmitters are in view.
    compass : bool
        Whether the phone that is localized has one.
    crowd : float
        Share of the phones that make up the crowd.
    """

    directory: Path
    floors: tuple[str, ...] = ()
    min_rssi_dbm: float = -60.0
    max_age_s: float = 3.0
    limit: int | None = None
    min_chain_m: float = MIN_CHAIN_M
    binary: bool = False
    compass: bool = True
    crowd: float = 1.0

    @property
    def hearing(self) -> Hearing:
        """What of a scan counts for likeness."""
        if self.binary:
            return Hearing(weakest_dbm=BINARY_DBM, exponent=0.0)
        return Hearing()


@dataclass(frozen=True)
class Walk:
    """A recorded walk on a site that has never seen it."""

    scene: Scene
    legs: list[Leg]
    prior: Prior


def floor_walks(recorded: Recorded, name: str, hops: tuple[int, ...] | None) -> list[Walk]:
    """Return the long walks of a floor.

    Parameters
    ----------
    recorded : Recorded
        The recordings.
    name : str
        The floor.
    hops : tuple of int, optional
        Neighborhoods; chosen by the site when absent.

    Returns
    -------
    list of Walk
        Range, dropout and evenness are learnt once for the floor; the complex of each walk holds
        the scans of all other phones.
    """
    floor = read_floor(recorded.directory, name, recorded.min_chain_m)
    if not floor.chains:
        return []
    site_map = SiteMap.from_geojson(floor.map_document)
    free_space = FreeSpace.of(site_map, CELL_M)

    def seen(readings: list[dict[str, Any]]) -> frozenset[str]:
        return visible(
            heard(readings), min_rssi_dbm=recorded.min_rssi_dbm, max_age_s=recorded.max_age_s
        )

    everything = [seen(scan["landmarks"]) for scan in crowd_scans(floor, [])]
    model = tuned(free_space, everything, hops, seed=0)
    reachable = free_space.widened(WALL_TOLERANCE_M)
    walks = []
    for number, chain in enumerate(floor.chains[: recorded.limit]):
        scans = list(_thinned(crowd_scans(floor, chain), recorded.crowd))
        placed = RegisteredCrowd.of(
            map(walk_scan, scans), site_map, free_space, reachable, recorded.hearing
        )
        crowd = [(scan["device"], seen(scan["landmarks"])) for scan in scans]
        scene = Scene.of(site_map, reachable, crowd, model, placed)
        rng = np.random.default_rng(number)
        been = _been(floor, chain, {scan["device"] for scan in scans})
        legs = [
            replace(leg, is_covered=bool(been.query(leg.truth)[0] <= COVERED_M))
            for leg in _legs(scene, walk_events(floor, chain), seen, rng)
        ]
        prior = _compass(floor, chain) if recorded.compass else UniformPrior()
        walks.append(Walk(scene, legs, prior))
    return walks


def floor_crowd(recorded: Recorded, name: str) -> tuple[list[WalkScan], FreeSpace]:
    """Return the whole crowd of a floor, and where one can walk there.

    Parameters
    ----------
    recorded : Recorded
        The recordings.
    name : str
        The floor.

    Returns
    -------
    crowd : list of WalkScan
        In the frames of their walks.
    free_space : FreeSpace
        Of its map.
    """
    floor = read_floor(recorded.directory, name, recorded.min_chain_m)
    free_space = FreeSpace.of(SiteMap.from_geojson(floor.map_document), CELL_M)
    return list(map(walk_scan, crowd_scans(floor, []))), free_space


def _been(floor: Floor, chain: list[str], devices: set[str]) -> "cKDTree[None]":
    """Return where the crowd has truly made its scans."""
    places = [
        trace.position(t_s)
        for trace in floor.traces.values()
        if trace.id in devices - {*chain}
        for t_s, readings in trace.scans
        if readings
    ]
    return cKDTree(np.array(places).reshape(-1, 2))


def _thinned(scans: Iterable[dict[str, Any]], share: float) -> Iterator[dict[str, Any]]:
    """Yield the scans of a share of the phones."""
    for scan in scans:
        if crc32(scan["device"].encode()) < share * 2**32:
            yield scan


def _legs(
    scene: Scene, events: list[WalkEvent], seen: Seen, rng: np.random.Generator
) -> Iterator[Leg]:
    so_far: list[frozenset[str]] = []
    for event in events:
        if event.delta is not None:
            yield Leg(event.truth, Delta(*body_motion(event.delta), std=STEP_STD), None)
        if event.readings is not None:
            so_far.append(seen(event.readings))
            found = sightings(scene, heard(event.readings), rng)
            yield Leg(event.truth, Delta(), scene.counts(so_far), *found)


def _compass(floor: Floor, chain: list[str]) -> Prior:
    return UniformPrior(HeadingPrior(start_heading(floor, chain), HEADING_STD_RAD))
