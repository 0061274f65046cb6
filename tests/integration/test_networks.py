"""Services, routers and robots that die, freeze, come late, or are not who they say."""

import json
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import trustme
import zenoh
from fastapi.testclient import TestClient
from homsense_client import ConnectError, Retry
from homsense_client.streaming import Robot, connect
from homsense_service.app import create_app
from homsense_service.bridge.access_control import IDENTITIES, access_control
from homsense_service.settings import Settings
from support.networks import COUNTING, RING, endpoint, fill, router, until
from support.running import Router, Script, Service

FROZEN = Path(__file__).parents[2] / "benchmarks" / "frozen_robot.py"
OPTIONS: dict[str, Any] = {"particles": 200, "seed": 5, "sensor": COUNTING}

WALKER = """
import sys, time
from homsense_client.streaming import Robot, connect
with connect(sys.argv[1]) as network, Robot(network, "walker") as robot:
    robot.open("yard", particles=200)
    print("open", flush=True)
    while True:
        robot.move({"forward_m": 0.01}, dt_s=0.01)
        time.sleep(0.01)
"""


def walk(robot: Robot, scans: int, seen: list[int] | None = None) -> list[float]:
    """Move and scan; return how long each scan took, seconds."""
    took_s = []
    for number in range(scans):
        robot.move({"forward_m": 0.2, "turn_rad": 0.1}, dt_s=0.1)
        started_s = time.perf_counter()
        pose = robot.scan(RING[number % 4])
        took_s.append(time.perf_counter() - started_s)
        if seen is not None:
            seen.append(pose.seq)
    return took_s


def test_a_robot_that_is_killed_is_offline_at_once(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_listen=[where]) as service, Script(WALKER, where) as walker:
        walker.await_line("open")
        until(lambda: service.metric('homsense_devices{state="online"}') == 1)
        walker.end(signal.SIGKILL)
        until(lambda: service.metric('homsense_devices{state="offline"}') == 1, 3.0)
        assert service.end() < 5.0


def test_a_robot_that_freezes_is_offline_and_comes_back(tmp_path: Path) -> None:
    where = endpoint()
    with (
        Service(tmp_path, zenoh_listen=[where], zenoh_silence_s=1.0) as service,
        Script(WALKER, where) as walker,
    ):
        walker.await_line("open")
        until(lambda: service.metric('homsense_devices{state="online"}') == 1)
        walker.tell(signal.SIGSTOP)
        until(lambda: service.metric('homsense_devices{state="offline"}') == 1, 5.0)
        steps = service.metric("homsense_steps_total")
        walker.tell(signal.SIGCONT)
        until(lambda: service.metric('homsense_devices{state="online"}') == 1, 5.0)
        until(lambda: service.metric("homsense_steps_total") > steps + 3)


def test_a_frozen_robot_with_questions_does_not_delay_a_healthy_one(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_listen=[where]) as service, connect(where) as network:
        with (
            Robot(network, "healthy") as robot,
            Script(FROZEN.read_text(), where, "yard") as frozen,
        ):
            robot.open("yard", **OPTIONS)
            walk(robot, 5)
            frozen.await_line("frozen", 60.0)
            took_s = walk(robot, 60)
        assert max(took_s) < 1.0
        assert sorted(took_s)[-4] < 0.15
        assert service.end() < 5.0


def test_a_service_that_freezes_is_asked_again(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_listen=[where]) as service, connect(where) as network:
        with Robot(network, "r1", timeout_s=0.5) as robot:
            robot.open("yard", **OPTIONS)
            walk(robot, 2)
            service.tell(signal.SIGSTOP)
            threading.Timer(1.5, service.tell, [signal.SIGCONT]).start()
            seen: list[int] = []
            (took_s,) = walk(robot, 1, seen)
            assert took_s > 1.0
            assert seen == [6]
            walk(robot, 1, seen)
            assert seen == [6, 8]


def test_what_was_acknowledged_survives_a_kill_and_nothing_counts_twice(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_listen=[where]) as service, connect(where) as network:
        with Robot(network, "r1", timeout_s=0.5) as robot:
            events: list[dict[str, Any]] = []
            robot.on_event(events.append)
            session = robot.open("yard", **OPTIONS).id
            acknowledged: list[int] = []
            walk(robot, 5, acknowledged)
            service.end(signal.SIGKILL)
            for _ in range(30):
                robot.move({"forward_m": 0.01}, dt_s=0.01)
            service.start()
            service.await_health()
            walk(robot, 5, acknowledged)
            assert acknowledged == [2, 4, 6, 8, 10, *range(42, 52, 2)]
            until(lambda: [event for event in events if event["code"] == "gap"])
            assert 20 <= service.metric("homsense_device_inputs_lost_total") <= 30
        pose = httpx.get(f"{service.url}/v1/sessions/{session}/pose").json()
        assert pose["seq"] == 50
        assert service.end() < 5.0
    log = "".join(service.log)
    assert "does not replay" not in log


