"""How topics of ROS 2 look on zenoh: keys, attachments and the tokens of the graph.

Two dialects: `rmw_zenoh`, the middleware itself, and `ros2dds`, the bridge to robots on DDS.
"""

import hashlib
import struct
from typing import Literal, NamedTuple

Dialect = Literal["rmw_zenoh", "ros2dds"]

HASHES = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e"
    ),
    "geometry_msgs/msg/PoseArray": (
        "af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0"
    ),
    "diagnostic_msgs/msg/DiagnosticArray": (
        "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
    ),
}
NO_HASH = "TypeHashNotSupported"
TOKENS = "@ros2_lv"
RELIABLE, SENSOR = "::,10:,:,:,,", "2::,5:,:,:,,"
_ATTACHMENT = struct.Struct("<qqB16s")
_GID_BYTES = 16
_FIELDS = 13


class Graph(NamedTuple):
    """The naming of one ROS domain.

    Parameters
    ----------
    dialect : str
        `rmw_zenoh` or `ros2dds`.
    domain : int
        Of ROS.
    is_humble : bool
        Humble knows no type hashes.

    Examples
    --------
    >>> Graph("rmw_zenoh", 0, False).key("/r1/imu", "sensor_msgs/msg/Imu")[:44]
    '0/r1/imu/sensor_msgs::msg::dds_::Imu_/RIHS01'
    >>> Graph("ros2dds", 0, False).key("/r1/imu", "sensor_msgs/msg/Imu")
    'r1/imu'
    """

    dialect: Dialect = "rmw_zenoh"
    domain: int = 0
    is_humble: bool = False

    def key(self, topic: str, kind: str) -> str:
        """Return the key that a topic is published on."""
        name = topic.removeprefix("/")
        if self.dialect == "ros2dds":
            return name
        return f"{self.domain}/{name}/{dds_type(kind)}/{self._hash(kind)}"

    def any_version(self, topic: str, kind: str) -> str:
        """Return the key to subscribe to, whatever the publisher's hash is."""
        name = topic.removeprefix("/")
        if self.dialect == "ros2dds":
            return name
        return f"{self.domain}/{name}/{dds_type(kind)}/*"

    def node_token(self, zid: str, number: int, node: str) -> str:
        """Return the liveliness token of a node."""
        return f"{TOKENS}/{self.domain}/{zid}/{number}/{number}/NN/%/%/{node}"

    def endpoint_token(self, zid: str, endpoint: "Endpoint") -> str:
        """Return the liveliness token of a publisher or subscription of a node."""
        kind, (node, number) = endpoint.type_name, endpoint.ids
        topic = endpoint.topic.replace("/", "%")
        return (
            f"{TOKENS}/{self.domain}/{zid}/{node}/{number}/{endpoint.kind}/%/%/"
            f"{endpoint.node}/{topic}/{dds_type(kind)}/{self._hash(kind)}/{endpoint.qos}"
        )

    def _hash(self, kind: str) -> str:
        return NO_HASH if self.is_humble else f"RIHS01_{HASHES[kind]}"


class Endpoint(NamedTuple):
    """A publisher (MP) or subscription (MS) in the graph.

    Parameters
    ----------
    kind : str
        `MP` or `MS`.
    node, topic, type_name : str
        Names; the topic begins with `/`.
    qos : str
        As rmw_zenoh writes it.
    ids : tuple of int
        Numbers of its node and of itself within a session.
    hashed : str
        Of the type; empty when it is our own.
    """

    kind: str
    node: str
    topic: str
    type_name: str
    qos: str
    ids: tuple[int, int] = (0, 0)
    hashed: str = ""


def dds_type(kind: str) -> str:
    """Return the name of a type as DDS has it.

    Examples
    --------
    >>> dds_type("sensor_msgs/msg/Imu")
    'sensor_msgs::msg::dds_::Imu_'
    """
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def endpoint_of(token: str) -> Endpoint | None:
    """Return the publisher or subscription that a token tells of, if it does."""
    fields = token.split("/")
    if len(fields) < _FIELDS or fields[0] != TOKENS or fields[5] not in ("MP", "MS"):
        return None
    kind, namespace, node = fields[5], fields[7], fields[8]
    topic, dds, hashed, qos = fields[9:13]
    package, _, _, name = dds.split("::") if dds.count("::") == 3 else ("", "", "", dds)  # noqa: PLR2004
    type_name = f"{package}/msg/{name.removesuffix('_')}"
    full = f"{namespace.replace('%', '/').rstrip('/')}/{node}".removeprefix("/")
    return Endpoint(kind, full, topic.replace("%", "/"), type_name, qos, hashed=hashed)


def gid_of(token: str) -> bytes:
    """Return a name of 16 bytes for a publisher; any will do that is its own."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_BYTES).digest()


def attachment(sequence: int, t: float, gid: bytes) -> bytes:
    """Return what a ROS subscription wants with each message.

    Parameters
    ----------
    sequence : int
        From 1, by one for each message of a publisher.
    t : float
        When it was published, Unix seconds.
    gid : bytes
        Of the publisher.

    Returns
    -------
    bytes
        33 of them.
    """
    return _ATTACHMENT.pack(sequence, round(t * 1e9), _GID_BYTES, gid)
