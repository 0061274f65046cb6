"""The REST contract, in process: what it answers, and what it says to nonsense."""

import gzip
import json
import math
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from homsense_service.store import SqliteStore
from support.builders import SITE_MAP, feature, local_map, square

JSON = {"content-type": "application/json"}
PROBLEM = "application/problem+json"


def scan(number: int, *landmarks: Any, device: str = "phone") -> dict[str, Any]:
    """Return a scan as it is posted."""
    return {
        "device": device,
        "scan_id": str(number),
        "observed_at": "2026-11-23T10:00:00Z",
        "landmarks": list(landmarks),
    }


def problem(answer: Any) -> dict[str, Any]:
    """Return the problem of an answer after checking its form."""
    body: dict[str, Any] = answer.json()
    assert answer.headers["content-type"] == PROBLEM
    assert body["status"] == answer.status_code
    assert body["type"] == f"urn:homsense:problem:{body['code']}"
    assert body["title"]
    assert body["detail"]
    return body


def test_a_site_lives_from_put_to_delete(api: TestClient) -> None:
    created = api.put("/v1/sites/hall", json={"name": "Hall", "s_max_m": 30, "hops": [1, 2]})
    assert created.status_code == 201
    again = api.put("/v1/sites/hall", json={"name": "Hall 2"})
    assert again.status_code == 200
    assert api.get("/v1/sites/hall").json()["config"]["name"] == "Hall 2"
    assert [site["site"] for site in api.get("/v1/sites").json()["sites"]] == ["hall"]
    assert api.delete("/v1/sites/hall").status_code == 204
    assert problem(api.get("/v1/sites/hall"))["code"] == "site_not_found"


def test_a_detection_that_cannot_be_is_refused(api: TestClient) -> None:
    for wrong in ([3, 2], [0, 1], [1, 6], [1], 2):
        body = problem(api.put("/v1/sites/hall", json={"detection": wrong}))
        assert body["errors"][0]["field"].startswith("detection")
    assert api.get("/v1/sites").json()["sites"] == []


def test_the_map_comes_back_as_it_was_put(api: TestClient, site: str) -> None:
    put = api.put(f"/v1/sites/{site}/map", json=SITE_MAP).json()
    assert put["structures"] == 3
    assert api.get(f"/v1/sites/{site}/map").json() == SITE_MAP
    moved = local_map(feature(square(0, 0, 21)))
    assert api.put(f"/v1/sites/{site}/map", json=moved).json()["version"] != put["version"]