def test_all_goes_over_a_router_that_comes_late(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_connect=[where]) as service:
        with pytest.raises(ConnectError, match="no zenoh at"):
            connect(where, timeout_s=0.2)
        assert httpx.get(f"{service.url}/readyz").json()["network"] == "waiting"
        with Router(where) as between, connect(where, timeout_s=10.0) as network:
            with Robot(network, "r1") as robot:
                robot.open("yard", **OPTIONS)
                walk(robot, 3)
                between.end(signal.SIGKILL)
                between.start()
                seen: list[int] = []
                walk(robot, 3, seen)
                assert seen == [8, 10, 12]
                between.tell(signal.SIGSTOP)
                threading.Timer(1.0, between.tell, [signal.SIGCONT]).start()
                walk(robot, 1, seen)
                assert seen[-1] == 14
                assert httpx.get(f"{service.url}/readyz").json()["network"] == "joined"
        assert service.end() < 6.0


def test_of_two_routers_one_may_die(tmp_path: Path) -> None:
    first, second = endpoint(), endpoint()
    with Router(first) as one, Router(second, connect=(first,)):
        with Service(tmp_path, zenoh_connect=[first, second]) as service:
            with connect(first, second) as network, Robot(network, "r1") as robot:
                robot.open("yard", **OPTIONS)
                walk(robot, 3)
                one.end(signal.SIGKILL)
                seen: list[int] = []
                walk(robot, 5, seen)
                assert seen == [8, 10, 12, 14, 16]
            assert service.end() < 6.0


def test_a_robot_that_comes_before_its_service_waits(tmp_path: Path) -> None:
    where = endpoint()
    with Service(tmp_path, zenoh_connect=[where]) as service:
        service.end()
        with router(where), connect(where) as network, Robot(network, "r1") as robot:
            opened: list[str] = []
            waiting = threading.Thread(
                target=lambda: opened.append(robot.open("yard", **OPTIONS).id)
            )
            waiting.start()
            service.start()
            waiting.join(60)
            assert opened
            walk(robot, 1)


class Certificates:
    """A certificate authority and what it has signed, as files."""

    def __init__(self, directory: Path) -> None:
        self._directory, self._ca = directory, trustme.CA()
        self._ca.cert_pem.write_to_path(str(directory / "ca.pem"))

    def config(self, name: str, *, listens: bool = False) -> dict[str, Any]:
        """Return the TLS configuration of somebody."""
        signed = self._ca.issue_cert("localhost", common_name=name)
        key, chain = self._directory / f"{name}.key", self._directory / f"{name}.pem"
        signed.private_key_pem.write_to_path(str(key))
        chain.write_bytes(b"".join(part.bytes() for part in signed.cert_chain_pems))
        role = ["connect", "listen"] if listens else ["connect"]
        return {
            "root_ca_certificate": str(self._directory / "ca.pem"),
            "enable_mtls": True,
            **{f"{part}_private_key": str(key) for part in role},
            **{f"{part}_certificate": str(chain) for part in role},
        }


def as_config(**paths: Any) -> zenoh.Config:
    config = zenoh.Config()
    for path, value in paths.items():
        config.insert_json5(path.replace("__", "/"), json.dumps(value))
    return config


@contextmanager
def served(tmp_path: Path, where: str, config: dict[str, Any]) -> Iterator[TestClient]:
    path = tmp_path / "zenoh.json5"
    path.write_text(json.dumps(config))
    settings = Settings(data=tmp_path / "data", zenoh_listen=[where], zenoh_config=path)
    with TestClient(create_app(settings), base_url="http://test") as api:
        fill(api)
        yield api


def test_a_certificate_binds_a_robot_to_its_own_keys(tmp_path: Path) -> None:
    where = endpoint().replace("tcp/127.0.0.1", "tls/localhost")
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    ours.mkdir()
    theirs.mkdir()
    known, strangers = Certificates(ours), Certificates(theirs)
    by = IDENTITIES["certificate"]
    allowed = access_control(["r1", "r2"], "homsense", by, names_service=False)
    tls = known.config("server", listens=True)
    config = {"transport": {"link": {"tls": tls}}, "access_control": allowed}
    with served(tmp_path, where, config):
        for stranger in (strangers.config("r1"), {"root_ca_certificate": str(ours / "ca.pem")}):
            with pytest.raises(ConnectError):
                connect(where, timeout_s=1.0, config=as_config(transport__link__tls=stranger))
        as_r1 = as_config(transport__link__tls=known.config("r1"))
        with connect(where, config=as_r1) as network:
            with Robot(network, "r1") as robot:
                poses: list[Any] = []
                robot.on_pose(poses.append)
                robot.open("yard", **OPTIONS)
                walk(robot, 2)
                until(lambda: poses)
            with Robot(network, "r2", timeout_s=0.3, retry=Retry(attempts=2)) as spoofed:
                with pytest.raises(ConnectError, match="nobody answers"):
                    spoofed.open("yard", **OPTIONS)


def test_a_password_is_asked_for(tmp_path: Path) -> None:
    where = endpoint()
    users = tmp_path / "users.txt"
    users.write_text("r1:secret\n")
    with served(
        tmp_path, where, {"transport": {"auth": {"usrpwd": {"dictionary_file": str(users)}}}}
    ):
        for wrong in ({"user": "r1", "password": "guess"}, None):
            paths = {} if wrong is None else {"transport__auth__usrpwd": wrong}
            with pytest.raises(ConnectError):
                connect(where, timeout_s=1.0, config=as_config(**paths))
        right = as_config(transport__auth__usrpwd={"user": "r1", "password": "secret"})
        with connect(where, config=right) as network, Robot(network, "r1") as robot:
            robot.open("yard", **OPTIONS)
            walk(robot, 1)
