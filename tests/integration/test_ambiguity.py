"""Over REST: where a crowd fits its map in two ways, a session believes in both."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from fastapi.testclient import TestClient
from homsense_service.app import create_app
from homsense_service.settings import Settings
from support.corridors import TURNED_ALIKE, Building, heard, posted
from support.networks import until

SITE = "/v1/sites/hotel"
BUILDING = Building.of(0, corridors=TURNED_ALIKE)


def placed(api: TestClient) -> dict[str, Any] | None:
    told = api.get(f"{SITE}/registration").json()
    assert told["state"] != "failed", told
    found: dict[str, Any] | None = told["placed"]
    return found


def test_a_session_believes_in_both_placements_until_its_compass_decides(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, cell_m=1.0)
    with TestClient(create_app(settings)) as api:
        api.put(SITE, json={"track_headings": "common", "wall_tolerance_m": 1.0})
        api.put(f"{SITE}/map", json=BUILDING.document()).raise_for_status()
        scans = [posted(scan) for scan in BUILDING.crowd(10, 14)]
        assert api.post(f"{SITE}/scans", json={"scans": scans}).json()["dropped"] == []
        api.post(f"{SITE}/registration")
        told = until(lambda: placed(api), 120.0, every_s=0.1)
        assert told["doubtful"]
        shares = [placement["probability"] for placement in told["placements"]]
        assert min(shares[:2]) > 0.2
        assert math.isclose(sum(shares), 1.0)

        sensor = {"particles": 4000, "seed": 1, "sensor": {"type": "registered"}}
        lost = api.post(f"{SITE}/sessions", json=sensor).json()["session"]
        compass = {"type": "uniform", "heading": {"mean_rad": 0.0, "std_rad": 0.2}}
        sure = api.post(f"{SITE}/sessions", json={**sensor, "prior": compass}).json()["session"]
        rng = np.random.default_rng(5)
        places = np.array([(10.0 + 2.0 * step, 5.0) for step in range(20)])
        for seq, (here, there) in enumerate(pairwise(places), start=1):
            delta = {"forward_m": math.dist(here, there), "left_m": 0.0, "turn_rad": 0.0,
                "std": [0.3, 0.3, 0.05]}  # fmt: skip
            step = {"seq": seq, "delta": delta, "landmarks": heard(BUILDING.readings(there, rng))}
            believed, known = (
                api.post(f"/v1/sessions/{session}/steps", json={"steps": [step]}).json()
                for session in (lost, sure)
            )
        truth = places[-1]
        for place in (truth, (120.0, 80.0) - truth):
            near = [
                mode["weight"]
                for mode in believed["modes"]
                if math.dist((mode["x_m"], mode["y_m"]), place) < 8.0
            ]
            assert sum(near) > 0.2
        assert believed["confidence"] < 0.8 < known["confidence"]
        assert math.dist((known["pose"]["x_m"], known["pose"]["y_m"]), truth) < 8.0
    with TestClient(create_app(settings)) as api:
        again = api.get(f"/v1/sessions/{lost}/pose").json()
        assert again["digest"] == believed["digest"]