def test_a_bad_map_changes_nothing(api: TestClient, site: str) -> None:
    ring = [[0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]
    bow_tie = local_map(feature({"type": "Polygon", "coordinates": [ring]}))
    body = problem(api.put(f"/v1/sites/{site}/map", json=bow_tie))
    assert (body["code"], body["errors"][0]["field"]) == (
        "invalid_map",
        "features.0.geometry.coordinates",
    )
    assert "Self-intersection" in body["detail"]
    full = local_map(feature(square(0, 0, 30)), feature(square(5, 5, 9), role="domain"))
    assert problem(api.put(f"/v1/sites/{site}/map", json=full))["code"] == "invalid_map"
    metres_as_degrees = {**SITE_MAP, "frame": "wgs84"}
    metres_as_degrees["features"] = [feature(square(500, 500, 30))]
    assert (
        '"frame": "local"'
        in problem(api.put(f"/v1/sites/{site}/map", json=metres_as_degrees))["detail"]
    )
    assert problem(api.put(f"/v1/sites/{site}/map", json=[1]))["code"] == "invalid_request"
    assert api.get(f"/v1/sites/{site}/map").json() == SITE_MAP


def test_scans_build_the_complex(api: TestClient, site: str) -> None:
    grown = api.get(f"/v1/sites/{site}/complex").json()
    assert (grown["betti"], grown["euler"]) == ([1, 1], 0)
    assert (grown["landmarks"], grown["facets"], grown["edges"]) == (4, 4, 4)
    assert (grown["observations"], grown["devices"], grown["version"]) == (4, 1, 4)
    filled = api.post(f"/v1/sites/{site}/scans", json={"scans": [scan(9, "a", "b", "c", "d")]})
    assert filled.json() == {
        "accepted": 1,
        "duplicate": 0,
        "dropped": [],
        "complex_version": 5,
    }
    assert api.get(f"/v1/sites/{site}/complex").json()["betti"] == [1, 0]


def test_a_repeated_scan_is_counted_once(api: TestClient, site: str) -> None:
    batch = {"scans": [scan(7, "x", "y"), scan(7, "x", "y"), scan(7, "x", device="other")]}
    first = api.post(f"/v1/sites/{site}/scans", json=batch).json()
    assert (first["accepted"], first["duplicate"]) == (2, 1)
    second = api.post(f"/v1/sites/{site}/scans", json=batch).json()
    assert (second["accepted"], second["duplicate"]) == (0, 3)
    assert second["complex_version"] == first["complex_version"]


def test_one_bad_scan_does_not_spoil_the_batch(api: TestClient, site: str) -> None:
    batch = [
        scan(20, "p", "q"),
        scan(21),
        {"device": "phone"},
        "nonsense",
        scan(22, 5),
        {**scan(23, "a"), "observed_at": "yesterday"},
        {**scan(24, "a"), "color": "red"},
        scan(25, *(f"l{n}" for n in range(5000))),
        scan(26, {"id": "p", "rssi": -40.5, "age_s": 1}),
    ]
    answer = api.post(f"/v1/sites/{site}/scans", json={"scans": batch})
    assert answer.status_code == 200
    body = answer.json()
    assert body["accepted"] == 2
    reasons = {item["index"]: item["reason"] for item in body["dropped"]}
    assert sorted(reasons) == [1, 2, 3, 4, 5, 6, 7]
    assert "no landmark" in reasons[1]
    assert reasons[2].startswith("scan_id:")
    assert "5000" in reasons[7]
    assert reasons[6].startswith("color:")


def test_numbers_that_are_none_are_dropped_by_name(api: TestClient, site: str) -> None:
    for number in (b"NaN", b"Infinity", b"-Infinity"):
        body = b'{"scans":[{"device":"d","scan_id":"1","observed_at":%b,"landmarks":["a"]}]}'
        answer = api.post(f"/v1/sites/{site}/scans", content=body % number, headers=JSON)
        assert answer.status_code == 200
        (dropped,) = answer.json()["dropped"]
        assert dropped["reason"].startswith("observed_at")
    answer = api.put("/v1/sites/other", content=b'{"s_max_m": NaN}', headers=JSON)
    assert problem(answer)["errors"][0]["field"] == "s_max_m"
    assert answer.status_code == 422


def test_the_complex_is_exported(api: TestClient, site: str) -> None:
    path = f"/v1/sites/{site}/complex"
    facets = api.get(path, params={"format": "facets"}).json()["facets"]
    assert facets == [["a", "b"], ["a", "d"], ["b", "c"], ["c", "d"]]
    hif = api.get(path, params={"format": "hif"}).json()
    assert hif["network-type"] == "asc"
    assert [entry["node"] for entry in hif["nodes"]] == ["a", "b", "c", "d"]
    assert {"edge": 0, "node": "a"} in hif["incidences"]
    links = api.get(path, params={"format": "node-link"}).json()
    assert len(links["edges"]) == 4
    assert problem(api.get(path, params={"format": "xml"}))["errors"][0]["field"] == "format"


def test_local_homology_counts_holes(api: TestClient, site: str) -> None:
    path = f"/v1/sites/{site}/local-homology"
    body = api.post(path, json={"landmarks": ["a", {"id": "ghost"}], "hops": [0, 1, 2]}).json()
    assert body["known"] == 1
    assert [level["holes"] for level in body["levels"]] == [0, 0, 1]
    assert [level["vertices"] for level in body["levels"]] == [1, 3, 4]
    assert [level["euler"] for level in body["levels"]] == [1, 1, 0]
    assert [level["lasting"] for level in body["levels"]] == [None, None, None]
    longer = api.post(path, json={"landmarks": ["a"], "hops": [1, 2], "lasting": True}).json()
    assert [level["lasting"] for level in longer["levels"]] == [0, 1]
    which = api.post(path, json={"landmarks": ["a"], "hops": [2], "cycles": True}).json()
    assert [sorted(cycle) for cycle in which["levels"][0]["cycles"]] == [["a", "b", "c", "d"]]
    metres = api.post(path, json={"landmarks": ["a"], "r_pseudo_m": [39.0, 40.0]}).json()
    assert [level["holes"] for level in metres["levels"]] == [0, 1]
    assert [level["r_pseudo_m"] for level in metres["levels"]] == [39.0, 40.0]
    assert [level["hops"] for level in metres["levels"]] == [None, None]
    both = api.post(path, json={"landmarks": ["a"], "r_pseudo_m": [39.0], "hops": [1]})
    assert "neither hops nor lasting" in problem(both)["detail"]
    default = api.post(path, json={"landmarks": ["a"]}).json()
    assert [level["hops"] for level in default["levels"]] == [1, 2]
    nothing = api.post(path, json={"landmarks": []}).json()
    assert [level["betti"] for level in nothing["levels"]] == [[0, 0], [0, 0]]
    for hops in ([-1], [99], [], ["2"]):
        answer = api.post(path, json={"landmarks": ["a"], "hops": hops})
        assert problem(answer)["errors"][0]["field"].startswith("hops")


def test_a_quorum_keeps_out_what_a_single_device_says(api: TestClient) -> None:
    path = "/v1/sites/ring"
    ring = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]]
    honest = [
        scan(10 * phone + n, *names) | {"device": f"phone {phone}"}
        for phone in range(2)
        for n, names in enumerate(ring)
    ]
    lie = scan(99, "a", "b", "c", "d") | {"device": "liar"}
    api.put(path, json={"quorum": 2, "hops": [2], "landmark_key": "ssid"})
    api.post(f"{path}/scans", json={"scans": [*honest[:4], lie]})
    assert api.get(f"{path}/complex").json()["betti"] == [1, 1]
    api.post(f"{path}/scans", json={"scans": honest[4:]})
    answer = api.get(f"{path}/complex").json()
    assert (answer["quorum"], answer["betti"], answer["raw"]["betti"]) == (2, [1, 1], [1, 0])
    (level,) = api.post(f"{path}/local-homology", json={"landmarks": ["a"]}).json()["levels"]
    assert (level["holes"], level["raw_holes"]) == (1, 0)
    curve = api.get(f"{path}/complex?curve=witnesses").json()
    assert [point["betti"][1] for point in curve["points"]] == [0, 1, 1, 0]
    assert [point["witnesses"] for point in curve["points"]] == [1, 2, 3, 4]
    assert (curve["quorum"], curve["median_witnesses"], curve["suggested_quorum"]) == (2, 3.0, 1)
    question = {"landmarks": ["a"], "r_pseudo_m": [500.0]}
    (level,) = api.post(f"{path}/local-homology", json=question).json()["levels"]
    assert (level["holes"], level["raw_holes"]) == (1, 0)
    api.put(path, json={"quorum": 1, "hops": [2], "landmark_key": "ssid"})
    assert api.get(f"{path}/complex").json()["betti"] == [1, 0]
    refused = api.put(path, json={"quorum": 9})
    assert problem(refused)["errors"][0]["field"] == "quorum"


