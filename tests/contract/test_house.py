"""Rules of the house that a machine can check."""

import inspect
import re
import tomllib
from importlib import import_module
from pathlib import Path
from typing import get_args

import homsense_client
import homsense_client.streaming
import pytest
from homsense_service import errors as service_errors
from homsense_service.app import create_app
from homsense_service.bridge import encodings
from homsense_service.bridge.keyspace import METHODS, KeySpace
from homsense_service.bridge.opening import OpenIn
from homsense_service.bridge.presence import State
from homsense_service.openapi import openapi_text
from homsense_service.problems import INTERNAL, KINDS
from homsense_service.settings import Settings
from openapi_spec_validator import validate

import homsense

ROOT = Path(__file__).parents[2]
PACKAGES = [
    ROOT / "homsense",
    ROOT / "service" / "homsense_service",
    *(ROOT / "clients" / name for name in ("homsense_client", "homsense_fleet", "homsense_cli")),
]
SOURCES = sorted(path for package in PACKAGES for path in package.rglob("*.py"))
LOCKS = sorted(ROOT.glob("requirements*.lock"))


def _text(*parts: str) -> str:
    return ROOT.joinpath(*parts).read_text()


def test_the_committed_openapi_document_is_the_one_of_the_routes() -> None:
    assert _text("openapi", "openapi.json") == openapi_text(), "run `make openapi`"


def test_the_openapi_document_is_valid() -> None:
    document = create_app(Settings()).openapi()
    validate(document)
    assert document["openapi"].startswith("3.1")


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_a_lock_file_holds_hashes_and_no_address(lock: Path) -> None:
    text = lock.read_text()
    assert len(LOCKS) == 3
    assert "://" not in text
    assert not re.search(r"\b[\w-]+\.(org|com|net|io|dev|internal|local)\b", text)
    assert not re.search(r"^\s*--(?!hash=)", text, flags=re.MULTILINE)
    pinned = [line for line in text.splitlines() if line and not line.startswith(" ")]
    assert pinned
    assert all("==" in line for line in pinned)
    assert text.count("--hash=sha256:") >= len(pinned)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_a_file_is_short_and_has_a_name_that_says_something(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400
    assert path.stem not in {"utils", "helpers", "common", "types", "base", "core", "misc"}


@pytest.mark.parametrize(
    ("module", "root"),
    [
        ("homsense.errors", "HomsenseError"),
        ("homsense_service.errors", "ServiceError"),
        ("homsense_client.errors", "ClientError"),
    ],
)
def test_every_error_derives_from_the_root_of_its_package(module: str, root: str) -> None:
    found = import_module(module)
    base = getattr(found, root)
    for _, error in inspect.getmembers(found, inspect.isclass):
        if issubclass(error, Exception) and error.__module__ == module:
            assert issubclass(error, base)
            assert error.__doc__


def test_every_error_has_a_row_in_the_table() -> None:
    roots = {homsense.HomsenseError, service_errors.ServiceError}
    for module in (homsense.errors, service_errors):
        for _, error in inspect.getmembers(module, inspect.isclass):
            if issubclass(error, Exception) and error not in roots:
                assert error in KINDS


def test_every_public_name_is_exported_and_documented() -> None:
    for package in (homsense, homsense_client, homsense_client.streaming):
        assert package.__all__ == sorted(package.__all__, key=str)
        for name in package.__all__:
            assert getattr(package, name).__doc__


def test_every_setting_is_documented() -> None:
    text = _text("docs", "operation.md")
    for name in Settings.model_fields:
        assert f"`HOMSENSE_{name.upper()}`" in text


def test_every_route_is_documented() -> None:
    text = _text("docs", "api.md")
    for path, verbs in create_app(Settings()).openapi()["paths"].items():
        for verb in verbs:
            assert f"`{verb.upper()} {path}`" in text


def test_what_can_be_wrong_with_a_body_is_documented_wherever_there_is_one() -> None:
    for path, verbs in create_app(Settings()).openapi()["paths"].items():
        for verb, operation in verbs.items():
            if "requestBody" in operation:
                assert {"400", "413", "422"} <= {*operation["responses"]}, (verb, path)


def test_the_streaming_contract_is_the_one_of_the_code() -> None:
    text = _text("openapi", "keyexpr.md")
    keys = KeySpace("homsense")
    found = [
        keys.alive("DEVICE"),
        keys.service("ZID"),
        *(
            keys.of_device("DEVICE", what)
            for what in ("imu", "scan", "pose", "particles", "event")
        ),
        *(keys.rpc("DEVICE", method) for method in METHODS),
    ]
    told = re.findall(r"^\| `(homsense/\S+)` \|", text, flags=re.MULTILINE)
    assert sorted(told) == sorted(found)
    for encoding in (encodings.DELTA, encodings.IMU, encodings.JSON, encodings.PARTICLES):
        assert encoding in text
    for model in (OpenIn, encodings.ScanBody):
        for name in model.model_fields:
            assert f'"{name}"' in text
    bridge = ROOT / "service" / "homsense_service" / "bridge"
    source = "".join(path.read_text() for path in bridge.glob("*.py"))
    codes = {*re.findall(r"tell\(\s*(?:self\.)?name,\s*\"(\w+)\"", source)}
    assert {"gap", "decode", "overflow"} <= codes
    for code in [*codes, *get_args(State), "bad_token", "no_session", "body_too_large"]:
        assert f"`{code}`" in text


def test_every_error_code_is_documented() -> None:
    text = _text("docs", "api.md")
    for kind in [*KINDS.values(), INTERNAL]:
        assert f"`{kind.code}`" in text


def test_every_command_is_documented() -> None:
    text = _text("README.md")
    source = _text("clients", "homsense_cli", "__main__.py")
    commands = re.findall(r"^@app\.command\(.*\)\ndef (\w+)", source, flags=re.MULTILINE)
    assert {"serve", "export_", "verify"} <= {*commands}
    groups = re.findall(r"^app\.add_typer\(\w+, name=\"(\w+)\"\)", source, flags=re.MULTILINE)
    for command in [*(name.rstrip("_") for name in commands), *groups]:
        assert f"`homsense {command}`" in text


def test_the_version_is_told_once() -> None:
    project = tomllib.loads(_text("pyproject.toml"))["project"]
    assert f"## {project['version']}" in _text("CHANGELOG.md")
    assert f"version: {project['version']}" in _text("CITATION.cff")
