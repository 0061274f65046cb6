"""``homsense bench accuracy``: seeded runs side by side with their controls."""

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from homsense_cli.accuracy.run import (
    WEAKER,
    Control,
    Filter,
    Track,
    run_city,
    run_controls,
)
from homsense_cli.accuracy.scenario import IMUS, Scenario
from homsense_cli.accuracy.scene import Scene, prepare
from homsense_cli.accuracy.score import Score, Walks, by_walk, score, sign_test
from homsense_cli.accuracy.walks import Recorded, floor_walks
from homsense_cli.recorded import chosen_floors, no_walk

Result = TypeVar("Result")
Runs = dict[Control, Track]


@dataclass(frozen=True, slots=True)
class Plan:
    """What to measure.

    Parameters
    ----------
    scenarios : tuple of Scenario
        Generated worlds.
    imus : tuple of str
        Qualities of own motion in them.
    recorded : Recorded, optional
        Recorded walks.
    runs : int
        Robots in each world, and seeds of each recorded walk.
    length_m : float
        Way of each robot, metres.
    particles : int
        Pose hypotheses.
    hops : tuple of int, optional
        Neighborhoods; chosen by the site when absent.
    only : tuple of str
        Sensors and controls to run; all when empty.
    """

    scenarios: tuple[Scenario, ...] = ()
    imus: tuple[str, ...] = ("moderate",)
    recorded: Recorded | None = None
    runs: int = 32
    length_m: float = 1500.0
    particles: int = 8000
    hops: tuple[int, ...] | None = None
    only: tuple[Control, ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """One world under one quality of motion: its figures, and how surely they beat a control.

    Parameters
    ----------
    world, motion : str
        For people.
    site : dict
        What the site has learnt about itself.
    scores : dict of str to Score
        By control.
    p_value : dict of str to float
        Sign test of a sensor against each of its controls.
    walks : dict of str to Walks
        Figures walk by walk, for recorded walks.
    """

    world: str
    motion: str
    site: dict[str, Any]
    scores: dict[Control, Score]
    p_value: dict[str, float]
    walks: dict[Control, Walks] = field(default_factory=dict)

    @classmethod
    def of(cls, world: str, motion: str, scene: Scene, runs: Sequence[Runs]) -> "Row":
        """Return the figures of some runs."""
        tracks = {control: [run[control] for run in runs] for control in runs[0]}
        return cls(
            world,
            motion,
            scene.describe(),
            {control: score(of_control) for control, of_control in tracks.items()},
            {
                f"{sensor} > {control}": sign_test(tracks[sensor], tracks[control])
                for sensor, controls in WEAKER.items()
                for control in controls
                if sensor in tracks and control in tracks
            },
        )

    def by_walk(self, runs: Sequence[Runs], seeds: int) -> "Row":
        """Return the row with figures walk by walk; a walk has as many runs as seeds."""
        tracks = {control: [run[control] for run in runs] for control in runs[0]}
        walks = {
            control: by_walk(
                found,
                {other: tracks[other] for other in WEAKER.get(control, ()) if other in tracks},
                seeds,
            )
            for control, found in tracks.items()
        }
        return replace(self, walks=walks)

    def as_json(self) -> dict[str, Any]:
        """Return the row as JSON data."""
        return {
            "world": self.world,
            "motion": self.motion,
            "site": self.site,
            "scores": {control: found.as_json() for control, found in self.scores.items()},
            "p_value": self.p_value,
            "walks": {control: asdict(found) for control, found in self.walks.items()},
        }


def measure(plan: Plan, console: Console) -> list[Row]:
    """Run everything that a plan asks for, on all cores.

    Parameters
    ----------
    plan : Plan
        What to measure.
    console : rich.console.Console
        Where progress goes.

    Returns
    -------
    list of Row
        Worlds in the order of the plan, then floors.
    """
    bars = Progress(
        TextColumn("{task.description:<20}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
    )
    with bars, ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        rows = _measure_cities(plan, pool, bars)
        if plan.recorded is not None:
            rows += _measure_floors(plan, plan.recorded, pool, bars)
    return rows


def _measure_cities(plan: Plan, pool: ProcessPoolExecutor, bars: Progress) -> list[Row]:
    preparing = [pool.submit(prepare, scenario, plan.hops) for scenario in plan.scenarios]
    cities = _finished(bars, "sites tune", preparing)
    how = Filter(plan.particles, only=plan.only)
    running = [
        pool.submit(run_city, city, IMUS[imu], run, plan.length_m, how)
        for city in cities
        for imu in plan.imus
        for run in range(plan.runs)
    ]
    found = iter(_finished(bars, "robots drive", running))
    return [
        Row.of(city.scenario.name, imu, city.scene, list(islice(found, plan.runs)))
        for city in cities
        for imu in plan.imus
    ]


def _measure_floors(
    plan: Plan, recorded: Recorded, pool: ProcessPoolExecutor, bars: Progress
) -> list[Row]:
    names = chosen_floors(recorded.directory, recorded.floors)
    reading = [pool.submit(floor_walks, recorded, name, plan.hops) for name in names]
    read = zip(names, _finished(bars, "floors tune", reading), strict=True)
    floors = {name: walks for name, walks in read if walks}
    if not floors:
        raise ValueError(no_walk(recorded.directory, recorded.min_chain_m))
    for name in names:
        if name not in floors:
            bars.console.print(no_walk(name, recorded.min_chain_m))
    running = [
        pool.submit(
            run_controls,
            walk.scene,
            walk.legs,
            (number, run),
            Filter(plan.particles, walk.prior, plan.only),
        )
        for walks in floors.values()
        for number, walk in enumerate(walks)
        for run in range(plan.runs)
    ]
    found = iter(_finished(bars, "phones walk", running))
    rows, everything = [], []
    for name, walks in floors.items():
        runs = list(islice(found, plan.runs * len(walks)))
        rows.append(Row.of(name, "steps", walks[0].scene, runs).by_walk(runs, plan.runs))
        everything += runs
    total = Row.of("all floors", "steps", next(iter(floors.values()))[0].scene, everything)
    return [*rows, total.by_walk(everything, plan.runs)]


def _finished(bars: Progress, what: str, futures: Sequence[Future[Result]]) -> list[Result]:
    task = bars.add_task(what, total=len(futures))
    for _ in as_completed(futures):
        bars.advance(task)
    return [future.result() for future in futures]


def table(rows: Sequence[Row], plan: Plan) -> Table:
    """Return the figures for people.

    Parameters
    ----------
    rows : sequence of Row
        From `measure`.
    plan : Plan
        What was measured.

    Returns
    -------
    rich.table.Table
        A line for each sensor and each control.
    """
    shown = Table(
        box=box.SIMPLE_HEAD,
        title=(
            f"{plan.runs} runs a world or walk, {plan.particles} particles, unknown start; "
            f"robots drive {plan.length_m:.0f} m, their heading unknown too"
        ),
        caption=(
            "run, last fifth: median / 90 % of the error; final: median over the last 300 m, its "
            "median over the runs; <: share of the runs by that, %; found: way after which it is "
            "below 25 m for 100 m; in: share of the steps with the truth in the region, %; "
            "unmapped: share of the steps where no crowd has been, and of those where one has, "
            "whose status says that it has not, %; p: sign test that the sensor above beats the "
            "control; walks: median over the walks of the median error of each, how many end "
            "within 15 m, how many beat each control"
        ),
    )
    for heading in HEADINGS:
        shown.add_column(heading, justify="left" if heading in LEFT else "right", no_wrap=True)
    for row in rows:
        for line in lines(row):
            shown.add_row(*line)
        shown.add_section()
    return shown


LEFT = ("world", "motion", "measured")
FIGURES = (
    "run m",
    "last fifth m",
    "final m",
    "<15/25/50 m",
    "found m",
    "in 50/90/95 %",
    "unmapped %",
)
HEADINGS = (*LEFT, *FIGURES, "p", "walks")


def lines(row: Row) -> Iterator[tuple[str, ...]]:
    """Yield the cells of a row, one line for each control, as `HEADINGS` names them."""
    first = (row.world, row.motion)
    sensor = ""
    for control, found in row.scores.items():
        sensor = control if control in WEAKER else sensor
        p_value = row.p_value.get(f"{sensor} > {control}")
        told = "" if p_value is None else f"{p_value:.0e}"
        walks = row.walks.get(control)
        yield (*first, control, *_cells(found), told, "" if walks is None else str(walks))
        first = ("", "")


def _cells(found: Score) -> Iterator[str]:
    yield f"{found.median_m:.1f} / {found.p90_m:.0f}"
    yield f"{found.last_median_m:.1f} / {found.last_p90_m:.0f}"
    yield f"{found.final_median_m:.1f}"
    yield _percents(found.within_15_m, found.within_25_m, found.within_50_m)
    yield "never" if found.converged_m is None else f"{found.converged_m:.0f}"
    yield _percents(found.coverage_50, found.coverage_90, found.coverage_95)
    if found.told_unmapped is None:
        yield ""
    else:
        yield _percents(found.told_unmapped, found.wrongly_unmapped or 0.0)


def _percents(*shares: float) -> str:
    return "/".join(f"{100 * share:.0f}" for share in shares)


def run_bench(plan: Plan, out: Path, console: Console) -> list[Row]:
    """Measure, print the table and write ``accuracy.json``.

    Parameters
    ----------
    plan : Plan
        What to measure.
    out : pathlib.Path
        Directory of the results.
    console : rich.console.Console
        Where progress and the table go.

    Returns
    -------
    list of Row
        In the order of the plan.
    """
    rows = measure(plan, console)
    out.mkdir(parents=True, exist_ok=True)
    path = out / "accuracy.json"
    written = {"plan": asdict(plan), "rows": [row.as_json() for row in rows]}
    path.write_text(json.dumps(written, indent=1, default=str) + "\n")
    console.print(table(rows, plan))
    console.print(f"wrote {path}", soft_wrap=True)
    return rows