def test_a_transmitter_that_has_moved_is_left_out_and_the_reason_told(api: TestClient) -> None:
    path = "/v1/sites/street"
    street = [[f"l{n + i:02d}" for i in range(3)] for n in range(20)]
    car = [["car", f"l{n:02d}", f"l{n + 1:02d}"] for n in (2, 3, 4, 14, 15, 16)]
    api.put(path, json={"hops": [1, 2], "landmark_key": "ssid"})
    scans = [scan(n, *names) for n, names in enumerate([*street, *car])]
    api.post(f"{path}/scans", json={"scans": scans[:23]})
    assert api.get(f"{path}/complex").json()["quarantined"] == []
    api.post(f"{path}/scans", json={"scans": scans[23:]})
    answer = api.get(f"{path}/complex").json()
    (found,) = answer["quarantined"]
    assert (found["landmark"], found["hops_apart"]) == ("car", 5.5)
    assert "5 hops apart without it" in found["reason"]
    assert {found["here"][0], found["there"][0]} == {"l02", "l14"}
    assert (answer["landmarks"], answer["raw"]["landmarks"]) == (22, 23)
    assert (answer["betti"], answer["raw"]["betti"]) == ([1, 0], [1, 1])
    question = {"landmarks": ["car", "l03"], "hops": [3]}
    (level,) = api.post(f"{path}/local-homology", json=question).json()["levels"]
    assert (level["holes"], level["raw_holes"]) == (0, 1)
    api.put(path, json={"hops": [1, 2], "landmark_key": "ssid", "quarantine": False})
    assert api.get(f"{path}/complex").json()["betti"] == [1, 1]


def test_the_range_self_check_finds_the_cut_at_which_holes_last(api: TestClient) -> None:
    levels = {"ab": -50, "bc": -50, "cd": -52, "da": -52, "abcd": -75}
    scans = [
        scan(n, *({"id": name, "rssi": dbm} for name in names))
        for n, (names, dbm) in enumerate(levels.items())
    ]
    api.put("/v1/sites/ring", json={})
    empty = api.get("/v1/sites/ring/complex?curve=rssi").json()
    assert empty["chosen_min_rssi_dbm"] is None
    api.post("/v1/sites/ring/scans", json={"scans": scans})
    curve = api.get("/v1/sites/ring/complex?curve=rssi").json()
    assert [point["betti"][1] for point in curve["points"]] == [0, 0, 0, *[1] * 7, 0]
    assert curve["chosen_min_rssi_dbm"] == -69.0
    assert not any(point["alarm"] for point in curve["points"])
    assert (curve["version"], curve["min_rssi_dbm"]) == (5, None)


