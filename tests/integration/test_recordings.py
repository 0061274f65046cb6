"""What the commands say about recorded floors, and about those that have little to offer."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from homsense_cli.__main__ import app
from homsense_cli.recorded import read_floor
from homsense_cli.replay import UNPLACED, Replay, run_replay
from rich.console import Console
from support.corridors import Building
from support.recordings import write_floors
from typer.testing import CliRunner

FLOORS = {"attic": (80.0, 4), "cellar": (160.0, 0), "tower": (160.0, 16)}
"""In the attic nobody walks far; nobody else has been in the cellar."""


@pytest.fixture(scope="module")
def floors(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("floors")
    write_floors(folder, Building.of(3), FLOORS)
    return folder


def test_floors_without_walks_or_crowd_are_measured_like_others(
    floors: Path, tmp_path: Path
) -> None:
    arguments = ["bench", "accuracy", "--recorded", str(floors), "--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, "--runs", "1", "--particles", "500"])
    assert result.exit_code == 0, result.output
    assert "attic holds no walk of 150 m or more" in result.output
    assert "…" not in result.output
    rows = json.loads((tmp_path / "accuracy.json").read_text())["rows"]
    assert [row["world"] for row in rows] == ["cellar", "tower", "all floors"]
    cellar, tower, everything = (row["scores"] for row in rows)
    assert list(cellar) == list(tower) == list(everything)
    assert cellar["registered"] == cellar["no homology"]
    assert tower["registered"]["median_m"] < 15.0 < tower["no homology"]["median_m"]


def test_a_crowd_without_a_place_is_replayed_as_one_that_tells_nothing(floors: Path) -> None:
    cellar, tower = run_replay(floors, Replay(), Console(quiet=True))
    assert (cellar.floor, cellar.sensor) == ("cellar", UNPLACED)
    assert cellar.error_m == cellar.baseline_m
    assert (tower.floor, tower.sensor) == ("tower", "registered")
    assert tower.error_m < 15.0 < tower.baseline_m


@pytest.mark.parametrize("command", [["replay"], ["bench", "accuracy", "--recorded"]])
def test_floors_without_any_walk_are_refused(floors: Path, command: list[str]) -> None:
    result = CliRunner().invoke(app, [*command, str(floors), "--floor", "attic"])
    assert isinstance(result.exception, ValueError)
    assert "no walk of 150 m or more" in str(result.exception)


def test_a_floor_that_is_not_described_is_named(tmp_path: Path) -> None:
    write_floors(tmp_path, Building.of(3), {"attic": FLOORS["attic"]})
    chains = {"attic": {"chains": [{"length_m": 200.0, "traces": ["attic-0", "lost"]}]}}
    (tmp_path / "chains.json").write_text(json.dumps(chains))
    with pytest.raises(ValueError, match="names 'lost', of which attic has no recording"):
        read_floor(tmp_path, "attic")
    (tmp_path / "chains.json").write_text("{}")
    with pytest.raises(ValueError, match="does not name the floor 'attic'"):
        read_floor(tmp_path, "attic")


def test_a_phone_that_took_no_step_has_not_moved(floors: Path) -> None:
    walk = read_floor(floors, "attic").traces["attic-0"]
    assert walk.reckoned(4.0) != (0.0, 0.0)
    assert replace(walk, steps=walk.steps[:0]).reckoned(4.0) == (0.0, 0.0)
