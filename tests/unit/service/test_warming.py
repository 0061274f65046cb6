"""Nobody waits for numba, and nobody runs it who does not want it."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from support.builders import SITE_MAP
from support.corridors import Building, heard, posted
from support.networks import until

from homsense import backend, engine


def refused() -> None:
    message = "the compiled code was asked for"
    raise AssertionError(message)


@pytest.fixture(autouse=True)
def _without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "compiled", refused)
    monkeypatch.setattr(engine, "compiled", refused)


def test_a_service_of_the_reference_never_asks_for_numba(
    tmp_path: Path,
) -> None:
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


def test_neither_does_one_whose_sessions_know_their_places_from_a_crowd(
    tmp_path: Path,
) -> None:
    building = Building.of(0)
    crowd = list(building.crowd(10, 12))
    settings = Settings(data=tmp_path, engine="python", cell_m=1.0)
    steps = [
        {"seq": seq, "delta": {"forward_m": 2.0}, "landmarks": heard(scan.readings)}
        for seq, scan in enumerate(crowd[:3], 1)
    ]
    with TestClient(create_app(settings)) as api:
        api.put("/v1/sites/floor", json={})
        api.put("/v1/sites/floor/map", json=building.document())
        api.post("/v1/sites/floor/scans", json={"scans": [posted(one) for one in crowd]})
        api.post("/v1/sites/floor/registration")
        until(lambda: state(api) == "ready", 60.0, every_s=0.1)
        asked = {"particles": 100, "sensor": {"type": "registered"}}
        opened = api.post("/v1/sites/floor/sessions", json=asked).json()
        path = f"/v1/sessions/{opened['session']}/steps"
        assert api.post(path, json={"steps": steps[:1]}).status_code == 200
    for step in steps[1:]:
        with TestClient(create_app(settings)) as api:
            assert api.post(path, json={"steps": [step]}).status_code == 200


def state(api: TestClient) -> str:
    found = api.get("/v1/sites/floor/registration").json()
    assert found["state"] != "failed", found
    return str(found["state"])
