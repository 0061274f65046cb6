"""Devices over zenoh: the stream, its numbers, and what is refused; one service in process."""

import asyncio
import json
import math
import runpy
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from fastapi.testclient import TestClient
from homsense_client import InvalidRequestError, NotFoundError, Pose, ResponseError
from homsense_client.streaming import AsyncRobot, Network, Robot, connect
from homsense_service.app import create_app
from homsense_service.bridge.device import Device
from homsense_service.settings import Settings
from support.networks import COUNTING, RING, endpoint, fill, until

EXAMPLE = Path(__file__).parents[2] / "clients" / "examples" / "robot.py"
OPTIONS: dict[str, Any] = {"particles": 300, "seed": 5, "sensor": COUNTING}
STEP = {"forward_m": 1.5, "left_m": 0.1, "turn_rad": 0.2}


class House:
    """A service in this process and a network to it."""

    def __init__(self, api: TestClient, settings: Settings, network: Network) -> None:
        self.api, self.settings, self.network = api, settings, network

    def robot(self, name: str = "r1", **options: Any) -> Robot:
        return Robot(self.network, name, **options)

    def events(self, name: str = "r1") -> list[dict[str, Any]]:
        """Return a list that the events of a device come to."""
        found: list[dict[str, Any]] = []
        self.network.session.declare_subscriber(
            f"homsense/@v1/dev/{name}/event",
            lambda sample: found.append(json.loads(sample.payload.to_bytes())),
        )
        time.sleep(0.05)
        return found

    def metric(self, name: str) -> float:
        lines = self.api.get("/metrics").text.splitlines()
        return sum(float(line.split()[-1]) for line in lines if line.startswith(name))


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", zenoh_listen=[endpoint()], zenoh_silence_s=1.0)


@pytest.fixture
def house(settings: Settings) -> Iterator[House]:
    with (
        TestClient(create_app(settings), base_url="http://test") as api,
        connect(*settings.zenoh_listen) as network,
    ):
        fill(api)
        yield House(api, settings, network)


def ask(house: House, key: str, payload: bytes, attachment: bytes = bytes(16)) -> dict[str, Any]:
    """Send a query as anybody could; return the answer or the problem."""
    (reply,) = house.network.session.get(key, payload=payload, attachment=attachment, timeout=5.0)
    found = reply.ok or reply.err
    assert found is not None
    answer: dict[str, Any] = json.loads(found.payload.to_bytes())
    return answer


def token_of(house: House, name: str) -> bytes:
    """Return the token of a device, by asking again with a nonce of our own."""
    body = {"nonce": f"nonce of {name}", "site": "yard", "options": OPTIONS}
    key = f"homsense/@v1/dev/{name}/rpc/open"
    return bytes.fromhex(ask(house, key, json.dumps(body).encode())["token"])


def test_the_same_inputs_give_the_same_bits_over_rest_and_zenoh(house: House) -> None:
    twin = house.api.post("/v1/sites/yard/sessions", json=OPTIONS).json()["session"]
    with house.robot() as robot:
        robot.open("yard", **OPTIONS)
        for number in range(1, 9):
            robot.move(STEP, dt_s=1.0)
            streamed = robot.scan(RING[number % 4])
            step = {"seq": number, "t": number, "delta": STEP, "landmarks": RING[number % 4]}
            answer = house.api.post(f"/v1/sessions/{twin}/steps", json={"steps": [step]}).json()
            assert streamed.digest == answer["digest"]
        assert streamed.seq == 16
        assert streamed.t == 8.0


