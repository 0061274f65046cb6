"""Over REST: a site learns from its scans what its sensor counts, and sessions measure with it."""

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from homsense_cli.doctor import run_doctor
from homsense_cli.local_service import local_service
from homsense_client import Client
from homsense_fleet.device import phone_scans
from homsense_fleet.world import Radio, World, city_world
from homsense_service.app import create_app
from homsense_service.settings import Settings
from rich.console import Console
from support.builders import SITE_MAP
from support.networks import until

pytestmark = pytest.mark.xdist_group("town")  # one worker sets it up
SITE = "/v1/sites/town"
HEARD = 0.25
WORLD: World = city_world("downtown-44", 3, radio=Radio(s_max_m=72.0))


def _scans(phones: range, count: int = 60) -> list[dict[str, Any]]:
    """Return scans of phones that keep no account of their motion."""
    return [
        {name: value for name, value in scan.items() if name != "track"}
        for phone in phones
        for scan in phone_scans(WORLD, f"p{phone}", np.random.default_rng(phone), count=count)
    ]


def _ready(api: TestClient, scans: int = 0) -> dict[str, Any]:
    def told() -> dict[str, Any] | None:
        found: dict[str, Any] = api.get(f"{SITE}/expectation").json()
        assert found["state"] != "failed", found["reason"]
        return found if found["state"] == "ready" and found["learnt"]["scans"] >= scans else None

    found: dict[str, Any] = until(told, 180.0, every_s=0.1)
    return found


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """Return a service with a mapped downtown."""
    settings = Settings(data=tmp_path_factory.mktemp("data"), cell_m=4.0)
    with TestClient(create_app(settings)) as api:
        api.put(SITE, json={})
        api.put(f"{SITE}/map", json=WORLD.map_document())
        api.post(f"{SITE}/scans", json={"scans": _scans(range(16))})
        assert api.post(f"{SITE}/expectation").status_code == 202
        yield api


def test_a_site_learns_its_radio_and_sessions_measure_with_it(town: TestClient) -> None:
    assert town.post(f"{SITE}/expectation").json()["state"] in {"building", "ready"}
    learnt = _ready(town)["learnt"]
    assert abs(learnt["range_m"] - 72.0) < 12.0
    assert learnt["knows_crowd"] is False
    assert learnt["hops"] == list(range(1, len(learnt["hops"]) + 1))
    assert learnt["information_bits"][-1] > 2.0
    opened = town.post(f"{SITE}/sessions", json={"seed": 1, "particles": 500}).json()
    assert (opened["expected"], opened["r_geo_m"]) == ("simulated", None)
    assert opened["hops"] == learnt["hops"]
    assert opened["correlation_m"] == learnt["correlation_m"]
    step = {
        "seq": 1,
        "delta": {"forward_m": 5.0},
        "landmarks": _scans(range(1), 1)[0]["landmarks"],
    }
    pose = town.post(f"/v1/sessions/{opened['session']}/steps", json={"steps": [step]}).json()
    assert len(pose["measurement"]["holes"]) == len(learnt["hops"])
    moved = town.post(f"/v1/sessions/{opened['session']}/map").json()
    assert moved["expected"] == "simulated"


def test_a_session_may_choose_neighborhoods_and_correlation(town: TestClient) -> None:
    sensor = {"hops": [2, 3], "correlation_m": 40.0}
    opened = town.post(f"{SITE}/sessions", json={"sensor": sensor, "particles": 100}).json()
    assert (opened["hops"], opened["correlation_m"]) == ([2, 3], 40.0)
    refused = town.post(f"{SITE}/sessions", json={"sensor": {"hops": [3, 12]}})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["field"] == "sensor.hops"


def test_a_session_may_still_be_geometric(town: TestClient) -> None:
    sensor = {"expected": "geometric", "hops": [2, 3]}
    opened = town.post(f"{SITE}/sessions", json={"sensor": sensor, "particles": 100}).json()
    assert opened["expected"] == "geometric"
    assert len(opened["r_geo_m"]) == 2


def test_the_height_map_of_a_neighborhood_tells_its_spread(town: TestClient) -> None:
    height = town.get(f"{SITE}/heightmaps/3").json()
    assert (height["expected"], height["r_geo_m"]) == ("simulated", None)
    values = np.array(height["values"], np.float64)
    spread = np.array(height["spread"], np.float64)
    assert values.shape == spread.shape == (height["rows"], height["columns"])
    assert np.nanmax(values) > 5.0
    assert np.nanmin(spread) > 0.0
    picture = town.get(f"{SITE}/heightmaps/3", headers={"accept": "image/png"})
    assert picture.content.startswith(b"\x89PNG")


