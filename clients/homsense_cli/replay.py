"""``homsense replay``: recorded real walks through the REST service, scored against the truth."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Any

from homsense_client import Client, Complex, ResponseError, Session
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from homsense_cli.local_service import local_service
from homsense_cli.recorded import (
    HEADING_STD_RAD,
    STEP_STD,
    WALL_TOLERANCE_M,
    Floor,
    WalkEvent,
    body_motion,
    chosen_floors,
    crowd_scans,
    no_walk,
    read_floor,
    start_heading,
    walk_events,
)

BATCH = 100
SENSORS = ("homology", "registered", "both", "auto")
UNPLACED = "none: not placed"
SITE = {
    "max_age_s": 3.0,
    "landmark_key": "bssid",
    "s_max_m": 30.0,
    "wall_tolerance_m": WALL_TOLERANCE_M,
}


@dataclass(frozen=True, slots=True)
class Score:
    """How one walk went.

    Parameters
    ----------
    floor : str
        Where.
    length_m : float
        Way walked, metres.
    complex : Complex
        Built from all other phones.
    sensor : str
        What the session measured; nothing when the crowd has found no place.
    error_m : float
        Median distance to the truth with it, metres.
    baseline_m : float
        The same with motion and walls only.
    """

    floor: str
    length_m: float
    complex: Complex
    sensor: str
    error_m: float
    baseline_m: float


@dataclass(frozen=True, slots=True)
class Replay:
    """What to replay, and how to sense.

    Parameters
    ----------
    floors : tuple of str
        Which floors; all when empty.
    min_rssi_dbm : float
        Weakest strength that counts as visible, dBm.
    sensor : str
        ``auto``, ``homology``, ``registered`` or ``both``.
    hops : tuple of int
        Neighborhoods whose holes are counted.
    seed : int
        Of the particles.
    limit : int, optional
        Most walks of a floor.
    """

    floors: tuple[str, ...] = ()
    min_rssi_dbm: float = -60.0
    sensor: str = "registered"
    hops: tuple[int, ...] = (1, 2)
    seed: int = 0
    limit: int | None = None


def run_replay(directory: Path, replay: Replay, console: Console) -> list[Score]:
    """Replay the walks of recorded floors, each against the complex of all other phones.

    Parameters
    ----------
    directory : pathlib.Path
        The recordings.
    replay : Replay
        What to replay.
    console : rich.console.Console
        Where progress and the table go.

    Returns
    -------
    list of Score
        One for each walk.
    """
    names = chosen_floors(directory, replay.floors)
    floors = [read_floor(directory, name) for name in names]
    if not any(floor.chains for floor in floors):
        raise ValueError(no_walk(directory))
    scores: list[Score] = []
    with (
        local_service(cell_m=1.0, height_cell_m=2.0) as url,
        Client(url, timeout_s=300.0) as client,
        Progress(console=console) as bars,
    ):
        for floor in floors:
            walks = floor.chains[: replay.limit]
            if not walks:
                bars.console.print(no_walk(floor.name))
                continue
            task = bars.add_task(f"{floor.name}: {len(walks)} walks", total=len(walks))
            for chain in walks:
                scores.append(_replay_walk(client, floor, chain, replay))
                bars.advance(task)
    console.print(_table(scores))
    return scores


def _replay_walk(client: Client, floor: Floor, chain: list[str], replay: Replay) -> Score:
    site = floor.name
    client.put_site(site, min_rssi_dbm=replay.min_rssi_dbm, hops=list(replay.hops), **SITE)
    client.put_map(site, floor.map_document)
    scans = iter(crowd_scans(floor, chain))
    while batch := list(islice(scans, BATCH)):
        client.post_scans(site, batch)
    events = walk_events(floor, chain)
    prior = {
        "type": "uniform",
        "heading": {"mean_rad": start_heading(floor, chain), "std_rad": HEADING_STD_RAD},
    }
    opened = partial(client.open_session, site, seed=replay.seed, prior=prior)
    try:
        phone = opened(sensor={"type": replay.sensor})
        sensor = phone.info.sensor
    except ResponseError as error:
        if error.code != "registration_failed":
            raise
        phone, sensor = opened(sensor={"type": "homology"}), UNPLACED
        events = [replace(event, readings=None) for event in events]
    with phone, opened(sensor={"type": "homology"}) as blind:
        errors = [_advance(phone, blind, event) for event in events]
    grown = client.get_complex(site)
    client.delete_site(site)
    return Score(
        floor.name,
        sum(event.delta["length_m"] for event in events if event.delta),
        grown,
        sensor,
        median(error for error, _ in errors),
        median(baseline for _, baseline in errors),
    )


def _advance(phone: Session, blind: Session, event: WalkEvent) -> tuple[float, float]:
    delta: dict[str, Any] = {}
    if event.delta is not None:
        moved = zip(("forward_m", "left_m", "turn_rad"), body_motion(event.delta), strict=True)
        delta = {**dict(moved), "std": list(STEP_STD)}
    here = phone.step(delta, event.readings, t=event.t_s).best
    other = blind.step(delta, t=event.t_s).best
    return math.dist((here.x_m, here.y_m), event.truth), math.dist(
        (other.x_m, other.y_m), event.truth
    )


def _table(scores: list[Score]) -> Table:
    table = Table(
        title="median error in metres over each walk, unknown start",
        caption="bold: medians over the walks",
    )
    for heading in ("floor", "way m", "facets", "b0", "b1", "sensor", "error", "motion + walls"):
        table.add_column(heading, justify="left" if heading in ("floor", "sensor") else "right")
    for score in scores:
        table.add_row(
            score.floor,
            f"{score.length_m:.0f}",
            str(score.complex.facets),
            *map(str, score.complex.betti),
            score.sensor,
            f"{score.error_m:.1f}",
            f"{score.baseline_m:.1f}",
        )
    for floor in dict.fromkeys(score.floor for score in scores):
        _add_median(table, floor, [score for score in scores if score.floor == floor])
    _add_median(table, "all", scores)
    return table


def _add_median(table: Table, name: str, scores: list[Score]) -> None:
    def middle(read: Callable[[Score], float], among: Iterable[Score] = scores) -> str:
        return f"{median(map(read, among)):.1f}"

    table.add_row(
        f"{name}, {len(scores)} walks",
        "",
        "",
        "",
        "",
        "",
        middle(lambda score: score.error_m),
        middle(lambda score: score.baseline_m),
        style="bold",
    )