def test_the_site_decides_what_is_visible(api: TestClient, site: str) -> None:
    weak = [scan(n, {"id": i, "rssi": -90}, {"id": j, "rssi": -90}) for n, (i, j) in enumerate(
        [("s", "t"), ("t", "u"), ("u", "s")])]  # fmt: skip
    api.put("/v1/sites/weak", json={"min_rssi_dbm": -80.0, "landmark_key": "ssid"})
    api.post("/v1/sites/weak/scans", json={"scans": weak})
    assert api.get("/v1/sites/weak/complex").json()["landmarks"] == 0
    api.put("/v1/sites/weak", json={"min_rssi_dbm": -95.0, "landmark_key": "ssid"})
    assert api.get("/v1/sites/weak/complex").json()["betti"] == [1, 1]
    spelled = [scan(91, "AA-BB-CC-00-11-22"), scan(92, "aa:bb:cc:00:11:22")]
    api.post(f"/v1/sites/{site}/scans", json={"scans": spelled})
    facets = api.get(f"/v1/sites/{site}/complex", params={"format": "facets"}).json()["facets"]
    assert ["aa:bb:cc:00:11:22"] in facets


def test_a_height_map_is_numbers_or_a_picture(api: TestClient, site: str) -> None:
    path = f"/v1/sites/{site}/heightmaps/2"
    grid = api.get(path).json()
    assert len(grid["values"]) == grid["rows"]
    assert len(grid["values"][0]) == grid["columns"]
    picture = api.get(path, headers={"accept": "image/png"})
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")
    api.put("/v1/sites/bare", json={})
    assert problem(api.get("/v1/sites/bare/heightmaps/2"))["code"] == "map_missing"


def test_a_radius_that_is_set_is_used(api: TestClient, site: str) -> None:
    api.put(f"/v1/sites/{site}", json={"hops": [1, 2], "r_geo_m": [33.0, 66.0]})
    opened = api.post(f"/v1/sites/{site}/sessions", json={"particles": 50}).json()
    assert opened["r_geo_m"] == [33.0, 66.0]
    answer = api.put(f"/v1/sites/{site}", json={"hops": [1, 2], "r_geo_m": [33.0]})
    assert "r_geo_m" in problem(answer)["detail"]
    assert "rise" in problem(api.put(f"/v1/sites/{site}", json={"hops": [2, 1]}))["detail"]


def _open(api: TestClient, site: str, **options: Any) -> str:
    answer = api.post(f"/v1/sites/{site}/sessions", json={"particles": 300, "seed": 1, **options})
    assert answer.status_code == 201
    name: str = answer.json()["session"]
    return name


def _step(api: TestClient, session: str, *steps: dict[str, Any]) -> Any:
    return api.post(f"/v1/sessions/{session}/steps", json={"steps": list(steps)})


def test_a_session_takes_steps_and_tells_the_pose(api: TestClient, site: str) -> None:
    session = _open(api, site)
    before = api.get(f"/v1/sessions/{session}/pose").json()
    assert (before["status"], before["pose"], before["tick"]) == ("initializing", None, 0)
    pose = _step(
        api,
        session,
        {"seq": 2, "t": 2.5, "delta": {"forward_m": 1.0, "std": [0.1, 0.1, 0.1]}},
        {"seq": 1, "t": 1.5, "landmarks": ["a", {"id": "b", "rssi": -40}]},
    ).json()
    assert (pose["seq"], pose["tick"], pose["t"]) == (2, 2, 2.5)
    assert pose["modes"][0]["weight"] == pose["confidence"]
    assert set(pose["region_area_m2"]) == {"50%", "90%", "95%"}
    seen = _step(api, session, {"seq": 3, "landmarks": ["a"]}).json()
    assert seen["measurement"] == {"hops": [1, 2], "holes": [0, 1], "resembled": None}
    blind = _step(api, session, {"seq": 4, "landmarks": ["ghost"]}).json()
    assert blind["measurement"] is None
    assert len(api.get(f"/v1/sessions/{session}/particles?n=7").json()["particles"]) == 7
    shapes = api.get(f"/v1/sessions/{session}/distribution").json()
    assert shapes["frame"] == "local"
    assert {f["properties"]["kind"] for f in shapes["features"]} == {"mode", "region"}
    grid = api.get(f"/v1/sessions/{session}/distribution?format=grid").json()
    assert grid["encoding"] == "base64-uint8"
    assert api.delete(f"/v1/sessions/{session}").status_code == 204
    assert problem(_step(api, session, {"seq": 5}))["code"] == "session_not_found"