def test_a_site_is_judged_with_reasons(town: TestClient) -> None:
    found = town.get(f"{SITE}/diagnosis").json()
    topics = [finding["topic"] for finding in found["findings"]]
    assert {"density", "range", "dropout", "fragmentation", "likeness"} < set(topics)
    assert found["verdict"] == "good"


def test_many_more_scans_are_learnt_from_again(town: TestClient) -> None:
    before = _ready(town)["learnt"]["scans"]
    for first in range(16, 32, 8):
        town.post(f"{SITE}/scans", json={"scans": _scans(range(first, first + 8))})
    assert _ready(town, scans=int(1.25 * before))["learnt"]["scans"] > before


def test_another_cut_is_learnt_under(town: TestClient) -> None:
    before = _ready(town)["learnt"]
    town.put(SITE, json={"min_rssi_dbm": -80.0})
    assert town.post(f"{SITE}/expectation").json()["state"] == "building"
    assert _ready(town)["learnt"]["range_m"] < before["range_m"]
    town.put(SITE, json={})


def test_a_site_with_few_scans_is_geometric_and_says_so(api: TestClient, site: str) -> None:
    assert api.get(f"/v1/sites/{site}/expectation").json()["state"] == "none"
    opened = api.post(f"/v1/sites/{site}/sessions", json={"particles": 100}).json()
    assert opened["expected"] == "geometric"
    assert opened["hops"] == [1, 2]


def test_a_simulation_that_takes_too_long_is_asked_for_later(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, expectation_wait_s=0.0)
    with TestClient(create_app(settings)) as api:
        api.put(SITE, json={})
        api.put(f"{SITE}/map", json=WORLD.map_document())
        api.post(f"{SITE}/scans", json={"scans": _scans(range(2))})
        pending = api.post(f"{SITE}/sessions", json={"particles": 100})
        assert pending.status_code == 503
        assert pending.json()["code"] == "expectation_pending"
        assert pending.headers["retry-after"] == "5"


def test_a_simulation_that_cannot_be_says_why(tmp_path: Path) -> None:
    """Scans of no landmark that the complex keeps: nothing is to be learnt."""
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        api.put(SITE, json={})
        api.put(f"{SITE}/map", json=SITE_MAP)
        failed = api.get(f"{SITE}/diagnosis")
        assert failed.status_code == 409
        assert failed.json()["code"] == "expectation_failed"
        assert api.get(f"{SITE}/expectation").json()["reason"]


def test_hops_that_are_not_simulated_are_refused(api: TestClient) -> None:
    assert api.put(SITE, json={"hops": [1, 9]}).status_code == 422
    assert api.put(SITE, json={"hops": [1, 9], "expected": "geometric"}).status_code == 201


def test_the_doctor_prints_what_a_service_says() -> None:
    with local_service() as url, Client(url, timeout_s=180.0) as client:
        client.put_site("town")
        client.put_map("town", WORLD.map_document())
        client.post_scans("town", _scans(range(10)))
        console = Console(record=True, width=200)
        diagnosis = run_doctor(url, "town", console)
        text = console.export_text()
    assert diagnosis.summary in text
    assert all(finding.text in text for finding in diagnosis.findings)


def test_the_doctor_sets_what_it_advises() -> None:
    """Scans that repeat old sightings and miss most of what is there, four at each place."""
    chance = random.Random(0)
    scans = [
        {
            **scan,
            "scan_id": f"{scan['scan_id']} {again}",
            "landmarks": [{**heard} for heard in scan["landmarks"] if chance.random() < HEARD],
        }
        for scan in _scans(range(10), 25)
        for again in range(4)
    ]
    for scan in scans:
        for reading in scan["landmarks"][::3]:
            reading["age_s"] = 20.0
    with local_service() as url, Client(url, timeout_s=180.0) as client:
        client.put_site("town")
        client.put_map("town", WORLD.map_document())
        client.post_scans("town", scans)
        console = Console(record=True, width=200)
        run_doctor(url, "town", console)
        assert client.get_site("town").config["max_age_s"] is None
        run_doctor(url, "town", console, apply=True)
        config = client.get_site("town").config
        assert (config["max_age_s"], config["detection"]) == (3.0, [1, 3])
        assert "set: " in console.export_text()
