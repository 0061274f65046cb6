"""The gate: robots localize no worse than they did, by more than runs differ among themselves."""

import json
from pathlib import Path

import numpy as np
import pytest
from accuracy_gate import finals
from homsense_cli.__main__ import app
from support.builders import feature, local_map, square
from typer.testing import CliRunner

REFERENCE = json.loads((Path(__file__).parent / "accuracy_gate.json").read_text())
RUNS = 12

runner = CliRunner()


def test_accuracy_has_not_dropped() -> None:
    found = finals(RUNS)
    before = np.median(REFERENCE["homology"][:RUNS])
    assert np.median(found["homology"]) <= before + REFERENCE["spread_m"]
    assert np.median(found["homology"]) < 0.2 * np.median(found["no homology"])


def test_the_bench_writes_what_it_measures(tmp_path: Path) -> None:
    blocks = [feature(square(x, y, 25)) for x in (20, 75, 130) for y in (20, 75, 130)]
    (tmp_path / "blocks.json").write_text(json.dumps(local_map(*blocks)))
    arguments = ["bench", "accuracy", "--city", str(tmp_path / "blocks.json")]
    arguments += ["--transmitters", "40", "--s-max-m", "40", "--phones", "5"]
    arguments += ["--runs", "2", "--length-m", "50", "--particles", "1000"]
    arguments += ["--hops", "2", "--hops", "3", "--out", str(tmp_path)]
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    (row,) = json.loads((tmp_path / "accuracy.json").read_text())["rows"]
    assert list(row["scores"]) == [
        "homology",
        "no homology",
        "shuffled",
        "true counts",
        "registered",
        "elsewhere",
        "both",
        "holes at place",
    ]
    assert row["site"]["hops"] == [2, 3]
    assert row["scores"]["homology"]["runs"] == 2
    assert "shuffled" in result.output


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--city", "atlantis"], "--city must be one of"),
        (["--imu", "perfect"], "--imu must be one of"),
        (["--recorded", "."], "holds no recordings"),
        (["--runs", "0"], "--runs"),
    ],
)
def test_a_bench_that_makes_no_sense_is_refused(arguments: list[str], reason: str) -> None:
    result = runner.invoke(app, ["bench", "accuracy", *arguments])
    assert result.exit_code != 0
    assert reason in result.output + str(result.exception)
