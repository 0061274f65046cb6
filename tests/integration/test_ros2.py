"""An emulated ROS 2 robot: the defaults of rmw_zenoh, through a router, with no node of ours."""

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from fastapi.testclient import TestClient
from homsense_cli.ros2 import run_check
from homsense_service.app import create_app
from homsense_service.ros2.graph import RELIABLE, Endpoint, Graph, attachment, endpoint_of
from homsense_service.ros2.mapping import read_mapping
from homsense_service.settings import Settings
from pydantic import ValidationError
from rich.console import Console
from rosbags.typesys import Stores, get_typestore
from support.networks import RING, endpoint, fill, router, until
from unit.service.test_ros2 import diagnostics_bytes, imu_bytes, odometry_bytes

STORE = get_typestore(Stores.ROS2_JAZZY)
POSE, ARRAY = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseArray"
MAPPING = """
dialect = "{dialect}"
distro = "{distro}"

[[robots]]
device = "r1"
site = "yard"
{motion}
scans = "/r1/wifi"
pose = "/r1/homsense/pose"
particles = "/r1/homsense/particles"

[robots.session]
particles = 300
seed = 5
sensor = {{ type = "homology" }}
prior = {{ type = "gaussian", x_m = -5.0, y_m = -5.0, std_m = 0.5 }}
{more}
"""
BY_ODOMETRY = 'odometry = "/r1/odom"\nimu = "/r1/imu"'