def test_a_repeated_step_answers_as_before_and_changes_nothing(api: TestClient, site: str) -> None:
    session = _open(api, site)
    steps = [{"seq": n, "delta": {"forward_m": 1.0}, "landmarks": ["a"]} for n in (1, 2, 3)]
    first = _step(api, session, *steps).json()
    _step(api, session, {"seq": 4, "delta": {"forward_m": 5.0}})
    assert _step(api, session, *steps).json() == first
    assert api.get(f"/v1/sessions/{session}/pose").json()["tick"] == 4
    overlapping = _step(api, session, steps[2], {"seq": 4, "delta": {"forward_m": 5.0}},
                        {"seq": 5}).json()  # fmt: skip
    assert (overlapping["seq"], overlapping["tick"]) == (5, 5)


def test_a_step_that_goes_back_is_refused_whole(api: TestClient, site: str) -> None:
    session = _open(api, site)
    _step(api, session, {"seq": 10})
    for steps in (
        [{"seq": 5}, {"seq": 11}],
        [{"seq": 10, "delta": {"forward_m": 3.0}}],
        [{"seq": 12}, {"seq": 12, "delta": {"turn_rad": 1.0}}],
    ):
        assert problem(_step(api, session, *steps))["code"] == "sequence_conflict"
    assert api.get(f"/v1/sessions/{session}/pose").json()["tick"] == 1


def test_equal_seeds_and_inputs_give_equal_poses(api: TestClient, site: str) -> None:
    steps = [{"seq": n, "delta": {"forward_m": 2.0}, "landmarks": ["a"]} for n in range(1, 6)]
    one, other = (_step(api, _open(api, site), *steps).json() for _ in range(2))
    assert {**one, "session": ""} == {**other, "session": ""}


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"particles": 0}, "particles"),
        ({"particles": 10**7}, "particles"),
        ({"particles": 10.5}, "particles"),
        ({"particles": "many"}, "particles"),
        ({"seed": -1}, "seed"),
        ({"prior": {"type": "psychic"}}, "prior"),
        ({"prior": {"type": "gaussian", "x_m": 0, "y_m": 0, "std_m": 0}}, "prior"),
        ({"prior": {"type": "gaussian", "x_m": 1e5, "y_m": 0, "std_m": 1}}, "prior"),
        ({"prior": {"type": "polygon", "ring": [[0, 0], [9, 9], [9, 0], [0, 9]]}}, "prior.ring"),
        ({"sensor": {"sigma": -1}}, "sensor.sigma"),
        ({"sensor": {"type": "sixth"}}, "sensor.type"),
        ({"motion": {"type": "imu", "sigma_linear": -1}}, "motion"),
        ({"speed": 3}, "speed"),
        ({"scheme": "best"}, "scheme"),
        ({"recovery": {"type": "relocation", "probability": 1}}, "recovery"),
        ({"recovery": {"type": "amcl", "recovery_alpha_slow": 0.5}}, "recovery.alpha_slow"),
        ({"adaptive": {"least": 9, "most": 3}}, "adaptive.least"),
        ({"adaptive": {"quantile": 2.3}}, "adaptive.quantile"),
        ({"weigh_every_m": -1}, "weigh_every_m"),
    ],
)
def test_a_session_that_makes_no_sense_is_refused_by_name(
    api: TestClient, site: str, options: dict[str, Any], field: str
) -> None:
    answer = api.post(f"/v1/sites/{site}/sessions", json=options)
    assert answer.status_code == 422
    assert problem(answer)["errors"][0]["field"].startswith(field)


@pytest.mark.parametrize(
    ("step", "field"),
    [
        ({"seq": 0}, "steps.0.seq"),
        ({"seq": -3}, "steps.0.seq"),
        ({"seq": "1"}, "steps.0.seq"),
        ({"seq": 1, "delta": {"forward_m": 1e9}}, "steps.0.delta.forward_m"),
        ({"seq": 1, "delta": {"std": [1]}}, "steps.0.delta.std"),
        ({"seq": 1, "landmarks": "abc"}, "steps.0.landmarks"),
        ({"seq": 1, "landmarks": [""]}, "steps.0.landmarks.0"),
        ({"seq": 1, "t": "noon"}, "steps.0.t"),
        ({"seq": 1, "imu": []}, "steps.0.imu"),
        ({"seq": 1, "imu": [{"dt_s": 0, "forward": 0, "left": 0, "turn": 0}]}, "steps.0.imu"),
        ({"seq": 1, "walked": {"length_m": -1, "heading_rad": 0}}, "steps.0.walked.length_m"),
        ({"seq": 1, "delta": {}, "walked": {"length_m": 1, "heading_rad": 0}}, "steps.0"),
        ({"seq": 1, "delta": {"covariance": [-1] + [0] * 8}}, "covariance"),
    ],
)
def test_a_bad_step_is_refused_by_name(
    api: TestClient, site: str, step: dict[str, Any], field: str
) -> None:
    session = _open(api, site)
    answer = _step(api, session, step)
    assert answer.status_code == 422
    assert problem(answer)["errors"][0]["field"].startswith(field)
    assert api.get(f"/v1/sessions/{session}/pose").json()["tick"] == 0


