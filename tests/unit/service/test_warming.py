"""Nobody waits for numba, and nobody runs it who does not want it."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from support.builders import SITE_MAP

from homsense import backend, engine


def refused() -> None:
    message = "the compiled code was asked for"
    raise AssertionError(message)


def test_a_service_of_the_reference_never_asks_for_numba(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "compiled", refused)
    monkeypatch.setattr(engine, "compiled", refused)
    step = {"seq": 1, "delta": {"forward_m": 1.0}, "landmarks": ["a"]}
    scans = [
        {"device": "d", "scan_id": str(number), "observed_at": 1.7e9, "landmarks": list(seen)}
        for number, seen in enumerate(("ab", "bc", "cd", "da"))
    ]
    for _ in range(2):
        with TestClient(create_app(Settings(data=tmp_path, engine="python"))) as api:
            api.put("/v1/sites/yard", json={"landmark_key": "ssid"})
            api.put("/v1/sites/yard/map", json=SITE_MAP)
            assert api.post("/v1/sites/yard/scans", json={"scans": scans}).status_code == 200
            for path in ("complex", "complex?curve=rssi", "complex?curve=witnesses"):
                assert api.get(f"/v1/sites/yard/{path}").status_code == 200
            question = {"landmarks": ["a"], "lasting": True, "cycles": True}
            told = api.post("/v1/sites/yard/local-homology", json=question)
            assert told.status_code == 200
            opened = api.post("/v1/sites/yard/sessions", json={"particles": 100}).json()
            path = f"/v1/sessions/{opened['session']}"
            assert api.post(f"{path}/steps", json={"steps": [step]}).status_code == 200
            assert api.post(f"{path}/map").status_code == 200
            assert api.get(f"{path}/pose").json()["modes"]
