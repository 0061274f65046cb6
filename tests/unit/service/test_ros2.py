"""ROS 2 on the wire: our bytes, keys and tokens beside those of independent implementations."""

import math
import struct
from typing import Any

import numpy as np
import pytest
import zenoh
from homsense_service.ros2 import cdr
from homsense_service.ros2.graph import (
    HASHES,
    RELIABLE,
    SENSOR,
    Endpoint,
    Graph,
    attachment,
    dds_type,
    endpoint_of,
)
from homsense_service.ros2.reckoning import Reckoning, scan_of_diagnostics, scan_of_json
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.entity import EndpointEntity, EntityKind, NodeEntity
from zenoh_ros2_sdk.keyexpr import (
    endpoint_liveliness_keyexpr,
    node_liveliness_keyexpr,
    topic_keyexpr,
)
from zenoh_ros2_sdk.qos import QosProfile, QosReliability
from zenoh_ros2_sdk.utils import ros2_to_dds_type

from homsense import Delta

STORE = get_typestore(Stores.ROS2_JAZZY)
NAMES = STORE.types
FINITE = st.floats(-1e6, 1e6)
TIMES = st.floats(0, 2e9).map(lambda t: round(t, 3))
FRAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)


def written(kind: str, message: Any) -> bytes:
    return bytes(STORE.serialize_cdr(message, kind))