def test_one_session_is_open_to_both_sides(house: House) -> None:
    session = house.api.post("/v1/sites/yard/sessions", json=OPTIONS).json()["session"]
    steps = {"steps": [{"seq": 3, "delta": STEP}]}
    house.api.post(f"/v1/sessions/{session}/steps", json=steps).raise_for_status()
    with house.robot() as robot:
        assert robot.attach(session).id == session
        poses: list[Pose] = []
        robot.on_pose(poses.append)
        time.sleep(0.1)
        robot.move(STEP, dt_s=0.1)
        streamed = robot.scan(RING[0])
        assert streamed.seq == 5
        assert house.api.get(f"/v1/sessions/{session}/pose").json()["digest"] == streamed.digest
        steps = {"steps": [{"seq": 9, "delta": STEP}]}
        posted = house.api.post(f"/v1/sessions/{session}/steps", json=steps).json()
        until(lambda: len(poses) == 2)
        assert [pose.digest for pose in poses] == [streamed.digest, posted["digest"]]
        assert robot.steps([{"seq": 10, "delta": STEP}]).seq == 10
        assert robot.last().seq == 10


def test_opening_again_with_the_same_nonce_changes_nothing(house: House) -> None:
    body = json.dumps({"nonce": "12345678", "site": "yard", "options": OPTIONS}).encode()
    first, again = (ask(house, "homsense/@v1/dev/r1/rpc/open", body) for _ in range(2))
    assert first == again
    other = body.replace(b"12345678", b"87654321")
    assert ask(house, "homsense/@v1/dev/r1/rpc/open", other)["session"] != first["session"]


def test_a_scan_that_is_sent_again_gets_the_same_answer(house: House) -> None:
    token = token_of(house, "r1")
    key = "homsense/@v1/dev/r1/rpc/scan"
    body = json.dumps({"landmarks": RING[0], "deltas": [{"forward_m": 1.0, "dt_s": 0.5}]}).encode()
    first = ask(house, key, body, struct.pack("<Q8s", 1, token))
    ask(house, key, b'{"landmarks": ["b"]}', struct.pack("<Q8s", 3, token))
    assert ask(house, key, body, struct.pack("<Q8s", 1, token)) == first
    assert first["seq"] == 2
    other = body.replace(b'"a"', b'"z"')
    assert ask(house, key, other, struct.pack("<Q8s", 1, token))["code"] == "sequence_conflict"
    assert house.metric("homsense_steps_total") == 2


@pytest.mark.parametrize("encoding", ["binary", "json"])
@pytest.mark.parametrize("kind", ["deltas", "imu"])
def test_motion_at_a_hundred_hertz_becomes_a_few_steps(
    house: House, encoding: Any, kind: str
) -> None:
    motion = {"type": "imu"} if kind == "imu" else {"type": "odometry"}
    with house.robot(encoding=encoding) as robot:
        robot.open("yard", pose_hz=20.0, motion=motion, **OPTIONS)
        for _ in range(100):
            if kind == "imu":
                robot.sense(0.01, 0.1, 0.0, 0.3)
            else:
                robot.move({"forward_m": 0.01}, dt_s=0.01)
            time.sleep(0.002)
        pose = robot.scan(RING[0])
        assert pose.seq == 101
        assert pose.t == pytest.approx(1.0)
        assert 2 <= house.metric("homsense_steps_total") <= 11
        assert house.metric("homsense_device_inputs_lost_total") == 0


def test_what_is_lost_is_told(house: House) -> None:
    events = house.events()
    with house.robot(batch=1) as robot:
        robot.open("yard", **OPTIONS)
        robot.move(STEP, dt_s=0.1)
        robot._number += 7
        robot.scan(RING[0])
        told = until(lambda: events)
    assert (told[0]["code"], told[0]["lost"]) == ("gap", 7)
    assert house.metric("homsense_device_inputs_lost_total") == 7


def test_scans_can_be_put_without_waiting(house: House) -> None:
    token = token_of(house, "r1")
    house.network.session.put(
        "homsense/@v1/dev/r1/scan",
        json.dumps({"landmarks": RING[1]}),
        attachment=struct.pack("<Q8s", 1, token),
    )
    until(lambda: house.metric("homsense_steps_total") == 1)


