"""Any number in a request is refused by name, or whatever follows is made of finite numbers."""

import copy
import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from httpx2 import Response
from support.builders import SITE_MAP

Where = tuple[str | int, ...]

EXTREMES = (1e300, -1e300, 1e39, 5e-324, 2.0**63, 0.0, -1.0)
HEADING = {"mean_rad": 1.0, "std_rad": 0.1}
RING = [[-10.0, -10.0], [-1.0, -10.0], [-1.0, -1.0], [-10.0, -1.0]]
PARTS: dict[str, list[dict[str, Any]]] = {
    "prior": [
        {"type": "uniform", "heading": HEADING},
        {"type": "gaussian", "x_m": -5.0, "y_m": -5.0, "std_m": 3.0, "heading": HEADING},
        {"type": "polygon", "ring": RING},
    ],
    "motion": [
        {"type": "imu", "sigma_linear": 10.0, "sigma_angular": 0.4},
        {"type": "odometry", "translation_per_m": 0.1, "rotation_per_rad": 0.1},
    ],
    "sensor": [
        {
            "type": "homology",
            "expected": "geometric",
            "sigma": 1.0,
            "floor": 0.01,
            "correlation_m": 9,
        }
    ],
    "recovery": [
        {"type": "relocation", "probability": 0.05},
        {"type": "amcl", "recovery_alpha_slow": 0.001, "recovery_alpha_fast": 0.1},
    ],
    "adaptive": [
        {"least": 10, "most": 60, "error": 0.05, "quantile": 0.99, "cell_m": 8, "cell_rad": 0.3}
    ],
}
OPENED = [{part: one, "particles": 60, "seed": 1} for part, some in PARTS.items() for one in some]
STEPS: list[dict[str, Any]] = [
    {"delta": {"forward_m": 1.0, "left_m": 0.1, "turn_rad": 0.1, "std": [0.1, 0.1, 0.01]}},
    {"delta": {"forward_m": 1.0, "covariance": [0.1, 0, 0, 0, 0.1, 0, 0, 0, 0.01]}},
    {"walked": {"length_m": 1.0, "heading_rad": 1.0}},
    {"imu": [{"dt_s": 0.1, "forward": 1.0, "left": 0.1, "turn": 0.1}], "t": 1.7e9},
]


def numbers(node: object, where: Where = ()) -> Iterator[Where]:
    """Yield where the numbers of a document are."""
    if isinstance(node, int | float):
        yield where
    elif isinstance(node, dict | list):
        for name, part in node.items() if isinstance(node, dict) else enumerate(node):
            yield from numbers(part, (*where, name))


def spoiled(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the document with each of its numbers replaced by each extreme."""
    for *way, last in numbers(document):
        for extreme in EXTREMES:
            other = copy.deepcopy(document)
            node: Any = other
            for name in way:
                node = node[name]
            node[last] = extreme
            yield other


def sound(answer: Response) -> bool:
    """Check an answer; tell whether the request was taken."""
    document = json.loads(answer.text, parse_constant=pytest.fail)
    if answer.is_success:
        return True
    assert answer.status_code == 422, answer.text
    assert document["errors"][0]["field"]
    return False


def drive(api: TestClient, session: str, *steps: dict[str, Any]) -> None:
    """Drive on, and look at what comes of it."""
    numbered = [{"seq": 1 + number, **step} for number, step in enumerate(steps)]
    if sound(api.post(f"/v1/sessions/{session}/steps", json={"steps": numbered})):
        assert sound(api.get(f"/v1/sessions/{session}/distribution"))
    assert api.delete(f"/v1/sessions/{session}").is_success


@pytest.mark.parametrize("document", OPENED, ids=lambda one: next(iter(one)))
def test_a_session_is_refused_or_has_finite_poses(
    api: TestClient, site: str, document: dict[str, Any]
) -> None:
    path = f"/v1/sites/{site}/sessions"
    assert sound(api.post(path, json=document))
    for body in spoiled(document):
        opened = api.post(path, json=body)
        if sound(opened):
            move = {"delta": {"forward_m": 2.0, "turn_rad": 0.1}}
            drive(api, opened.json()["session"], move, {**move, "landmarks": ["a"]})


@pytest.mark.parametrize("step", STEPS, ids="-".join)
def test_a_step_is_refused_or_leads_to_finite_poses(
    api: TestClient, site: str, step: dict[str, Any]
) -> None:
    for body in spoiled(step):
        opened = api.post(f"/v1/sites/{site}/sessions", json={"particles": 60, "seed": 1})
        drive(api, opened.json()["session"], body, {"walked": {"length_m": 1, "heading_rad": 2}})


def test_a_scan_is_refused_or_absorbed(api: TestClient, site: str) -> None:
    heard = [{"id": "a", "rssi": -50.0, "age_s": 0.5}]
    track = {"id": "walk", "x_m": 1.0, "y_m": 2.0, "heading_rad": 0.1}
    scan = {"device": "d", "observed_at": 1.7e9, "landmarks": heard, "track": track}
    for number, body in enumerate(spoiled(scan)):
        scans = [{**body, "scan_id": str(number)}]
        sound(api.post(f"/v1/sites/{site}/scans", json={"scans": scans}))
    for path in ("complex", "registration", "diagnosis", "complex?curve=rssi"):
        assert sound(api.get(f"/v1/sites/{site}/{path}"))


def test_a_configuration_or_a_map_is_refused_or_works(api: TestClient, site: str) -> None:
    config = api.get(f"/v1/sites/{site}").json()["config"]
    for body in spoiled(config):
        if sound(api.put("/v1/sites/other", json=body)):
            assert sound(api.put("/v1/sites/other/map", json=SITE_MAP))
            assert sound(api.post("/v1/sites/other/sessions", json={"particles": 30}))
    for body in spoiled(SITE_MAP):
        if sound(api.put("/v1/sites/other/map", json=body)):
            assert sound(api.post("/v1/sites/other/sessions", json={"particles": 30}))