class Ros:
    """A robot with the topics and tokens of a ROS 2 node, and a service that knows it."""

    def __init__(self, where: str, graph: Graph) -> None:
        config = zenoh.Config()
        for path, value in {
            "mode": '"peer"',
            "listen/endpoints": '["tcp/localhost:0"]',
            "connect/endpoints": f'["{where}"]',
            "scouting/multicast/enabled": "false",
        }.items():
            config.insert_json5(path, value)
        self.session, self.graph = zenoh.open(config), graph
        self.sequence = 0
        self.received: dict[str, list[zenoh.Sample]] = {POSE: [], ARRAY: []}
        for topic, kind in (("/r1/homsense/pose", POSE), ("/r1/homsense/particles", ARRAY)):
            self.session.declare_subscriber(graph.key(topic, kind), self.received[kind].append)
        self.tokens = [
            self.session.liveliness().declare_token(
                graph.endpoint_token(
                    str(self.session.zid()), Endpoint("MP", "base", topic, kind, RELIABLE)
                )
            )
            for topic, kind in (
                ("/r1/odom", "nav_msgs/msg/Odometry"),
                ("/r1/imu", "sensor_msgs/msg/Imu"),
                ("/r1/wifi", "diagnostic_msgs/msg/DiagnosticArray"),
            )
        ]

    def put(self, topic: str, kind: str, payload: bytes) -> None:
        self.sequence += 1
        stamp = None
        if self.graph.dialect == "rmw_zenoh":
            stamp = attachment(self.sequence, time.time(), bytes(16))
        self.session.put(self.graph.key(topic, kind), payload, attachment=stamp)

    def drive(self, steps: int) -> None:
        """Drive round a block, seen by odometry and IMU, with a scan each second."""
        for step in range(steps):
            t = 100.0 + 0.1 * step
            angle = 0.05 * step
            x, y = 10 * math.sin(angle), 10 - 10 * math.cos(angle)
            self.put("/r1/imu", "sensor_msgs/msg/Imu", imu_bytes(t, "imu", 0.0, 0.5))
            self.put("/r1/odom", "nav_msgs/msg/Odometry", odometry_bytes(t, x, y, angle))
            if step % 10 == 9:
                heard = dict.fromkeys(RING[step // 10 % 4], "-60")
                kind = "diagnostic_msgs/msg/DiagnosticArray"
                self.put("/r1/wifi", kind, diagnostics_bytes(heard))
            time.sleep(0.01)


def write_mapping(
    directory: Path,
    *,
    dialect: str = "rmw_zenoh",
    distro: str = "jazzy",
    motion: str = BY_ODOMETRY,
    more: str = "",
) -> Path:
    path = directory / "robots.toml"
    path.write_text(MAPPING.format(dialect=dialect, distro=distro, motion=motion, more=more))
    return path


@pytest.fixture
def where() -> Iterator[str]:
    found = endpoint()
    with router(found):
        yield found


def served(tmp_path: Path, where: str, mapping: Path) -> TestClient:
    with pytest.raises(ValidationError, match=r"ros2_mapping\n.*needs zenoh_listen"):
        Settings(data=tmp_path / "data", ros2_mapping=mapping)
    settings = Settings(data=tmp_path / "data", zenoh_connect=[where], ros2_mapping=mapping)
    return TestClient(create_app(settings), base_url="http://test")


@pytest.mark.parametrize(
    ("dialect", "distro"), [("rmw_zenoh", "jazzy"), ("rmw_zenoh", "humble"), ("ros2dds", "jazzy")]
)
def test_odometry_and_scans_go_in_and_poses_come_out(
    tmp_path: Path, where: str, dialect: Any, distro: str
) -> None:
    mapping = write_mapping(tmp_path, dialect=dialect, distro=distro)
    with served(tmp_path, where, mapping) as api:
        fill(api)
        robot = Ros(where, Graph(dialect, 0, is_humble=distro == "humble"))
        try:
            sessions = until(lambda: api.get("/v1/sites/yard/sessions").json()["sessions"], 15)
            time.sleep(0.5)
            robot.drive(60)
            until(lambda: robot.received[ARRAY])
            path = f"/v1/sessions/{sessions[0]}/pose"
            pose = until(lambda: (found := api.get(path).json())["seq"] >= 65 and found)
            time.sleep(0.5)
            samples = until(lambda: len(robot.received[POSE]) >= 3 and robot.received[POSE])
        finally:
            robot.session.close()  # type: ignore[no-untyped-call]
        measured = 'homsense_stage_seconds_count{stage="measure"} 6.0'
        assert measured in api.get("/metrics").text
    last: Any = STORE.deserialize_cdr(samples[-1].payload.to_bytes(), POSE)
    assert last.header.frame_id == "map"
    top = pose["modes"][0]
    assert last.pose.pose.position.x == pytest.approx(top["x_m"], abs=20.0)
    assert last.pose.covariance[0] > 0.0
    if dialect == "rmw_zenoh":
        stamps = [sample.attachment.to_bytes() for sample in samples]
        numbers = [int.from_bytes(stamp[:8], "little") for stamp in stamps]
        assert numbers == list(range(1, len(numbers) + 1))
        assert all(len(stamp) == 33 for stamp in stamps)
    cloud: Any = STORE.deserialize_cdr(robot.received[ARRAY][-1].payload.to_bytes(), ARRAY)
    assert len(cloud.poses) == 500


def test_an_imu_alone_is_enough(tmp_path: Path, where: str) -> None:
    more = 'motion = { type = "imu" }'
    mapping = write_mapping(tmp_path, motion='imu = "/r1/imu"', more=more)
    with served(tmp_path, where, mapping) as api:
        fill(api)
        robot = Ros(where, Graph())
        try:
            until(lambda: api.get("/v1/sites/yard/sessions").json()["sessions"], 15)
            time.sleep(0.5)
            robot.drive(40)
            until(lambda: robot.received[POSE])
        finally:
            robot.session.close()  # type: ignore[no-untyped-call]


def test_the_service_is_a_node_in_the_graph_of_the_robot(tmp_path: Path, where: str) -> None:
    with served(tmp_path, where, write_mapping(tmp_path)) as api:
        fill(api)
        robot = Ros(where, Graph())

        def seen() -> list[Endpoint]:
            replies = robot.session.liveliness().get("@ros2_lv/0/**", timeout=2.0)
            tokens = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
            found = [endpoint_of(token) for token in tokens]
            return [e for e in found if e is not None and e.node == "homsense_r1"]

        try:
            found = until(lambda: len(seen()) == 5 and seen())
        finally:
            robot.session.close()  # type: ignore[no-untyped-call]
    assert {(e.kind, e.topic) for e in found} == {
        ("MP", "/r1/homsense/pose"),
        ("MP", "/r1/homsense/particles"),
        ("MS", "/r1/odom"),
        ("MS", "/r1/imu"),
        ("MS", "/r1/wifi"),
    }


def test_the_check_explains_what_it_sees(tmp_path: Path, where: str) -> None:
    mapping = write_mapping(tmp_path, motion='odometry = "/r1/odometry"')
    console = Console(record=True, width=200)
    robot = Ros(where, Graph())
    try:
        assert not run_check(mapping, [where], 0.5, console)
        text = console.export_text()
        assert "/r1/odometry (nav_msgs/msg/Odometry): nobody publishes it" in text
        assert "is published on /r1/odom" in text
        assert "/r1/wifi (diagnostic_msgs/msg/DiagnosticArray): there is a publisher, but" in text
    finally:
        robot.session.close()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("robots = []", "robots"),
        ("[[robots]]\ndevice = 'r1'", "robots.0.site"),
        ("[[robots]]\ndevice='r1'\nsite='a'\npose='/p'", "one of odometry and imu"),
        ("[[robots]]\ndevice='r1'\nsite='a'\npose='p'\nodometry='/o'", "robots.0.pose"),
        ("[[robots]]\ndevice='r1'\nsite='a'\npose='/p'\nimu='/i'", "motion.type"),
        (2 * "[[robots]]\ndevice='r1'\nsite='a'\npose='/p'\nodometry='/o'\n", "two with"),
        ("not toml", "robots.toml"),
    ],
)
def test_a_mapping_that_is_wrong_is_told_by_its_member(
    tmp_path: Path, text: str, named: str
) -> None:
    path = tmp_path / "robots.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match="toml") as refused:
        read_mapping(path)
    assert named in str(refused.value)