def test_particles_are_sent_only_while_somebody_reads_them(house: House) -> None:
    read: list[Any] = []
    with house.robot() as robot:
        robot.open("yard", **OPTIONS)
        robot.scan(RING[0])
        robot.on_particles(read.append)
        time.sleep(0.3)
        robot.scan(RING[1])
        (particles,) = until(lambda: read)
        assert len(particles) == 500
        assert all(math.isfinite(number) for number in particles[0])


@pytest.mark.parametrize(
    ("what", "payload", "encoding", "code"),
    [
        ("imu", b"\x00" * 31, "application/octet-stream;schema=delta8f4", "decode"),
        ("imu", struct.pack("<8f", 1, math.nan, 0, 0, 0, 0, 0, 0), "", "decode"),
        ("imu", b"{", "application/json", "decode"),
        ("imu", b'{"deltas": [{"forward_m": 1e99}]}', "application/json", "decode"),
        ("imu", b'{"deltas": [{"forward": 1}]}', "application/json", "decode"),
        ("imu", b"\x00" * 300_000, "application/octet-stream;schema=delta8f4", "body_too_large"),
        ("scan", b'{"landmarks": 5}', "application/json", "decode"),
        ("scan", b"\xff\xfe", "application/json", "decode"),
    ],
)
def test_a_malformed_message_is_told_and_harms_nobody(
    house: House, what: str, payload: bytes, encoding: str, code: str
) -> None:
    events, token = house.events(), token_of(house, "r1")
    house.network.session.put(
        f"homsense/@v1/dev/r1/{what}",
        payload,
        encoding=encoding,
        attachment=struct.pack("<Q8s", 1, token),
    )
    assert until(lambda: events)[0]["code"] == code
    body = json.dumps({"landmarks": RING[0]}).encode()
    answer = ask(house, "homsense/@v1/dev/r1/rpc/scan", body, struct.pack("<Q8s", 1, token))
    assert answer["seq"] == 1


@pytest.mark.parametrize(
    ("method", "payload", "code"),
    [
        ("open", b"{", "malformed_json"),
        ("open", b'{"nonce": "short", "site": "yard"}', "invalid_request"),
        ("open", b'{"nonce": "12345678"}', "invalid_request"),
        ("open", b'{"nonce": "12345678", "site": "nowhere"}', "site_not_found"),
        ("open", b'{"nonce": "12345678", "session": "none"}', "session_not_found"),
        ("scan", b'{"landmarks": [""]}', "invalid_request"),
        ("scan", b'{"landmarks": ["a"], "deltas": [{}], "imu": [{}]}', "invalid_request"),
        ("steps", b'{"steps": []}', "invalid_request"),
        ("dance", b"", "no_such_method"),
        ("scan", b" " * 300_000, "body_too_large"),
    ],
)
def test_a_bad_request_is_answered_like_over_rest(
    house: House, method: str, payload: bytes, code: str
) -> None:
    token = token_of(house, "r1")
    key = f"homsense/@v1/dev/r1/rpc/{method}"
    answer = ask(house, key, payload, struct.pack("<Q8s", 1, token))
    assert answer["code"] == code
    if code == "invalid_request":
        assert answer["errors"][0]["field"] != ""


