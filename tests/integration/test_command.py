"""The command line end to end, on small inputs."""

import gzip
import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from homsense_cli import demo as demo_module
from homsense_cli.__main__ import app, main
from homsense_cli.local_service import free_port, local_service, start
from homsense_cli.recorded import crowd_scans, floor_names, read_floor, walk_events
from homsense_cli.replay import Replay, run_replay
from homsense_cli.stored import add_key
from homsense_client import Client
from rich.console import Console
from support.builders import SITE_MAP
from typer.testing import CliRunner

runner = CliRunner()
REPORT = {
    "scenario", "seed", "buildings", "landmarks", "scans", "facets", "b0", "b1", "error_m",
    "final_median_error_m", "baseline_no_homology_m", "seconds", "steps",
    "steps_equal_over_rest_and_zenoh",
}  # fmt: skip


def test_the_demo_localizes_and_writes_what_it_promises(tmp_path: Path) -> None:
    result = runner.invoke(app, ["demo", "--seed", "4", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "report.json").read_text())
    assert set(report) == REPORT
    assert (report["buildings"], report["b0"]) == (44, 1)
    assert abs(report["b1"] - 44) <= 4
    assert report["scans"] >= 5000
    assert len(report["error_m"]) == 15
    assert report["steps_equal_over_rest_and_zenoh"] == report["steps"] == 300
    assert report["final_median_error_m"] < 25.0 < report["baseline_no_homology_m"]
    pictures = sorted(path.name for path in tmp_path.glob("*.png"))
    assert [name[:7] for name in pictures] == ["figure2", "figure3", "figure4"]
    again = runner.invoke(app, ["figures", str(tmp_path / "run.json.gz"), "--out", str(tmp_path)])
    assert again.exit_code == 0
    assert again.output.count(".png") == 3


def test_the_demo_has_the_length_of_its_promise() -> None:
    assert demo_module.LENGTH_M == 1500.0


def test_a_fleet_maps_a_site_and_drives_in_it_over_rest_and_zenoh(
    tmp_path: Path,
) -> None:
    path = tmp_path / "map.geojson.gz"
    path.write_bytes(gzip.compress(json.dumps(SITE_MAP).encode()))
    where = f"tcp/127.0.0.1:{free_port()}"
    with (
        local_service(zenoh_listen=json.dumps([where])) as url,
        Client(url, timeout_s=180.0) as client,
    ):
        arguments = ["fleet", "--url", url, "--site", "yard", "--map", str(path)]
        arguments += ["--transmitters", "20", "--phones", "3", "--scans", "20", "--s-max-m", "30"]
        ends = []
        for ways in (["--robots", "2"], ["--robots", "2", "--zenoh", where]):
            result = runner.invoke(app, [*arguments, *ways])
            assert result.exit_code == 0, result.output
            ends.append(re.findall(r"robot \d: median error .*", result.output))
        assert "3 buildings" in result.output
        assert client.get_site("yard").observations > 40
        assert [len(found) for found in ends] == [2, 2]


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["demo", "--seed", "minus"],
        ["figures", "missing.json"],
        ["replay", "nowhere"],
    ],
)
def test_misuse_exits_with_two(arguments: list[str]) -> None:
    assert runner.invoke(app, arguments).exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "code", "reason"),
    [
        (["serve", "--data", "{file}/x"], 2, "cannot be used"),
        (["fleet", "--map", "{file}"], 2, "is not a map: expected a FeatureCollection"),
        (["figures", "{file}"], 2, "recorded run"),
        (["replay", "{directory}"], 2, "no recordings"),
        (["replay", "{directory}", "--sensor", "sixth"], 2, "--sensor must be"),
        (["fleet", "--url", "http://127.0.0.1:1", "--phones", "1"], 1, "connection"),
    ],
)
def test_a_failure_is_one_line_on_standard_error(
    arguments: list[str],
    code: int,
    reason: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = tmp_path / "map.json"
    file.write_text('{"a": 1}')
    given = [argument.format(file=file, directory=tmp_path) for argument in arguments]
    monkeypatch.setattr(sys, "argv", ["homsense", *given])
    with pytest.raises(SystemExit) as ended:
        main()
    line = capsys.readouterr().err.splitlines()[-1]
    assert (ended.value.code, reason in line) == (code, True), line
    assert line.startswith("homsense: ")


@pytest.mark.parametrize(
    ("variables", "reason"), [({}, "in use"), ({"HOMSENSE_PORT": "abc"}, "port: ")]
)
def test_a_service_that_cannot_start_says_why(
    variables: dict[str, str], reason: str, tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = subprocess.run(
            [sys.executable, "-m", "homsense_cli", "serve", "--data", str(tmp_path)],
            env={**os.environ, "HOMSENSE_PORT": port, **variables},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
    line = done.stderr.splitlines()[-1]
    assert (done.returncode, reason in line) == (2, True), done.stderr
    assert line.startswith("homsense: ")
    assert "Traceback" not in done.stderr


def test_the_service_tells_where_it_serves_and_stops_on_a_signal(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "homsense_cli", "serve", "--port", "0"]
    with subprocess.Popen(
        [*command, "--data", str(tmp_path)], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        line = process.stderr.readline()
        url = line.split()[2]
        with Client(url) as client:
            assert client.put_site("a").name == "a"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=10) in (0, 130)


def test_help_names_every_command() -> None:
    result = runner.invoke(app, ["--help"])
    assert result.exit_code == 0
    for command in ("serve", "demo", "fleet", "replay", "figures"):
        assert command in result.output


@pytest.mark.recorded
def test_a_recorded_floor_is_read_and_replayed(recordings: Path) -> None:
    directory = recordings / "ilc20"
    assert floor_names(directory) == ["site1_F2", "site1_F3", "site1_F4"]
    floor = read_floor(directory, "site1_F4")
    chain = floor.chains[0]
    others = list(crowd_scans(floor, chain))
    assert not {scan["device"] for scan in others} & set(chain)
    assert not any(
        set(scan) - {"device", "scan_id", "observed_at", "landmarks", "track"} for scan in others
    )
    events = walk_events(floor, chain)
    assert [event.t_s for event in events] == sorted(event.t_s for event in events)
    (score,) = run_replay(directory, Replay(("site1_F4",), limit=1), Console(quiet=True))
    assert score.complex.facets > 100
    assert score.sensor == "registered"
    assert score.error_m < 10.0
    assert 0.0 < score.baseline_m < 250.0


@pytest.mark.recorded
def test_the_fleet_runs_on_real_buildings(recordings: Path) -> None:
    path = recordings / "helsinki_centre" / "local.json.gz"
    with local_service() as url:
        arguments = ["fleet", "--url", url, "--site", "helsinki", "--map", str(path)]
        arguments += ["--window-m", "600", "--phones", "10", "--scans", "60"]
        result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "helsinki: " in result.output


def test_commands_show_their_key(tmp_path: Path) -> None:
    token = add_key(tmp_path, "reader", ["read", "localize"], None)
    with start(tmp_path, engine="python") as url:
        for environment, told in (({}, "key"), ({"HOMSENSE_KEY": token}, "no site")):
            done = subprocess.run(
                [sys.executable, "-m", "homsense_cli", "doctor", "nowhere", "--url", url],
                check=False, capture_output=True, text=True, env={**os.environ, **environment},
            )  # fmt: skip
            assert done.returncode == 1
            assert told in done.stderr
