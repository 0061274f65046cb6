"""``homsense demo``: the whole path on a simulated downtown, with numbers and pictures."""

import gzip
import json
import time
from pathlib import Path

from homsense_client import Client
from homsense_client.streaming import connect
from homsense_fleet.driver import Crowd
from homsense_fleet.world import downtown_44
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from homsense_cli.demo_run import (
    Moment,
    Run,
    Ways,
    drive_robot,
    every,
    final_median,
    learn,
    map_world,
    prepare_site,
)
from homsense_cli.figures import draw_all
from homsense_cli.local_service import free_port, local_service

LENGTH_M = 1500.0
TIMEOUT_S = 300.0


def run_demo(seed: int, out: Path, console: Console) -> dict[str, object]:
    """Map downtown-44 with simulated phones, localize a robot, write report and figures.

    Parameters
    ----------
    seed : int
        Decides world, paths and noise.
    out : pathlib.Path
        Directory of the report and the figures.
    console : rich.console.Console
        Where progress and numbers go.

    Returns
    -------
    dict
        The report.
    """
    started = time.monotonic()
    world = downtown_44(seed)
    bars = Progress(
        TextColumn("{task.description:<28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
    )
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        local_service(zenoh_listen=json.dumps([endpoint])) as url,
        Client(url, timeout_s=TIMEOUT_S) as client,
        connect(endpoint) as network,
        bars,
    ):
        site = world.name
        prepare_site(client, site, world)
        crowd = Crowd(seed)
        total = crowd.phones * crowd.scans_each
        posted = bars.add_task(f"{crowd.phones} phones post scans", total=total)
        map_world(url, site, world, crowd, lambda count: bars.advance(posted, count))
        bars.update(posted, total=bars.tasks[posted].completed)
        grown = client.get_complex(site)
        console.print(
            f"complex: {grown.observations} observations, {grown.landmarks} landmarks, "
            f"{grown.facets} facets, b0 = {grown.betti[0]}, b1 = {grown.betti[1]}; "
            f"the map has {len(world.city.buildings)} buildings"
        )
        simulated = bars.add_task("the crowd is placed, the site learns")
        learnt = learn(
            client, site, lambda done, of: bars.update(simulated, completed=done, total=of)
        ).learnt
        if learnt is not None:
            console.print(
                f"learnt from scans alone: range {learnt.range_m:.0f} m, {learnt.dropout:.0%} "
                f"missed; the crowd {'has found' if learnt.knows_crowd else 'does not know'} its "
                f"place; hops 1 to {learnt.hops[-1]}, a scan tells "
                f"{learnt.information_bits[len(learnt.hops) - 1]:.1f} bits"
            )
        driven = bars.add_task("robot drives, metres", total=round(LENGTH_M))

        def on_moment(moment: Moment) -> None:
            bars.update(driven, completed=round(moment.travelled_m))
            if moment.travelled_m % 100 == 0:
                console.print(
                    f"{moment.travelled_m:5.0f} m: error {moment.error_m:6.1f} m"
                    f"   (motion and walls only: {moment.baseline_m:6.1f} m)"
                    f"   zenoh {'=' if moment.is_same else '!'}= REST"
                )

        moments, snapshots, hops = drive_robot(
            Ways(client, network), site, world, seed=seed, length_m=LENGTH_M, on_moment=on_moment
        )
        run = Run(
            scenario=world.name,
            seed=seed,
            buildings=len(world.city.buildings),
            complex=grown,
            hops=hops,
            map_document=world.map_document(),
            transmitters=world.places(),
            facets=client.export_complex(site, "facets")["facets"],
            height_maps=[client.height_map(site, radius) for radius in hops],
            moments=moments,
            snapshots=snapshots,
        )
    return _write(run, out, started, console)


def _write(run: Run, out: Path, started: float, console: Console) -> dict[str, object]:
    out.mkdir(parents=True, exist_ok=True)
    recorded = run.as_json()
    (out / "run.json.gz").write_bytes(gzip.compress(json.dumps(recorded).encode()))
    with console.status("drawing the figures"):
        pictures = draw_all(recorded, out)
    report: dict[str, object] = {
        "scenario": run.scenario,
        "seed": run.seed,
        "buildings": run.buildings,
        "landmarks": run.complex.landmarks,
        "scans": run.complex.observations,
        "facets": run.complex.facets,
        "b0": run.complex.betti[0],
        "b1": run.complex.betti[1],
        "error_m": [round(moment.error_m, 2) for moment in every(run.moments, 100.0)],
        "final_median_error_m": round(final_median(run.moments, lambda m: m.error_m), 2),
        "baseline_no_homology_m": round(final_median(run.moments, lambda m: m.baseline_m), 2),
        "steps": len(run.moments),
        "steps_equal_over_rest_and_zenoh": sum(moment.is_same for moment in run.moments),
        "seconds": round(time.monotonic() - started, 1),
    }
    (out / "report.json").write_text(json.dumps(report, indent=1) + "\n")
    console.print(
        f"median error over the last 300 m: {report['final_median_error_m']} m "
        f"(motion and walls only: {report['baseline_no_homology_m']} m)"
    )
    console.print(
        f"over REST and zenoh {report['steps_equal_over_rest_and_zenoh']} of {report['steps']} "
        "poses are the same, to the last bit"
    )
    for path in [out / "report.json", *pictures]:
        console.print(f"wrote {path}", soft_wrap=True)
    return report
