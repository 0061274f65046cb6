"""The command line. Exit codes: 0 good, 1 failed, 2 misuse."""

import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from pydantic import ValidationError
from rich.console import Console

app = typer.Typer(
    help="Localization without survey, GPS or labels, by homological sensing.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

FAILED, MISUSE = 1, 2
TABLE_WIDTH = 176

SeedOption = Annotated[int, typer.Option(min=0, help="Decides world, paths and noise.")]
KeyOption = Annotated[
    str | None, typer.Option(envvar="HOMSENSE_KEY", help="An API key of the service.")
]
OutOption = Annotated[Path, typer.Option(file_okay=False, help="Directory for the results.")]


@app.command()
def serve(
    data: Annotated[Path | None, typer.Option(help="Directory of the store.")] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="Port.")] = None,
) -> None:
    """Serve until interrupted; options win over HOMSENSE_* variables."""
    from homsense_service.server import serve as run
    from homsense_service.settings import Settings

    given = {"data": data, "host": host, "port": port}
    run(Settings.model_validate({k: v for k, v in given.items() if v is not None}))


@app.command()
def demo(seed: SeedOption = 4, out: OutOption = Path("demo")) -> None:
    """Map a simulated downtown with phones, localize a robot, write report and figures."""
    from homsense_cli.demo import run_demo

    run_demo(seed, out, Console())


@app.command()
def figures(
    run: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="A run.json.gz.")],
    out: OutOption = Path("demo"),
) -> None:
    """Draw the paper's figures 2, 3 and 4 from a recorded run."""
    from homsense_cli.figures import draw_all
    from homsense_cli.maps import read_json

    for path in draw_all(read_json(run), out):
        typer.echo(path)


@app.command()
def fleet(
    url: Annotated[str, typer.Option(help="The service.")] = "http://127.0.0.1:8080",
    key: KeyOption = None,
    site: Annotated[str, typer.Option(help="Name of the site.")] = "downtown-44",
    map_file: Annotated[
        Path | None,
        typer.Option("--map", exists=True, dir_okay=False, help="GeoJSON or footprints."),
    ] = None,
    window_m: Annotated[
        float | None, typer.Option(min=50.0, help="Side of the busiest window of the footprints.")
    ] = None,
    transmitters: Annotated[int, typer.Option(min=1, help="How many there are.")] = 197,
    s_max_m: Annotated[float, typer.Option(min=1.0, help="Sensing range, metres.")] = 72.0,
    phones: Annotated[int, typer.Option(min=1, help="How many walk.")] = 40,
    scans: Annotated[int, typer.Option(min=1, help="Scans of each phone.")] = 130,
    robots: Annotated[int, typer.Option(min=0, help="How many drive, after that.")] = 0,
    zenoh_at: Annotated[
        str | None, typer.Option("--zenoh", help="Where robots stream; over REST when absent.")
    ] = None,
    seed: SeedOption = 0,
) -> None:
    """Map a site of a running service with simulated phones, and drive robots in it."""
    from homsense_fleet.driver import Crowd
    from homsense_fleet.world import Radio, downtown_44, world_from_geojson

    from homsense_cli.fleet import Fleet, drive_fleet, run_fleet
    from homsense_cli.maps import read_map

    radio = Radio(s_max_m=s_max_m)
    if map_file is None:
        world = downtown_44(seed, n_transmitters=transmitters, radio=radio)
    else:
        world = world_from_geojson(
            read_map(map_file, window_m), seed, n_transmitters=transmitters, radio=radio, name=site
        )
    run_fleet(url, site, world, Crowd(seed, phones, scans), Console(), key=key)
    if robots:
        drive_fleet(url, site, world, Fleet(robots, seed, zenoh_at), Console(), key=key)


@app.command()
def replay(
    directory: Annotated[Path, typer.Argument(exists=True, file_okay=False, help="Recordings.")],
    floor: Annotated[list[str] | None, typer.Option(help="A floor; all when absent.")] = None,
    min_rssi_dbm: Annotated[float, typer.Option(help="Weakest visible strength, dBm.")] = -60.0,
    hops: Annotated[list[int] | None, typer.Option(help="Neighborhoods; 1 and 2.")] = None,
    sensor: Annotated[str, typer.Option(help="homology, registered, both, auto.")] = "registered",
    seed: SeedOption = 0,
    limit: Annotated[int | None, typer.Option(min=1, help="Most walks of a floor.")] = None,
) -> None:
    """Replay recorded walks through the service and score them against the surveyed truth."""
    from homsense_cli.replay import SENSORS, Replay, run_replay

    if sensor not in SENSORS:
        message = f"--sensor must be one of {', '.join(SENSORS)}, not {sensor!r}"
        raise ValueError(message)
    levels = tuple(sorted(set(hops or [1, 2])))
    chosen = Replay(tuple(floor or ()), min_rssi_dbm, sensor, levels, seed, limit)
    run_replay(directory, chosen, Console())