@pytest.mark.parametrize("std_rad", [0.1, 1e300])
@pytest.mark.parametrize("mean_rad", [1e300, -1e6 - 1.0, 1e6, 7.0])
def test_a_heading_is_refused_or_every_particle_has_one(
    api: TestClient, site: str, mean_rad: float, std_rad: float
) -> None:
    prior = {"type": "uniform", "heading": {"mean_rad": mean_rad, "std_rad": std_rad}}
    answer = api.post(f"/v1/sites/{site}/sessions", json={"particles": 50, "prior": prior})
    if abs(mean_rad) > 1e6:
        assert answer.status_code == 422
        assert problem(answer)["errors"][0]["field"].endswith("heading.mean_rad")
    else:
        told = answer.json()["pose"]["modes"][0]["heading"]
        assert (told["resultant"] > 0.9) is (std_rad < 1.0)
        if std_rad < 1.0:
            off_rad = math.remainder(told["mean_rad"] - mean_rad, math.tau)
            assert abs(off_rad) < 0.2


def test_priors_and_motions_of_every_kind_are_taken(api: TestClient, site: str) -> None:
    heading = {"mean_rad": 1.0, "std_rad": 0.1}
    ring = [[-10, -10], [60, -10], [60, 60], [-10, 60]]
    for prior in (
        {"type": "uniform", "heading": heading},
        {"type": "gaussian", "x_m": 30, "y_m": 30, "std_m": 5, "heading": heading},
        {"type": "polygon", "ring": ring},
    ):
        session = _open(api, site, prior=prior, motion={"type": "imu"}, sensor={"type": "auto"})
        assert _step(api, session, {"seq": 1, "t": 0.0}, {"seq": 2, "t": 0.5}).status_code == 200


def test_recovery_and_adaptive_numbers_of_every_kind_are_taken(api: TestClient, site: str) -> None:
    for options in (
        {"recovery": {"type": "none"}},
        {"recovery": {"type": "amcl"}, "scheme": "residual"},
        {"adaptive": {"least": 100, "most": 500}, "resample_below": 1.0},
    ):
        session = _open(api, site, **options)
        pose = _step(api, session, {"seq": 1, "landmarks": ["a"]}).json()
        assert pose["health"]["relocation_p"] < 1.0
        assert len(pose["digest"]) == 16
        if "adaptive" in options:
            assert 100 <= pose["health"]["particles"] <= 500


def test_an_imu_and_a_pedestrian_move_as_a_delta_does(api: TestClient, site: str) -> None:
    prior = {
        "type": "gaussian", "x_m": 30.0, "y_m": 30.0, "std_m": 0.5,
        "heading": {"mean_rad": 0.0, "std_rad": 0.001},
    }  # fmt: skip
    push = [{"dt_s": 0.5, "forward": 2.0, "left": 0.0, "turn": 0.0}] * 2
    for steps in (
        [{"seq": 1, "imu": push}, {"seq": 2, "imu": push}],
        [
            {"seq": 1, "walked": {"length_m": 2.0, "heading_rad": 5.0}},
            {"seq": 2, "walked": {"length_m": 2.0, "heading_rad": 5.0}},
        ],
        [{"seq": 1, "delta": {"forward_m": 4.0, "covariance": [0.0] * 9}}],
    ):
        session = _open(api, site, prior=prior)
        best = _step(api, session, *steps).json()["pose"]
        assert best["x_m"] == pytest.approx(34.0, abs=0.6)
        assert best["y_m"] == pytest.approx(30.0, abs=0.6)


def test_a_session_moves_to_another_map_when_it_is_told_to(api: TestClient, site: str) -> None:
    session = _open(api, site)
    before = api.get(f"/v1/sessions/{session}/pose").json()
    other = local_map(feature(square(0, 0, 20)), feature(square(40, 0, 25)))
    assert api.put(f"/v1/sites/{site}/map", json=other).status_code == 200
    stayed = _step(api, session, {"seq": 1}).json()
    assert stayed["map_version"] == before["map_version"]
    assert api.get(f"/v1/sessions/{session}/pose").json() == stayed
    moved = api.post(f"/v1/sessions/{session}/map").json()
    assert moved["map_version"] == moved["pose"]["map_version"] != before["map_version"]
    assert moved["pose"]["tick"] == 1
    assert api.get(f"/v1/sessions/{session}/pose").json() == moved["pose"]
    again = api.post(f"/v1/sessions/{session}/map").json()
    assert again["pose"]["digest"] == moved["pose"]["digest"]
    assert _step(api, session, {"seq": 2}).json()["map_version"] == moved["map_version"]


