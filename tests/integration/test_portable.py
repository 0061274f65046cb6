"""A site as one file, and a store that is looked through."""

import gzip
import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from homsense_cli.__main__ import app, main
from homsense_service import sites
from homsense_service.app import create_app
from homsense_service.portable import exported
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore
from support.builders import SITE_MAP
from typer.testing import CliRunner


def run(*words: str, code: int = 0) -> str:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a site, a long log and a session."""
    directory = tmp_path_factory.mktemp("filled")
    with (
        pytest.MonkeyPatch.context() as patch,
        TestClient(create_app(Settings(data=directory))) as api,
    ):
        patch.setattr(sites, "_LEAST_TAIL", 50)
        origin = {"lat": 1, "lon": 2}
        api.put("/v1/sites/a", json={"name": "\u00c4", "hops": [1, 2], "origin": origin})
        api.put("/v1/sites/a/map", json=SITE_MAP)
        scans: list[dict[str, Any]] = [
            {
                "device": f"d{n % 3}", "scan_id": str(n), "observed_at": 1.7e9 + n / 3.0,
                "landmarks": [f"l{n % 40}", {"id": f"l{n % 13}", "rssi": -60.25, "age_s": 0.1}],
                "track": {"id": "w", "x_m": n / 7.0, "y_m": 0.0},
            }
            for n in range(120)
        ]  # fmt: skip
        for first in range(0, 120, 60):
            api.post("/v1/sites/a/scans", json={"scans": scans[first : first + 60]})
        session = api.post("/v1/sites/a/sessions", json={"particles": 30}).json()["session"]
        for first in range(1, 700, 100):
            steps = [{"seq": seq, "landmarks": ["l1"]} for seq in range(first, first + 100)]
            api.post(f"/v1/sessions/{session}/steps", json={"steps": steps})
    return directory


@pytest.fixture
def data(filled: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may spoil."""
    return shutil.copytree(filled, tmp_path / "data")


def test_an_export_comes_in_few_pieces_however_many_scans_there_are(data: Path) -> None:
    with closing(SqliteStore(data)) as store:
        pieces = list(exported(store, "a"))
    assert all(pieces)
    assert len(pieces) < 10


def test_an_exported_site_is_imported_as_it_was(data: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "one.homsense", tmp_path / "two.homsense"
    run("export", "a", "--out", str(first), "--data", str(data))
    other = tmp_path / "other"
    assert run("import", str(first), "--data", str(other)) == "a: 120 scans\n"
    run("export", "a", "--out", str(second), "--data", str(other))
    assert first.read_bytes() == second.read_bytes()
    told = []
    for directory in (data, other):
        with TestClient(create_app(Settings(data=directory))) as api:
            told.append(
                [api.get(f"/v1/sites/a{rest}").json() for rest in ("", "/map", "/complex")]
            )
            assert api.get("/v1/sites/a/export").content == first.read_bytes()
    assert told[0] == told[1]
    run("import", str(first), "--name", "b", "--data", str(other))
    with closing(SqliteStore(other)) as store:
        assert set(store.sites()) == {"a", "b"}


def test_a_file_that_is_not_sound_is_refused_as_a_whole(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.homsense"
    run("export", "a", "--out", str(file), "--data", str(data))
    sound = file.read_bytes()
    lines = gzip.decompress(sound).splitlines(keepends=True)
    spoiled = {
        "cut": sound[: len(sound) // 2],
        "short": gzip.compress(b"".join(lines[:-1])),
        "less": gzip.compress(b"".join([*lines[:5], *lines[6:]])),
        "more": gzip.compress(b"".join([*lines, lines[3]])),
        "other": gzip.compress(b'{"format": "zip"}\n'),
        "none": b"",
        "text": b"hello",
        "changed": gzip.compress(b"".join(lines).replace(b"-60.25", b"-60.75", 1)),
    }
    other = tmp_path / "other"
    for name, content in spoiled.items():
        file.write_bytes(content)
        words = ["homsense", "import", str(file), "--data", str(other)]
        for more in ([], ["--name", "b"]):
            monkeypatch.setattr("sys.argv", [*words, *more])
            with pytest.raises(SystemExit) as ended:
                main()
            assert ended.value.code == 2, name
            assert len(capsys.readouterr().err.strip().splitlines()) == 1
    with closing(SqliteStore(other)) as store:
        assert not store.sites()
    file.write_bytes(sound)
    run("import", str(file), "--data", str(other))
    monkeypatch.setattr("sys.argv", ["homsense", "import", str(file), "--data", str(other)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "already" in capsys.readouterr().err


def test_a_sound_store_is_found_sound(data: Path) -> None:
    told = run("verify", "--data", str(data))
    assert told.count("│ yes ") == 3
    assert "│ NO " not in told
    assert "700 steps" in told


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        ("DELETE FROM scan WHERE number = 7", "checkpoint"),
        ("UPDATE event SET body = CAST(replace(body, '0.0', '0.5') AS BLOB) WHERE number = 9",
            "replay"),
        ("DELETE FROM event WHERE number = 9", "missing"),
        ("DELETE FROM map; DELETE FROM site; INSERT INTO map VALUES (77, '{}')", "file"),
    ],
)  # fmt: skip
def test_damage_is_found(data: Path, statement: str, told: str) -> None:
    with sqlite3.connect(data / "homsense.sqlite3") as db:
        db.executescript(statement)
    db.close()
    found = run("verify", "--data", str(data), code=1)
    assert "│ NO " in found
    assert told in found


def test_a_log_that_breaks_off_is_told(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    assert "middle of a transaction" not in (store.caution or "")
    with TestClient(create_app(Settings(data=tmp_path), lambda _: store)) as api:
        for name in "abc":
            api.put(f"/v1/sites/{name}", json={})
        log = (tmp_path / "homsense.sqlite3-wal").read_bytes()
        main_file = (tmp_path / "homsense.sqlite3").read_bytes()
    hurt = tmp_path / "hurt"
    hurt.mkdir()
    (hurt / "homsense.sqlite3").write_bytes(main_file)
    (hurt / "homsense.sqlite3-wal").write_bytes(log[:-100] + b"x" * 100)
    with closing(SqliteStore(hurt)) as damaged:
        assert "middle of a transaction" in (damaged.caution or "")
        assert set(damaged.sites()) == {"a", "b"}


def test_a_database_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "homsense.sqlite3").write_bytes(json.dumps({}).encode() * 5000)
    with pytest.raises(Exception, match="cannot be used"):
        SqliteStore(tmp_path)
