"""Over REST: a crowd finds its place on the map, and a session finds itself among it."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient
from homsense_client import Client, Floors, Registration
from homsense_service import registering
from homsense_service.app import create_app
from homsense_service.choosing import HELPFUL
from homsense_service.settings import Settings
from shapely.affinity import scale
from shapely.geometry import mapping, shape
from support.corridors import Building, heard, posted
from support.networks import until

from homsense.registered import placing

pytestmark = pytest.mark.xdist_group("floor")  # one worker sets it up
SITE = "/v1/sites/floor"
BUILDING = Building.of(0)


def ready(api: TestClient, what: str = "registration") -> dict[str, Any]:
    def told() -> dict[str, Any] | None:
        found: dict[str, Any] = api.get(f"{SITE}/{what}").json()
        return found if found["state"] in {"ready", "failed"} else None

    found: dict[str, Any] = until(told, 60.0, every_s=0.1)
    return found


def knowing_the_crowd(api: TestClient) -> dict[str, Any]:
    def told() -> dict[str, Any] | None:
        found: dict[str, Any] = api.post(f"{SITE}/expectation").json()
        return found if found["state"] == "ready" and found["learnt"]["knows_crowd"] else None

    found: dict[str, Any] = until(told, 180.0, every_s=0.1)
    return found


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = Settings(data=tmp_path_factory.mktemp("data"), cell_m=1.0, expectation_wait_s=120.0)
    with TestClient(create_app(settings)) as api:
        api.put(SITE, json={"wall_tolerance_m": 1.0})
        api.put(f"{SITE}/map", json=BUILDING.document())
        crowd = [posted(scan) for scan in BUILDING.crowd(10, 40)]
        for first in range(0, len(crowd), 500):
            answer = api.post(f"{SITE}/scans", json={"scans": crowd[first : first + 500]})
            assert answer.json()["dropped"] == []
        assert api.get(f"{SITE}/registration").json()["state"] == "none"
        assert api.post(f"{SITE}/registration").status_code == 202
        yield api


def test_the_crowd_knows_its_floor(floor: TestClient) -> None:
    ready(floor)
    assert floor.get(f"{SITE}/floors").json()["state"] == "none"
    other = "/v1/sites/upstairs"
    floor.put(other, json={})
    refused = floor.post(f"{SITE}/floors", json={"sites": ["floor", "upstairs"]})
    assert (refused.status_code, refused.json()["code"]) == (409, "map_missing")
    floor.put(f"{other}/map", json=turned_over(BUILDING.document()))
    unknown = floor.post(f"{SITE}/floors", json={"sites": ["floor", "cellar"]})
    assert (unknown.status_code, unknown.json()["code"]) == (404, "site_not_found")
    nobody = floor.post(f"{SITE}/floors", json={"sites": []})
    assert nobody.json()["errors"][0]["field"] == "sites"
    assert floor.post(f"{SITE}/floors", json={"sites": ["upstairs", "floor"]}).status_code == 202
    told = ready(floor, "floors")
    assert [fit["site"] for fit in told["floors"]] == ["floor", "upstairs"]
    own, foreign = told["floors"]
    assert own["probability"] > 0.9
    assert own["probability"] + foreign["probability"] == pytest.approx(1.0)
    assert (own["doubtful"], foreign["doubtful"]) == (False, True)
    placed = floor.get(f"{SITE}/registration").json()["placed"]
    assert own["cost_m"] == placed["cost_m"] < foreign["cost_m"]
    assert own["map_version"] == placed["map_version"]

    def forward(request: httpx.Request) -> httpx.Response:
        body = {"json": json.loads(request.content)} if request.content else {}
        answer = floor.request(request.method, request.url.path, **body)
        return httpx.Response(answer.status_code, content=answer.content)

    with Client("http://test", transport=httpx.MockTransport(forward)) as client:
        again = client.rank_floors("floor", ["upstairs", "floor"])
        assert again == client.floors("floor") == Floors.from_json(told)


def turned_over(document: dict[str, Any]) -> dict[str, Any]:
    """Return the mirror image of a map."""
    for feature in document["features"]:
        feature["geometry"] = mapping(
            scale(shape(feature["geometry"]), xfact=-1.0, origin=(60.0, 0.0))
        )
    return document


def test_the_crowd_finds_its_place(floor: TestClient) -> None:
    told = ready(floor)
    assert (told["state"], told["tracked"]) == ("ready", 960)
    placed = told["placed"]
    assert placed["doubtful"] is False
    assert placed["coverage"] > 0.9
    assert placed["information_bits"] > 2.0
    assert placed["cost_m"] == placed["placements"][0]["cost_m"] < 4.0
    places = floor.get(f"{SITE}/registration?format=geojson").json()
    assert places["frame"] == "local"
    assert len(places["features"]) == placed["scans"] > 900


def test_the_site_learns_what_it_counts_from_where_the_crowd_walks(floor: TestClient) -> None:
    recognized = ready(floor)["placed"]["information_bits"]
    told = knowing_the_crowd(floor)
    learnt = told["learnt"]
    assert floor.post(f"{SITE}/expectation").json() == told
    auto = floor.post(f"{SITE}/sessions", json={"particles": 100}).json()
    helps = learnt["information_bits"][len(learnt["hops"]) - 1] >= HELPFUL * recognized
    assert auto["sensor"] == ("both" if helps else "registered")
    assert auto["hops"] == (learnt["hops"] if helps else [])
    topics = [one["topic"] for one in floor.get(f"{SITE}/diagnosis").json()["findings"]]
    assert "information" in topics
    assert "likeness" not in topics


def test_the_same_map_put_again_leaves_the_crowd_where_it_is(floor: TestClient) -> None:
    ready(floor)
    before = knowing_the_crowd(floor)
    floor.put(f"{SITE}/map", json=BUILDING.document())
    assert floor.post(f"{SITE}/expectation").json() == before
    floor.put(SITE, json={"wall_tolerance_m": 1.0, "max_age_s": 50.0})
    assert floor.post(f"{SITE}/expectation").json()["state"] == "building"
    knowing_the_crowd(floor)


def test_a_session_finds_itself_among_the_crowd(floor: TestClient) -> None:
    ready(floor)
    request = {"seed": 3, "particles": 4000, "sensor": {"type": "registered"}}
    opened = floor.post(f"{SITE}/sessions", json=request).json()
    assert (opened["sensor"], opened["hops"], opened["expected"]) == ("registered", [], None)
    rng = np.random.default_rng(5)
    places = BUILDING.walk(rng, 120.0)
    errors, before = [], 0.0
    for seq, (here, there) in enumerate(pairwise(places), start=1):
        heading = math.atan2(*(there - here)[::-1])
        length, turn = math.dist(here, there), math.remainder(heading - before, math.tau)
        before = heading
        delta = {"forward_m": length * math.cos(turn), "left_m": length * math.sin(turn),
            "turn_rad": turn, "std": [0.3, 0.3, 0.1]}  # fmt: skip
        step = {"seq": seq, "delta": delta, "landmarks": heard(BUILDING.readings(there, rng))}
        pose = floor.post(f"/v1/sessions/{opened['session']}/steps", json={"steps": [step]})
        told = pose.json()
        assert told["measurement"]["holes"] is None
        assert told["measurement"]["resembled"] > 0
        errors.append(math.dist((told["modes"][0]["x_m"], told["modes"][0]["y_m"]), there))
    assert np.median(errors) < 8.0
    assert told["coverage"] > 0.5
    moved = floor.post(f"/v1/sessions/{opened['session']}/map").json()
    assert moved["sensor"] == "registered"


def test_the_site_decides_what_a_session_measures(floor: TestClient) -> None:
    ready(floor)
    auto = floor.post(f"{SITE}/sessions", json={"particles": 100}).json()
    assert auto["sensor"] in {"registered", "both"}
    both = floor.post(f"{SITE}/sessions", json={"particles": 100, "sensor": {"type": "both"}})
    assert both.json()["sensor"] == "both"
    counting = floor.post(
        f"{SITE}/sessions", json={"particles": 100, "sensor": {"expected": "geometric"}}
    )
    assert counting.json()["sensor"] == "homology"
    step = {"seq": 1, "delta": {"forward_m": 1.0}, "landmarks": ["tx-01", "tx-02", "tx-03"]}
    for opened in (auto, both.json(), counting.json()):
        url = f"/v1/sessions/{opened['session']}/steps"
        assert floor.post(url, json={"steps": [step]}).status_code == 200


def test_a_session_may_join_the_crowd(floor: TestClient) -> None:
    before = floor.get(f"{SITE}/registration").json()["tracked"]
    request = {"particles": 100, "contribute": True, "sensor": {"type": "homology"}}
    opened = floor.post(f"{SITE}/sessions", json=request).json()
    steps = [
        {"seq": seq, "delta": {"forward_m": 2.0}, "landmarks": ["tx-01", "tx-02", "tx-03"]}
        for seq in (1, 2)
    ]
    url = f"/v1/sessions/{opened['session']}/steps"
    assert floor.post(url, json={"steps": steps}).status_code == 200
    assert floor.post(url, json={"steps": steps}).status_code == 200
    assert floor.get(f"{SITE}/registration").json()["tracked"] == before + 2


def test_a_crowd_without_tracks_finds_no_place(floor: TestClient) -> None:
    floor.put("/v1/sites/silent", json={})
    floor.put("/v1/sites/silent/map", json=BUILDING.document())
    request = {"sensor": {"type": "registered"}}
    answer = floor.post("/v1/sites/silent/sessions", json=request)
    assert (answer.status_code, answer.json()["code"]) == (409, "registration_failed")
    told = floor.get("/v1/sites/silent/registration").json()
    assert told["state"] == "failed"
    assert "too few" in told["reason"]
    assert floor.get("/v1/sites/silent/registration?format=geojson").json()["features"] == []
    floor.put("/v1/sites/bare", json={})
    assert floor.post("/v1/sites/bare/registration").json()["code"] == "map_missing"


def test_the_sdk_tells_of_the_registration(floor: TestClient) -> None:
    told = Registration.from_json(ready(floor))
    assert told.placed is not None
    assert told.placed.placements[0].cost_m == told.placed.cost_m


def test_of_a_large_crowd_some_walks_are_laid_out_and_the_others_join(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is asked what the site counts, which begins with where its crowd is."""
    crowd = [posted(scan) for scan in BUILDING.crowd(10, 40)]
    most = len(crowd) // 2
    monkeypatch.setattr(placing, "MOST_LAID_OUT", most)
    monkeypatch.setattr(registering, "MOST_LAID_OUT", most)
    with TestClient(create_app(Settings(data=tmp_path, cell_m=1.0))) as api:
        api.put(SITE, json={"wall_tolerance_m": 1.0})
        api.put(f"{SITE}/map", json=BUILDING.document())
        for first in range(0, len(crowd), 500):
            api.post(f"{SITE}/scans", json={"scans": crowd[first : first + 500]})
        assert api.post(f"{SITE}/expectation").status_code == 202
        assert api.get(f"{SITE}/registration").json()["state"] == "building"
        placed = ready(api)["placed"]
    assert placed["scans"] > 0.8 * len(crowd) > most


def test_new_walks_join_until_a_device_is_deleted(floor: TestClient) -> None:
    before = ready(floor)["placed"]
    late = [posted(replace(scan, walk=f"late-{scan.walk}")) for scan in BUILDING.crowd(77, 4)]
    floor.post(f"{SITE}/scans", json={"scans": late})
    after = ready(floor)["placed"]
    assert after["tracked"] >= before["tracked"] + len(late)
    assert after["laid_out"] == before["laid_out"]
    assert before["scans"] + 0.5 * len(late) < after["scans"] <= before["scans"] + len(late) + 60
    assert after["placements"] == before["placements"]

    floor.delete(f"{SITE}/devices/late-walk-000")
    floor.post(f"{SITE}/registration")
    again = ready(floor)["placed"]
    assert again["tracked"] == again["laid_out"] == after["tracked"] - len(late) // 4