def test_a_map_on_earth_gives_positions_on_earth(api: TestClient) -> None:
    api.put("/v1/sites/earth", json={"origin": {"lat": 60.17, "lon": 24.94}})
    api.put("/v1/sites/earth/map", json=SITE_MAP)
    api.post("/v1/sites/earth/scans", json={"scans": [scan(1, "a", "b")]})
    prior = {"type": "gaussian", "x_m": 30, "y_m": 30, "std_m": 2}
    session = _open(api, "earth", prior=prior)
    geo = _step(api, session, {"seq": 1}).json()["geo"]
    assert geo["lat"] == pytest.approx(60.17, abs=0.001)
    shapes = api.get(f"/v1/sessions/{session}/distribution").json()
    assert "frame" not in shapes
    assert shapes["features"][0]["geometry"]["coordinates"][0] == pytest.approx(24.94, abs=0.01)


def test_sessions_are_limited(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data=tmp_path, max_sessions=1))) as api:
        api.put("/v1/sites/a", json={})
        assert problem(api.post("/v1/sites/a/sessions", json={}))["code"] == "map_missing"
        api.put("/v1/sites/a/map", json=SITE_MAP)
        session = _open(api, "a")
        answer = api.post("/v1/sites/a/sessions", json={"particles": 10})
        assert (answer.status_code, problem(answer)["code"]) == (503, "capacity")
        api.delete("/v1/sites/a")
        assert problem(api.get(f"/v1/sessions/{session}/pose"))["code"] == "session_not_found"


def test_everything_but_sessions_survives_a_restart(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path / "data")
    with TestClient(create_app(settings)) as api:
        api.put("/v1/sites/a", json={"name": "A", "hops": [1, 3], "r_geo_m": [10.0, 20.0]})
        api.put("/v1/sites/a/map", json=SITE_MAP)
        scans = [scan(n, f"l{n}", f"l{n + 1}") for n in range(9)]
        api.post("/v1/sites/a/scans", json={"scans": scans})
        before = [api.get(f"/v1/sites/a{rest}").json() for rest in ("", "/map", "/complex")]
    with TestClient(create_app(settings)) as api:
        after = [api.get(f"/v1/sites/a{rest}").json() for rest in ("", "/map", "/complex")]
        repeated = api.post("/v1/sites/a/scans", json={"scans": scans}).json()
    assert after == before
    assert repeated["duplicate"] == 9


def test_a_data_directory_has_one_owner(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data=tmp_path))) as api:
        api.put("/v1/sites/a", json={})
        with (
            pytest.raises(Exception, match="cannot be used"),
            TestClient(create_app(Settings(data=tmp_path))),
        ):
            pass
        assert api.get("/healthz").json() == {"status": "ok"}


def test_gzip_is_taken_and_bounded(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, max_body_bytes=100_000)
    with TestClient(create_app(settings)) as api:
        api.put("/v1/sites/a", json={})
        body = json.dumps({"scans": [scan(1, "a", "b")]}).encode()
        headers = {**JSON, "content-encoding": "gzip"}

        def post(content: bytes) -> Any:
            return api.post("/v1/sites/a/scans", content=content, headers=headers)

        assert post(gzip.compress(body)).json()["accepted"] == 1
        bomb = gzip.compress(b" " * 50_000_000)
        assert len(bomb) < 100_000
        for content, status, code in (
            (bomb, 413, "body_too_large"),
            (body * 2000, 413, "body_too_large"),
            (b"not gzip", 400, "malformed_gzip"),
            (gzip.compress(body)[:-4], 400, "malformed_gzip"),
            (gzip.compress(body) + b"x", 400, "malformed_gzip"),
        ):
            answer = post(content)
            assert (answer.status_code, problem(answer)["code"]) == (status, code)