@app.command()
def doctor(
    site: Annotated[str, typer.Argument(help="A site with a map and scans.")],
    url: Annotated[str, typer.Option(help="The service.")] = "http://127.0.0.1:8080",
    key: KeyOption = None,
    apply: Annotated[bool, typer.Option(help="Set what it advises.")] = False,
) -> None:
    """Tell whether counting holes helps on a site, why, and what could be set."""
    from homsense_cli.doctor import run_doctor

    run_doctor(url, site, Console(), key=key, apply=apply)


keys = typer.Typer(
    help="API keys of a data directory whose service is stopped.", no_args_is_help=True
)
app.add_typer(keys, name="keys")

DataOption = Annotated[Path, typer.Option(file_okay=False, help="Directory of the store.")]


@keys.command("add")
def add_key(
    name: Annotated[str, typer.Argument(help="For people; names it when it is removed.")],
    scope: Annotated[list[str], typer.Option(help="admin, ingest, localize, read; repeatable.")],
    site: Annotated[list[str] | None, typer.Option(help="Where; everywhere when absent.")] = None,
    data: DataOption = Path("data"),
) -> None:
    """Make a key and print it, once."""
    from homsense_cli.stored import add_key as run

    typer.echo(run(data, name, scope, site))


@keys.command("list")
def list_keys(data: DataOption = Path("data")) -> None:
    """List the keys, without the keys themselves."""
    from homsense_cli.stored import list_keys as run

    run(data, Console())


@keys.command("remove")
def remove_key(name: str, data: DataOption = Path("data")) -> None:
    """Remove a key."""
    from homsense_cli.stored import remove_key as run

    run(data, name)


@app.command("export")
def export_(
    site: Annotated[str, typer.Argument(help="Name of the site.")],
    out: Annotated[
        Path | None, typer.Option(dir_okay=False, help="The file; SITE.homsense when absent.")
    ] = None,
    data: DataOption = Path("data"),
) -> None:
    """Write configuration, map and scans of a site to one file, while the service is stopped."""
    from homsense_cli.stored import export_site

    file = out or Path(f"{site}.homsense")
    export_site(data, site, file)
    typer.echo(file)


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="From export.")],
    name: Annotated[str | None, typer.Option(help="Of the site; as in the file.")] = None,
    data: DataOption = Path("data"),
) -> None:
    """Make a site from such a file, while the service is stopped."""
    from homsense_cli.stored import import_site

    site, scans = import_site(data, file, name)
    typer.echo(f"{site}: {scans} scans")


@app.command()
def verify(data: DataOption = Path("data")) -> None:
    """Build everything again from the logs and compare all digests."""
    from homsense_cli.stored import verify as run

    if not run(data, Console()):
        sys.exit(FAILED)


ros2 = typer.Typer(help="ROS 2 robots (docs/ros2.md).", no_args_is_help=True)
app.add_typer(ros2, name="ros2")


@ros2.command("check")
def ros2_check(
    mapping: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="Mapping file.")],
    router: Annotated[list[str], typer.Option(help="Endpoint of a router; repeatable.")],
    wait_s: Annotated[float, typer.Option(min=0.1, help="How long to listen, seconds.")] = 3.0,
) -> None:
    """Explain what is seen of the robots of a mapping file; exit code 1 when one is amiss."""
    from homsense_cli.ros2 import run_check

    if not run_check(mapping, router, wait_s, Console()):
        sys.exit(FAILED)


zenoh = typer.Typer(help="The zenoh network (docs/operation.md).", no_args_is_help=True)
app.add_typer(zenoh, name="zenoh")


@zenoh.command("router")
def zenoh_router(
    listen: Annotated[list[str], typer.Option(help="Endpoint to listen on; repeatable.")],
    connect: Annotated[list[str] | None, typer.Option(help="Another router; repeatable.")] = None,
    config: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="A zenoh configuration file.")
    ] = None,
) -> None:
    """Route until SIGINT or SIGTERM, where there is no zenohd."""
    from homsense_cli.zenoh_router import run_router

    run_router(listen, connect or [], config)


@zenoh.command("access-control")
def zenoh_access_control(
    device: Annotated[list[str], typer.Option(help="Name of a device; repeatable.")],
    by: Annotated[str, typer.Option(help="certificate or password.")] = "certificate",
    prefix: Annotated[str, typer.Option(help="What all keys begin with.")] = "homsense",
    router: Annotated[bool, typer.Option(help="For a router, not the service.")] = False,
) -> None:
    """Print the access control of a zenoh configuration: each device has its own keys only."""
    import json

    from homsense_service.bridge.access_control import IDENTITIES, access_control

    if by not in IDENTITIES:
        message = f"--by must be one of {', '.join(IDENTITIES)}, not {by!r}"
        raise ValueError(message)
    made = access_control(device, prefix, IDENTITIES[by], names_service=router)
    typer.echo(json.dumps({"access_control": made}, indent=1))


bench = typer.Typer(help="Measure; every figure with its controls.", no_args_is_help=True)
app.add_typer(bench, name="bench")


