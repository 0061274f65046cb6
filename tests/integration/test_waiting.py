"""Those who wait for something slow keep nobody else from being answered."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from homsense_client.streaming import Robot, connect
from homsense_service.app import create_app
from homsense_service.expecting import Expecting
from homsense_service.operations import Operations
from homsense_service.settings import Settings
from homsense_service.sites import SiteRegistry
from homsense_service.turns import MOST_WAITING
from support.builders import SITE_MAP
from support.networks import endpoint, fill, until

CROWD = 60
"""More than the threads that a service of this kind has when nobody says how many."""
SOON_S = 10.0


@pytest.fixture
def crowd() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(CROWD + 1) as pool:
        yield pool


@contextmanager
def serving(directory: Path, **settings: Any) -> Iterator[TestClient]:
    """Serve two sites, one of which has a map and enough scans to learn from."""
    chosen = Settings(data=directory, engine="python", expectation_wait_s=60.0, **settings)
    with TestClient(create_app(chosen)) as api:
        for site in ("yard", "other"):
            api.put(f"/v1/sites/{site}", json={}).raise_for_status()
        api.put("/v1/sites/yard/map", json=SITE_MAP).raise_for_status()
        scans = [scan(number, f"l{number % 7}", f"l{number % 5}") for number in range(60)]
        api.post("/v1/sites/yard/scans", json={"scans": scans}).raise_for_status()
        yield api


def scan(number: int, *landmarks: str) -> dict[str, Any]:
    return {
        "device": "phone", "scan_id": str(number), "observed_at": 0.0, "landmarks": landmarks,
    }  # fmt: skip


def operations(api: TestClient) -> Operations:
    found: Operations = api.app.state.operations  # type: ignore[attr-defined]
    return found


def all_wait(api: TestClient, crowd: ThreadPoolExecutor, count: int) -> None:
    """Wait until so many requests wait; whoever asks is answered meanwhile."""

    def pending() -> int:
        return int(crowd.submit(api.get, "/readyz").result(SOON_S).json()["pending_requests"])

    until(lambda: pending() > count)


def everybody_else_is_answered(api: TestClient, crowd: ThreadPoolExecutor) -> None:
    for path in ("/healthz", "/readyz", "/metrics", "/v1/info"):
        assert crowd.submit(api.get, path).result(SOON_S).status_code == 200
    posted = {"scans": [scan(time.monotonic_ns(), "a")]}
    answer = crowd.submit(api.post, "/v1/sites/other/scans", json=posted)
    assert answer.result(SOON_S).status_code == 200


def comes_back_later(refused: Any, code: str) -> None:
    assert (refused.status_code, refused.json()["code"]) == (503, code)
    assert int(refused.headers["retry-after"]) > 0


def test_a_crowd_that_waits_for_a_site_holds_up_no_other(
    tmp_path: Path, crowd: ThreadPoolExecutor
) -> None:
    with serving(tmp_path) as api:

        def post(number: int) -> Any:
            body = {"scans": [scan(1000 + number, "a", "b")]}
            return api.post("/v1/sites/yard/scans", json=body)

        with operations(api).sites.get("yard").writing:
            posts = [crowd.submit(post, number) for number in range(CROWD)]
            all_wait(api, crowd, CROWD)
            everybody_else_is_answered(api, crowd)
        assert all(answer.result(SOON_S).status_code == 200 for answer in posts)


@pytest.fixture
def learning(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Hold back what a site learns until the event is set."""
    go_on, build = threading.Event(), Expecting._build

    def held_back(self: Expecting, question: Any, on_step: Callable[[int], None]) -> Any:
        assert go_on.wait(30.0)
        return build(self, question, on_step)

    monkeypatch.setattr(Expecting, "_build", held_back)
    yield go_on
    go_on.set()


def opened(api: TestClient, seed: int) -> Any:
    return api.post("/v1/sites/yard/sessions", json={"particles": 50, "seed": seed})


def test_a_fleet_that_waits_for_its_site_to_learn_holds_up_no_other(
    tmp_path: Path, crowd: ThreadPoolExecutor, learning: threading.Event
) -> None:
    with serving(tmp_path) as api:
        fleet = [crowd.submit(opened, api, seed) for seed in range(CROWD)]
        all_wait(api, crowd, CROWD)
        everybody_else_is_answered(api, crowd)
        learning.set()
        assert all(answer.result(60.0).status_code == 201 for answer in fleet)


def test_robots_that_wait_for_their_site_to_learn_hold_up_no_other_robot(
    tmp_path: Path, crowd: ThreadPoolExecutor, learning: threading.Event
) -> None:
    listen = endpoint()
    with serving(tmp_path, zenoh_listen=[listen]) as api, connect(listen) as network:
        fill(api, "other")

        def let_in(name: str, site: str) -> int:
            with Robot(network, name) as robot:
                robot.open(site, particles=50)
                return robot.last().seq

        fleet = [crowd.submit(let_in, f"waits{number}", "yard") for number in range(16)]
        others = [crowd.submit(let_in, f"goes{number}", "other") for number in range(16)]
        assert [robot.result(SOON_S) for robot in others] == [0] * 16
        assert not any(robot.done() for robot in fleet)
        learning.set()
        assert [robot.result(60.0) for robot in fleet] == [0] * 16


def test_not_more_wait_for_a_site_to_learn_than_leave_room_for_others(
    tmp_path: Path, crowd: ThreadPoolExecutor, learning: threading.Event
) -> None:
    with serving(tmp_path, max_pending_requests=8) as api:
        fleet = [crowd.submit(opened, api, seed) for seed in range(4)]
        all_wait(api, crowd, 4)
        refused = crowd.submit(opened, api, 4).result(SOON_S)
        comes_back_later(refused, "expectation_pending")
        everybody_else_is_answered(api, crowd)
        learning.set()
        assert all(answer.result(60.0).status_code == 201 for answer in fleet)


def test_questions_that_take_long_are_answered_one_by_one_and_the_same_one_once(
    tmp_path: Path, crowd: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, curve, begun = threading.Event(), SiteRegistry.range_curve, list[str]()

    def held_back(self: SiteRegistry, site: Any, *scans: Any, **how: Any) -> Any:
        begun.append(site.name)
        assert go_on.wait(30.0)
        return curve(self, site, *scans, **how)

    monkeypatch.setattr(SiteRegistry, "range_curve", held_back)
    with serving(tmp_path) as api:
        path = "/v1/sites/{}/complex?curve=rssi"
        first = crowd.submit(api.get, path.format("yard"))
        until(lambda: begun)
        waiting = [first, crowd.submit(api.get, path.format("other"))]
        while len(waiting) < MOST_WAITING:
            waiting.append(crowd.submit(api.get, path.format("yard")))
        all_wait(api, crowd, MOST_WAITING)
        refused = crowd.submit(api.get, path.format("yard")).result(SOON_S)
        comes_back_later(refused, "overload")
        everybody_else_is_answered(api, crowd)
        assert begun == ["yard"]
        go_on.set()
        assert all(answer.result(SOON_S).status_code == 200 for answer in waiting)
        assert sorted(begun) == ["other", "yard", "yard"]
        api.get(path.format("yard")).raise_for_status()
        assert len(begun) == 4