def test_five_megabytes_of_landmarks_are_refused(api: TestClient, site: str) -> None:
    many = [f"{n:020d}" for n in range(230_000)]
    answer = api.post(f"/v1/sites/{site}/local-homology", json={"landmarks": many})
    assert (answer.status_code, problem(answer)["code"]) == (422, "invalid_request")
    one_name = "x" * 5_000_000
    body = api.post(f"/v1/sites/{site}/scans", json={"scans": [scan(50, one_name)]}).json()
    assert len(body["dropped"]) == 1
    huge = json.dumps({"scans": [scan(51, "y" * 40_000_000)]}).encode()
    answer = api.post(f"/v1/sites/{site}/scans", content=huge, headers=JSON)
    assert (answer.status_code, problem(answer)["code"]) == (413, "body_too_large")


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[]", b"null", b'"x"', b"[" * 5000])
def test_a_body_that_is_no_object_is_refused(api: TestClient, site: str, content: bytes) -> None:
    for path in (f"/v1/sites/{site}/scans", f"/v1/sites/{site}/sessions"):
        answer = api.post(path, content=content, headers=JSON)
        assert answer.status_code in (400, 422)
        assert problem(answer)["code"] in ("malformed_json", "invalid_request")


def test_what_does_not_exist_is_a_problem_too(api: TestClient) -> None:
    assert problem(api.get("/v1/nothing"))["status"] == 404
    wrong = api.post("/healthz")
    assert problem(wrong)["code"] == "method_not_allowed"
    assert wrong.headers["allow"] == "GET"
    for path in ("/v1/sites/nope", "/v1/sites/nope/map", "/v1/sites/nope/complex"):
        assert problem(api.get(path))["code"] == "site_not_found"
    assert problem(api.get("/v1/sites/-bad-"))["code"] == "invalid_request"
    assert problem(api.get("/v1/sessions/nope/pose"))["code"] == "session_not_found"
    assert api.get("/v1/info").json()["name"] == "homsense"


def test_an_epoch_has_a_length(api: TestClient) -> None:
    for days in (0.0, 1e-320, 1e-9):
        config = {"retention": {"epoch_days": days, "epochs": 4}}
        assert api.put("/v1/sites/a", json=config).status_code == 422


def test_operators_see_what_happens(tmp_path: Path) -> None:
    opened: list[SqliteStore] = []

    def open_store(directory: Path) -> SqliteStore:
        opened.append(SqliteStore(directory))
        return opened[0]

    with TestClient(create_app(Settings(data=tmp_path), open_store)) as api:
        api.put("/v1/sites/a", json={})
        api.post("/v1/sites/a/scans", json={"scans": [scan(1, "a"), scan(1, "a"), scan(2)]})
        told = api.get("/readyz").json()
        assert (told["status"], told["commit_age_s"]) == ("ok", 0.0)
        text = api.get("/metrics").text
        for line in (
            'homsense_scans_total{result="accepted"} 1.0',
            'homsense_scans_total{result="duplicate"} 1.0',
            'homsense_scans_total{result="dropped"} 1.0',
            "homsense_sites 1.0",
            "homsense_sessions 0.0",
        ):
            assert line in text
        assert 'route="/v1/sites/{site}/scans",status="200"' in text
        opened[0].close()
        assert problem(api.get("/readyz"))["code"] == "store"
        assert api.get("/healthz").status_code == 200


def test_an_unforeseen_failure_is_a_problem_without_its_cause(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path))

    @app.get("/fail")
    def fail() -> None:
        message = "a secret"
        raise RuntimeError(message)

    with TestClient(app, raise_server_exceptions=False) as api:
        body = problem(api.get("/fail"))
    assert body["code"] == "internal"
    assert "secret" not in json.dumps(body)


def test_a_session_is_opened_once_under_one_key(api: TestClient, site: str) -> None:
    path, body = f"/v1/sites/{site}/sessions", {"particles": 50, "seed": 1}
    head = {"Idempotency-Key": "once"}
    first = api.post(path, json=body, headers=head).json()
    api.post(f"/v1/sessions/{first['session']}/steps", json={"steps": [{"seq": 1}]})
    again = api.post(path, json=body, headers=head).json()
    assert (again["session"], again["pose"]["seq"]) == (first["session"], 1)
    other = api.post(path, json={"particles": 60}, headers=head)
    assert (other.status_code, other.json()["code"]) == (422, "idempotency_mismatch")
    assert api.post(path, json=body).json()["session"] != first["session"]
    api.delete(f"/v1/sessions/{first['session']}").raise_for_status()
    assert api.post(path, json=body, headers=head).json()["session"] != first["session"]


def test_a_session_is_opened_once_even_over_a_restart(tmp_path: Path) -> None:
    found = []
    for _ in range(2):
        with TestClient(create_app(Settings(data=tmp_path)), base_url="http://test") as api:
            api.put("/v1/sites/yard", json={})
            api.put("/v1/sites/yard/map", json=SITE_MAP)
            head = {"Idempotency-Key": "once"}
            answer = api.post("/v1/sites/yard/sessions", json={"particles": 50}, headers=head)
            found.append(answer.json()["session"])
    assert found[0] == found[1]
