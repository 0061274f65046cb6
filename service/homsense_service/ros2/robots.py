"""ROS robots on the network: their topics in, their poses out."""

import hashlib
import json
import math
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import zenoh

from homsense_service.bridge.bridge import Bridge
from homsense_service.bridge.device import Device
from homsense_service.bridge.inputs import Input, Scan
from homsense_service.bridge.opening import OpenIn
from homsense_service.bridge.requests import Expected
from homsense_service.errors import DeviceNotFoundError, SessionNotFoundError
from homsense_service.ros2 import cdr
from homsense_service.ros2.graph import (
    RELIABLE,
    SENSOR,
    Endpoint,
    Graph,
    attachment,
    gid_of,
)
from homsense_service.ros2.mapping import RobotIn
from homsense_service.ros2.reckoning import Reckoning, scan_of_diagnostics, scan_of_json

NODE = "homsense"
_NONCE_BYTES = 16


class Topic:
    """A topic that the service publishes.

    Parameters
    ----------
    session : zenoh.Session
        The network.
    graph : Graph
        How topics are named.
    endpoint : Endpoint
        This one.
    """

    def __init__(self, session: zenoh.Session, graph: Graph, endpoint: Endpoint) -> None:
        token = graph.endpoint_token(str(session.zid()), endpoint)
        self._gid, self._sequence, self._stamps = gid_of(token), 0, graph.dialect == "rmw_zenoh"
        self._publisher = session.declare_publisher(
            graph.key(endpoint.topic, endpoint.type_name),
            congestion_control=zenoh.CongestionControl.DROP,
        )

    @property
    def is_read(self) -> bool:
        """Whether anybody subscribes."""
        status: Any = self._publisher.matching_status
        return bool(status.matching)

    def put(self, payload: bytes) -> None:
        """Publish a message."""
        self._sequence += 1
        stamp = attachment(self._sequence, time.time(), self._gid) if self._stamps else None
        self._publisher.put(payload, attachment=stamp)


def covariance_of(mode: dict[str, Any]) -> cdr.FloatArray:
    """Return the covariance of x, y and yaw of a mode, as it goes over the wire."""
    full = np.zeros((3, 3))
    full[:2, :2] = mode["covariance"]
    resultant = max(float(mode["heading"]["resultant"]), 1e-4)
    full[2, 2] = -2.0 * math.log(min(resultant, 1.0))
    return full


class Robot:
    """One robot of a mapping.

    Parameters
    ----------
    row : RobotIn
        Its topics and its site.
    graph : Graph
        How topics are named.
    network : zenoh.Session
        Where they are.
    bridge : Bridge
        Has its session.
    number : int
        Of its node in the graph.
    """

    def __init__(
        self, row: RobotIn, graph: Graph, network: zenoh.Session, bridge: Bridge, number: int
    ) -> None:
        self._row, self._bridge = row, bridge
        self._reckoning = Reckoning(row.max_speed_mps)
        self._lock = threading.Lock()
        self._is_open, self._number = False, 0
        self._node = f"{NODE}_{row.device}".replace("-", "_").replace(".", "_")
        self._tokens = []
        zid, alive = str(network.zid()), network.liveliness()
        if graph.dialect == "rmw_zenoh":
            self._tokens.append(alive.declare_token(graph.node_token(zid, number, self._node)))
        ends = [
            *(Endpoint("MP", self._node, *named, RELIABLE) for named in row.outputs().items()),
            *(Endpoint("MS", self._node, *named, SENSOR) for named in row.inputs().items()),
        ]
        numbered = [end._replace(ids=(number, number + n)) for n, end in enumerate(ends, start=1)]
        if graph.dialect == "rmw_zenoh":
            tokens = [graph.endpoint_token(zid, end) for end in numbered]
            self._tokens += [alive.declare_token(token) for token in tokens]
        topics = [Topic(network, graph, end) for end in numbered if end.kind == "MP"]
        self._pose, self._particles = topics[0], topics[1] if len(topics) > 1 else None
        takes = {row.odometry: self._on_odometry, row.imu: self._on_imu, row.scans: self._on_scan}
        for topic, kind in row.inputs().items():
            key = graph.any_version(topic, kind)
            network.declare_subscriber(key, partial(self._received, takes[topic]))
        bridge.listen(row.device, self._publish)
        self.open()

    def open(self) -> None:
        """Get the robot its session, again and again until the site is there."""
        row = self._row
        text = row.model_dump_json(include={"site", "session", "pose_hz"})
        asked = OpenIn(
            nonce=hashlib.blake2b(text.encode(), digest_size=_NONCE_BYTES).hexdigest(),
            site=row.site,
            options=row.session,
            pose_hz=row.pose_hz,
        )
        self._bridge.let_in_known(row.device, asked, self._opened)

    def _opened(self, number: int) -> None:
        with self._lock:
            self._is_open, self._number = True, number

    def _publish(self, device: Device, frame: bytes) -> None:
        """Publish the pose after a step, and particles if they are read."""
        t = self._reckoning.t
        if t is None:
            return
        pose = json.loads(frame)
        if pose["pose"] is not None:
            top = pose["modes"][0]
            at = (top["x_m"], top["y_m"], top["heading"]["mean_rad"])
            frame_id = self._row.frame_id
            self._pose.put(cdr.pose_with_covariance(t, frame_id, at, covariance_of(top)))
        if self._particles is not None and self._particles.is_read:
            poses = device.some_particles()
            self._particles.put(cdr.pose_array(t, self._row.frame_id, poses))

    def _received(self, take: Callable[[bytes], list[Input]], sample: zenoh.Sample) -> None:
        """Take a message of the robot's, in order with those of its other topics."""
        if not self._is_open:
            return
        try:
            with self._lock:
                inputs = take(sample.payload.to_bytes())
                if inputs:
                    self._number = inputs[-1].following - 1
                    device = self._bridge.device(self._row.device)
                    device.check_session()
                    device.take(*inputs)
        except (SessionNotFoundError, DeviceNotFoundError):
            self._is_open = False
            self.open()
        except Expected as error:
            self._bridge.tell(self._row.device, "decode", f"{sample.key_expr}: {error}")

    def _on_odometry(self, payload: bytes) -> list[Input]:
        moved = self._reckoning.by_odometry(cdr.odometry(payload), self._number + 1)
        return [] if moved is None else [moved]

    def _on_imu(self, payload: bytes) -> list[Input]:
        now = cdr.imu(payload)
        if self._row.odometry is not None:
            self._reckoning.by_gyroscope(now)
            return []
        moved = self._reckoning.by_imu(now, self._number + 1)
        return [] if moved is None else [moved]

    def _on_scan(self, payload: bytes) -> list[Input]:
        read = scan_of_json if self._row.scan_type == "json" else scan_of_diagnostics
        heard = self._bridge.device(self._row.device).heard(read(payload).landmarks)
        return [Scan(self._number + 1, heard)]