def header(t: float, frame: str) -> Any:
    stamp = NAMES["builtin_interfaces/msg/Time"](
        sec=math.floor(t), nanosec=min(round((t - math.floor(t)) * 1e9), 999_999_999)
    )
    return NAMES["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def vector(x: float, y: float, z: float) -> Any:
    return NAMES["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)


def turned(yaw: float) -> Any:
    return NAMES["geometry_msgs/msg/Quaternion"](
        x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
    )


def placed(x: float, y: float, yaw: float) -> Any:
    point = NAMES["geometry_msgs/msg/Point"](x=x, y=y, z=0.0)
    return NAMES["geometry_msgs/msg/Pose"](position=point, orientation=turned(yaw))


def imu_bytes(t: float, frame: str, push: float, rate: float) -> bytes:
    none = np.zeros(9)
    message = NAMES["sensor_msgs/msg/Imu"](
        header=header(t, frame),
        orientation=turned(0.0),
        orientation_covariance=none,
        angular_velocity=vector(0.1, 0.2, rate),
        angular_velocity_covariance=none,
        linear_acceleration=vector(push, 0.5, 9.81),
        linear_acceleration_covariance=none,
    )
    return written("sensor_msgs/msg/Imu", message)


def odometry_bytes(
    t: float, x: float, y: float, yaw: float, *, frame: str = "odom", variance: float = 0.0
) -> bytes:
    stated = np.zeros(36)
    stated[[0, 7, 35]] = variance
    still = NAMES["geometry_msgs/msg/Twist"](linear=vector(1, 0, 0), angular=vector(0, 0, 0))
    message = NAMES["nav_msgs/msg/Odometry"](
        header=header(t, frame),
        child_frame_id="base_link",
        pose=NAMES["geometry_msgs/msg/PoseWithCovariance"](
            pose=placed(x, y, yaw), covariance=np.zeros(36)
        ),
        twist=NAMES["geometry_msgs/msg/TwistWithCovariance"](
            twist=still,
            covariance=stated,
        ),
    )
    return written("nav_msgs/msg/Odometry", message)


def diagnostics_bytes(pairs: dict[str, str]) -> bytes:
    values = [NAMES["diagnostic_msgs/msg/KeyValue"](key=k, value=v) for k, v in pairs.items()]
    status = NAMES["diagnostic_msgs/msg/DiagnosticStatus"](
        level=0, name="wifi", message="", hardware_id="wlan0", values=values
    )
    message = NAMES["diagnostic_msgs/msg/DiagnosticArray"](header=header(3.5, ""), status=[status])
    return written("diagnostic_msgs/msg/DiagnosticArray", message)


@given(TIMES, FRAMES, FINITE, FINITE)
def test_an_imu_is_read_as_others_write_it(t: float, frame: str, push: float, rate: float) -> None:
    found = cdr.imu(imu_bytes(t, frame, push, rate))
    assert found.t == pytest.approx(t, abs=1e-6)
    assert found[1:] == (frame, (push, 0.5, 9.81), (0.1, 0.2, rate))


@given(TIMES, FINITE, FINITE, st.floats(-3.1, 3.1))
def test_odometry_is_read_as_others_write_it(t: float, x: float, y: float, yaw: float) -> None:
    found = cdr.odometry(odometry_bytes(t, x, y, yaw, variance=0.25))
    assert (found.frame, found.x_m, found.y_m) == ("odom", x, y)
    assert found.yaw_rad == pytest.approx(yaw, abs=1e-9)
    assert found.twist_variances == (0.25, 0.25, 0.25)


@given(TIMES, FRAMES, FINITE, FINITE, st.floats(-3.1, 3.1))
def test_a_pose_has_the_bytes_that_others_write(
    t: float, frame: str, x: float, y: float, yaw: float
) -> None:
    covariance = np.array([[4.0, 1.0, 0.1], [1.0, 3.0, 0.2], [0.1, 0.2, 0.5]])
    full = np.zeros((6, 6))
    for i, row in zip((0, 1, 5), covariance, strict=True):
        full[i, [0, 1, 5]] = row
    message = NAMES["geometry_msgs/msg/PoseWithCovarianceStamped"](
        header=header(t, frame),
        pose=NAMES["geometry_msgs/msg/PoseWithCovariance"](
            pose=placed(x, y, yaw), covariance=full.ravel()
        ),
    )
    ours = cdr.pose_with_covariance(t, frame, (x, y, yaw), covariance)
    assert ours == written("geometry_msgs/msg/PoseWithCovarianceStamped", message)


@given(FRAMES, st.lists(st.tuples(FINITE, FINITE, st.floats(-3.1, 3.1)), max_size=5))
def test_an_array_of_poses_has_the_bytes_that_others_write(
    frame: str, poses: list[tuple[float, float, float]]
) -> None:
    message = NAMES["geometry_msgs/msg/PoseArray"](
        header=header(12.25, frame), poses=[placed(*pose) for pose in poses]
    )
    ours = cdr.pose_array(12.25, frame, np.array(poses).reshape(-1, 3))
    assert ours == written("geometry_msgs/msg/PoseArray", message)


def test_scans_come_as_diagnostics_or_json() -> None:
    pairs = {"aa:bb": "-61", "cc:dd": "-70.5", "channel": "six", "frequency": "2412"}
    read = scan_of_diagnostics(diagnostics_bytes(pairs))
    assert [(r.id, r.rssi) for r in read.landmarks if not isinstance(r, str)] == [
        ("aa:bb", -61.0),
        ("cc:dd", -70.5),
    ]
    for text in ('["a", {"id": "b", "rssi": -50}]', '{"landmarks": ["a", "b"]}'):
        message = NAMES["std_msgs/msg/String"](data=text)
        assert len(scan_of_json(written("std_msgs/msg/String", message)).landmarks) == 2


@given(st.binary(max_size=80))
def test_other_bytes_are_refused_by_a_value_error(payload: bytes) -> None:
    for read in (cdr.imu, cdr.odometry, cdr.diagnostics, cdr.text):
        with pytest.raises(ValueError, match="plain CDR"):
            read(b"\x07" + payload)
        for begin in (b"\0\1\0\0", b"\0\0\0\0"):
            try:
                read(begin + payload)
            except ValueError:
                continue


@pytest.mark.parametrize("kind", HASHES)
def test_types_have_the_hashes_of_jazzy(kind: str) -> None:
    assert STORE.hash_rihs01(kind) == f"RIHS01_{HASHES[kind]}"
    assert dds_type(kind) == ros2_to_dds_type(kind)


def test_keys_and_tokens_are_those_of_another_implementation() -> None:
    graph, kind = Graph("rmw_zenoh", 5, is_humble=False), "sensor_msgs/msg/Imu"
    hashed = f"RIHS01_{HASHES[kind]}"
    assert graph.key("/r1/imu", kind) == topic_keyexpr(5, "/r1/imu", dds_type(kind), hashed)
    node = NodeEntity(5, "abc", 7, "homsense")
    assert graph.node_token("abc", 7, "homsense") == node_liveliness_keyexpr(node)
    sensor = QosProfile(QosReliability.BEST_EFFORT, history_depth=5)
    ours = Endpoint("MS", "homsense", "/r1/imu", kind, SENSOR, ids=(7, 9))
    theirs = EndpointEntity(
        node, 9, EntityKind.SUBSCRIPTION, "/r1/imu", dds_type(kind), hashed, ours.qos
    )
    token = graph.endpoint_token("abc", ours)
    assert token == endpoint_liveliness_keyexpr(theirs)
    found = endpoint_of(token)
    assert found is not None
    assert found == ours._replace(ids=(0, 0), hashed=hashed)
    read = QosProfile.decode(SENSOR)
    assert (read.reliability, read.history_depth) == (sensor.reliability, sensor.history_depth)
    assert QosProfile.decode(RELIABLE) == QosProfile(history_depth=10)


def test_keys_of_the_design_documents() -> None:
    kind = "std_msgs/msg/String"
    hashed = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    jazzy, humble = (Graph("rmw_zenoh", 0, is_humble=is_humble) for is_humble in (False, True))
    assert jazzy.key("/chatter", kind) == f"0/chatter/std_msgs::msg::dds_::String_/{hashed}"
    assert humble.key("/chatter", kind).endswith("String_/TypeHashNotSupported")
    assert Graph("ros2dds").key("/r1/odom", "nav_msgs/msg/Odometry") == "r1/odom"
    longer = jazzy.endpoint_token("z", Endpoint("MP", "n", "/t", kind, RELIABLE)) + "/more/chunks"
    assert endpoint_of(longer) is not None
    assert endpoint_of("@ros2_lv/0/z/0/0/NN/%/%/n") is None


def test_attachments_are_those_of_two_other_implementations() -> None:
    gid = bytes(range(16))
    ours = attachment(3, 1.5, gid)
    assert ours == Attachment(3, 1_500_000_000, gid).to_bytes()
    numbers = (zenoh.ext.Int64(3), zenoh.ext.Int64(1_500_000_000), gid)
    assert ours == zenoh.ext.z_serialize(numbers).to_bytes()
    assert len(ours) == 33


def test_motion_is_what_odometry_has_changed() -> None:
    reckoning = Reckoning(max_speed_mps=20.0)
    assert reckoning.by_odometry(cdr.odometry(odometry_bytes(1.0, 2.0, 3.0, 1.0)), 1) is None
    ahead = (2.0 + math.cos(1.0), 3.0 + math.sin(1.0), 1.5)
    moved = reckoning.by_odometry(cdr.odometry(odometry_bytes(1.5, *ahead, variance=0.04)), 1)
    assert moved is not None
    delta = moved.motion()
    assert isinstance(delta, Delta)
    assert delta[:4] == pytest.approx((1.0, 0.0, 0.5, 0.5), abs=1e-6)
    assert delta.covariance == pytest.approx((0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01))
    leap = cdr.odometry(odometry_bytes(1.6, 500.0, 3.0, 1.0))
    assert reckoning.by_odometry(leap, 2) is None
    other_frame = cdr.odometry(odometry_bytes(1.7, 500.0, 3.0, 1.0, frame="elsewhere"))
    assert reckoning.by_odometry(other_frame, 2) is None
    earlier = cdr.odometry(odometry_bytes(1.65, 500.0, 3.0, 1.0, frame="elsewhere"))
    assert reckoning.by_odometry(earlier, 2) is None


def test_the_gyroscope_gives_the_turn_when_there_is_one() -> None:
    reckoning = Reckoning(max_speed_mps=20.0)
    reckoning.by_odometry(cdr.odometry(odometry_bytes(1.0, 0.0, 0.0, 0.0)), 1)
    for t in np.arange(0.99, 1.5, 0.01):
        reckoning.by_gyroscope(cdr.imu(imu_bytes(float(t), "imu", 0.0, 0.4)))
    moved = reckoning.by_odometry(cdr.odometry(odometry_bytes(1.5, 0.5, 0.0, 0.0)), 1)
    assert moved is not None
    assert moved.motions[0, 2] == pytest.approx(0.2, abs=0.01)


def test_an_imu_alone_gives_readings_but_for_pauses() -> None:
    reckoning = Reckoning(max_speed_mps=20.0)
    found = [
        reckoning.by_imu(cdr.imu(imu_bytes(t, "imu", 1.0, 0.3)), 1) for t in (1.0, 1.01, 9.0, 9.02)
    ]
    assert [None if r is None else round(r.samples[0].dt_s, 6) for r in found] == [
        None,
        0.01,
        None,
        0.02,
    ]


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_message_without_finite_numbers_is_told(number: float) -> None:
    with pytest.raises(cdr.CdrError, match="finite"):
        cdr.odometry(odometry_bytes(1.0, number, 3.0, 1.0))
    with pytest.raises(cdr.CdrError, match="finite"):
        cdr.imu(imu_bytes(1.0, "imu", number, 0.0))


def test_a_message_that_ends_early_is_told() -> None:
    whole = odometry_bytes(1.0, 2.0, 3.0, 1.0)
    with pytest.raises(cdr.CdrError, match="ends"):
        cdr.odometry(whole[:-100])
    with pytest.raises(cdr.CdrError, match="sequence"):
        cdr.text(b"\0\1\0\0" + struct.pack("<I", 2**31))
