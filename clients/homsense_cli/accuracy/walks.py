"""Recorded walks: each against the complex of all other phones of its floor."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homsense import Delta, FreeSpace, HeadingPrior, Prior, Reading, SiteMap, UniformPrior
from homsense import visible_landmarks as visible
from homsense_cli.accuracy.legs import Leg
from homsense_cli.accuracy.scene import Scene, tuned
from homsense_cli.recorded import (
    HEADING_STD_RAD,
    STEP_STD,
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
    """

    directory: Path
    floors: tuple[str, ...] = ()
    min_rssi_dbm: float = -60.0
    max_age_s: float = 3.0
    limit: int | None = None


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
    floor = read_floor(recorded.directory, name)
    site_map = SiteMap.from_geojson(floor.map_document)
    free_space = FreeSpace.of(site_map, CELL_M)

    def seen(readings: list[dict[str, Any]]) -> frozenset[str]:
        heard = [Reading(entry["id"], entry["rssi"], entry["age_s"]) for entry in readings]
        return visible(heard, min_rssi_dbm=recorded.min_rssi_dbm, max_age_s=recorded.max_age_s)

    everything = [seen(scan["landmarks"]) for scan in crowd_scans(floor, [])]
    model = tuned(free_space, everything, hops, seed=0)
    walks = []
    for chain in floor.chains[: recorded.limit]:
        crowd = [seen(scan["landmarks"]) for scan in crowd_scans(floor, chain)]
        scene = Scene.of(site_map, free_space, crowd, model)
        legs = list(_legs(scene, walk_events(floor, chain), seen))
        walks.append(Walk(scene, legs, _compass(floor, chain)))
    return walks


def _legs(scene: Scene, events: list[WalkEvent], seen: Seen) -> Iterator[Leg]:
    for event in events:
        delta, counts = Delta(), None
        if event.delta is not None:
            delta = Delta(*body_motion(event.delta), std=STEP_STD)
        if event.readings is not None:
            counts = scene.profiles.mean_holes(seen(event.readings))
        yield Leg(event.truth, delta, counts)


def _compass(floor: Floor, chain: list[str]) -> Prior:
    return UniformPrior(HeadingPrior(start_heading(floor, chain), HEADING_STD_RAD))