def test_a_failure_of_the_service_is_answered_too(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = token_of(house, "r1")
    monkeypatch.setattr(Device, "check", lambda *_: 1 / 0)
    answer = ask(house, "homsense/@v1/dev/r1/rpc/last", b"{}", struct.pack("<Q8s", 1, token))
    assert answer["code"] == "internal"


def test_only_the_token_opens_the_stream(house: House) -> None:
    events, token = house.events(), token_of(house, "r1")
    wrong = struct.pack("<Q8s", 1, bytes(8))
    beyond = struct.pack("<Q8s", 2**52, token)
    for attachment in (wrong, b"short", beyond, None):
        house.network.session.put(
            "homsense/@v1/dev/r1/imu", b"", encoding="application/json", attachment=attachment
        )
    assert until(lambda: events)[0]["code"] == "bad_token"
    for method in ("scan", "steps", "last", "close"):
        answer = ask(house, f"homsense/@v1/dev/r1/rpc/{method}", b"{}", wrong)
        assert answer["code"] == "bad_token"
    other = token_of(house, "r2")
    spoofed = ask(house, "homsense/@v1/dev/r1/rpc/last", b"{}", struct.pack("<Q8s", 0, other))
    assert spoofed["code"] == "bad_token"
    right = ask(house, "homsense/@v1/dev/r1/rpc/last", b"{}", struct.pack("<Q8s", 0, token))
    assert right["seq"] == 0
    unknown = ask(house, "homsense/@v1/dev/r9/rpc/last", b"{}", struct.pack("<Q8s", 0, token))
    assert unknown["code"] == "no_session"


def test_a_put_to_many_devices_reaches_none(house: House) -> None:
    token = token_of(house, "r1")
    rows = struct.pack("<8f", 0.1, 1, 0, 0, *[math.nan] * 3, 0)
    for key in ("homsense/@v1/dev/*/imu", "homsense/@v1/dev/r*/imu", "homsense/@v1/**"):
        try:
            house.network.session.put(
                key,
                rows,
                encoding="application/octet-stream;schema=delta8f4",
                attachment=struct.pack("<Q8s", 1, token),
            )
        except zenoh.ZError:
            continue
    until(lambda: house.metric("homsense_device_messages_refused_total") >= 2)
    assert house.metric("homsense_steps_total") == 0


def test_keys_decide_who_may_stream_where(house: House) -> None:
    made = [
        house.api.post("/v1/keys", json={"name": name, **more}).json()["key"]
        for name, more in [("boss", {"scopes": ["admin"]})]
    ]
    head = {"Authorization": f"Bearer {made[0]}"}
    for name, more in [
        ("robots", {"scopes": ["localize"], "sites": ["yard"]}),
        ("others", {"scopes": ["localize"], "sites": ["elsewhere"]}),
        ("phones", {"scopes": ["ingest"]}),
    ]:
        answer = house.api.post("/v1/keys", json={"name": name, **more}, headers=head)
        made.append(answer.json()["key"])
    _, robots, others, phones = made
    robot = house.robot()
    for key, code in [
        (None, "unauthorized"),
        ("homsense_wrong", "unauthorized"),
        (others, "site_not_found"),
        (phones, "forbidden"),
    ]:
        with pytest.raises(ResponseError) as refused:
            robot.open("yard", key=key, **OPTIONS)
        assert refused.value.code == code
    session = robot.open("yard", key=robots, **OPTIONS).id
    robot.scan(RING[0])
    with pytest.raises(ResponseError) as taken:
        house.robot().attach(session, key=others)
    assert taken.value.code == "forbidden"
    house.api.delete(f"/v1/sessions/{session}", headers=head).raise_for_status()
    robot.open("yard", key=robots, **OPTIONS)
    house.api.delete("/v1/keys/robots", headers=head)
    with pytest.raises(ResponseError) as stale:
        robot.scan(RING[1])
    assert stale.value.code == "bad_token"
    robot.leave()


def test_a_session_that_was_closed_ends_the_stream(house: House) -> None:
    with house.robot() as robot, house.robot("r2") as second:
        session = robot.open("yard", **OPTIONS).id
        robot.close()
        assert house.api.get(f"/v1/sessions/{session}/pose").status_code == 404
        with pytest.raises(NotFoundError, match="no_session"):
            robot.last()
        other = second.open("yard", **OPTIONS).id
        second.scan(RING[0])
        house.api.delete(f"/v1/sessions/{other}").raise_for_status()
        with pytest.raises(NotFoundError):
            second.scan(RING[1])


def test_a_session_has_one_device_and_a_device_one_session(house: House) -> None:
    with house.robot("r1") as first, house.robot("r2") as second:
        session = first.open("yard", **OPTIONS).id
        second.attach(session)
        second.scan(RING[0])
        with pytest.raises(NotFoundError, match="no_session"):
            first.scan(RING[0])


def test_a_scan_that_was_overtaken_is_sent_again_as_a_later_one(house: House) -> None:
    with house.robot() as robot:
        session = robot.open("yard", **OPTIONS).id
        robot.scan(RING[0])
        steps = {"steps": [{"seq": 50, "delta": STEP}]}
        house.api.post(f"/v1/sessions/{session}/steps", json=steps).raise_for_status()
        assert robot.scan(RING[1]).seq == 51
        assert robot.scan(RING[2]).seq == 52


def test_who_is_there_is_counted_and_told(house: House) -> None:
    events = house.events()
    with house.robot() as robot:
        robot.open("yard", **OPTIONS)
        until(lambda: house.metric('homsense_devices{state="online"}') == 1)
        until(lambda: house.metric('homsense_devices{state="offline"}') == 1)
        robot.scan(RING[0])
        until(lambda: house.metric('homsense_devices{state="online"}') == 1)
        until(lambda: [event["code"] for event in events] == ["offline", "online"])


def test_a_device_goes_on_after_a_restart_of_the_service(settings: Settings) -> None:
    with TestClient(create_app(settings), base_url="http://test") as api:
        fill(api)
        with connect(*settings.zenoh_listen) as network:
            robot = Robot(network, "r1", encoding="json")
            robot.open("yard", **OPTIONS)
            robot.move(STEP, dt_s=1.0)
            before = robot.scan(RING[0])
            twin = api.post("/v1/sites/yard/sessions", json=OPTIONS).json()["session"]
            robot.leave()
    with (
        TestClient(create_app(settings), base_url="http://test") as api,
        connect(*settings.zenoh_listen) as network,
    ):
        back = Robot(network, "r1", encoding="json")
        back._token, back._number = robot._token, robot._number
        assert back.last().digest == before.digest
        back.move(STEP, dt_s=1.0)
        after = back.scan(RING[1])
        back.leave()
        for number in (1, 2):
            step = {"seq": number, "t": number, "delta": STEP, "landmarks": RING[number - 1]}
            answer = api.post(f"/v1/sessions/{twin}/steps", json={"steps": [step]}).json()
        assert answer["digest"] == after.digest


def test_poses_come_to_an_event_loop(house: House) -> None:
    async def drive() -> list[int]:
        async with AsyncRobot(house.robot()) as robot:
            await robot.open("yard", **OPTIONS)
            poses = robot.poses()
            reading = asyncio.ensure_future(anext(poses))
            await asyncio.sleep(0.1)
            robot.move(STEP, dt_s=0.1)
            scanned = await robot.scan(RING[0])
            seen = await asyncio.wait_for(reading, 5.0)
            last = await robot.last()
            await robot.close()
            return [scanned.seq, seen.seq, last.seq]

    assert asyncio.run(drive()) == [2, 2, 2]


def test_poses_can_be_read_one_by_one(house: House) -> None:
    with house.robot() as robot:
        robot.open("yard", **OPTIONS)
        soon = threading.Timer(0.3, lambda: [robot.scan(RING[n]) for n in range(3)])
        soon.start()
        seen = [pose.seq for pose in robot.poses(timeout_s=1.0)]
        soon.join()
    assert seen[-1] == 3


def test_the_example_runs(house: House, capsys: pytest.CaptureFixture[str]) -> None:
    names = {"ENDPOINT": house.settings.zenoh_listen[0], "SITE": "yard", "SCANS": 1}
    runpy.run_path(str(EXAMPLE), names)
    assert len(capsys.readouterr().out.splitlines()) > 5


def test_a_robot_that_finds_nothing_says_so(house: House) -> None:
    with pytest.raises(InvalidRequestError, match="particles"):
        house.robot("r7").open("yard", particles=0)