@bench.command()
def accuracy(
    city: Annotated[
        list[str] | None,
        typer.Option(help="downtown-44, old-town, campus, or a map file; downtown-44."),
    ] = None,
    seed: Annotated[list[int] | None, typer.Option(min=0, help="Of each city; 0.")] = None,
    imu: Annotated[
        list[str] | None, typer.Option(help="good, moderate, heavy, paper; moderate.")
    ] = None,
    recorded: Annotated[
        Path | None, typer.Option(exists=True, file_okay=False, help="Recorded walks instead.")
    ] = None,
    floor: Annotated[list[str] | None, typer.Option(help="Of the recordings; all.")] = None,
    min_rssi_dbm: Annotated[float, typer.Option(help="Of the recordings, dBm.")] = -60.0,
    limit: Annotated[int | None, typer.Option(min=1, help="Most walks of a floor.")] = None,
    min_chain_m: Annotated[float, typer.Option(min=0.0, help="Shortest recorded walk.")] = 150.0,
    binary: Annotated[
        bool, typer.Option(help="Likeness by sets alone, of recorded scans.")
    ] = False,
    compass: Annotated[
        bool, typer.Option(help="Whether a recorded phone that is localized has one.")
    ] = True,
    crowd: Annotated[float, typer.Option(min=0.01, max=1.0, help="Share of its phones.")] = 1.0,
    runs: Annotated[int, typer.Option(min=1, help="Robots in a world, seeds of a walk.")] = 32,
    length_m: Annotated[float, typer.Option(min=50.0, help="Way of a robot.")] = 1500.0,
    particles: Annotated[int, typer.Option(min=1, max=1_000_000)] = 8000,
    hops: Annotated[list[int] | None, typer.Option(min=0, help="The site's when absent.")] = None,
    transmitters: Annotated[int, typer.Option(min=1, help="How many there are.")] = 197,
    s_max_m: Annotated[float, typer.Option(min=1.0, help="Sensing range, metres.")] = 72.0,
    dropout: Annotated[float, typer.Option(min=0.0, max=0.99, help="Share missed.")] = 0.05,
    phones: Annotated[int, typer.Option(min=1, help="How many walk.")] = 40,
    scans: Annotated[int, typer.Option(min=1, help="Scans of each phone.")] = 130,
    window_m: Annotated[float | None, typer.Option(min=50.0, help="Of footprints.")] = None,
    out: OutOption = Path("accuracy"),
) -> None:
    """Localize many robots from nothing, beside three controls; write accuracy.json."""
    from homsense_cli.accuracy.bench import Plan, run_bench
    from homsense_cli.accuracy.scenario import IMUS, Scenario, check_city
    from homsense_cli.accuracy.walks import Recorded

    cities = [] if recorded is not None and not city else [*(city or ["downtown-44"])]
    for name in cities:
        check_city(name)
    for name in imu or ():
        if name not in IMUS:
            message = f"--imu must be one of {', '.join(IMUS)}, not {name!r}"
            raise ValueError(message)
    scenarios = tuple(
        Scenario(name, of, transmitters, s_max_m, dropout, phones, scans, window_m)
        for name in cities
        for of in seed or [0]
    )
    walks = None
    if recorded is not None:
        walks = Recorded(
            recorded,
            tuple(floor or ()),
            min_rssi_dbm,
            limit=limit,
            min_chain_m=min_chain_m,
            binary=binary,
            compass=compass,
            crowd=crowd,
        )
    levels = tuple(sorted(set(hops))) if hops else None
    plan = Plan(scenarios, tuple(imu or ["moderate"]), walks, runs, length_m, particles, levels)
    console = Console()
    run_bench(plan, out, Console(width=max(console.width, TABLE_WIDTH)))


@bench.command()
def sweep(
    seed: SeedOption = 0,
    runs: Annotated[int, typer.Option(min=1, help="Robots for each value.")] = 16,
    out: OutOption = Path("accuracy"),
) -> None:
    """Vary density, crowd, building size and dropout; write sweeps.json and a picture."""
    from homsense_cli.accuracy.sweep import run_sweeps

    run_sweeps(seed, runs, out, Console())


def main() -> None:
    """Run the command line; a failure is one line on standard error."""
    try:
        app()
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        _fail(f"{where}: {first['msg']}" if where else str(first["msg"]), MISUSE)
    except Exception as error:
        code = _exit_code(error)
        if code is None:
            raise
        _fail(str(error), code)


def _exit_code(error: Exception) -> int | None:
    from homsense_client import ClientError
    from homsense_service.errors import ServiceError

    from homsense import HomsenseError

    if isinstance(error, (OSError, ValueError, HomsenseError, ServiceError)):
        return MISUSE
    return FAILED if isinstance(error, (ClientError, RuntimeError)) else None


def _fail(message: str, code: int) -> NoReturn:
    typer.echo(f"homsense: {message}", err=True)
    sys.exit(code)


if __name__ == "__main__":
    main()
