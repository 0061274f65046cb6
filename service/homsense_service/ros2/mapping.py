"""The operator's file: which robot has which topics, and which site it is on."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, ValidationError, model_validator

from homsense_service import schemas
from homsense_service.bridge.keyspace import DEVICE
from homsense_service.ros2.graph import Dialect, Graph
from homsense_service.schemas.wire import NAME

Topic = Annotated[str, StringConstraints(pattern=r"^/[A-Za-z_][A-Za-z0-9_/]*$", max_length=200)]


class RobotIn(schemas.Wire):
    """One robot."""

    device: Annotated[str, StringConstraints(pattern=rf"^{DEVICE}$")]
    site: Annotated[str, StringConstraints(pattern=NAME)]
    odometry: Topic | None = None
    imu: Topic | None = None
    scans: Topic | None = None
    scan_type: Literal["diagnostics", "json"] = "diagnostics"
    pose: Topic
    particles: Topic | None = None
    frame_id: str = "map"
    max_speed_mps: float = Field(default=20.0, gt=0)
    pose_hz: float = Field(default=10.0, ge=0.1, le=100.0)
    session: schemas.SessionIn = schemas.SessionIn()

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if self.odometry is None and self.imu is None:
            message = "one of odometry and imu, or both"
            raise ValueError(message)
        if self.odometry is None and self.session.motion.type != "imu":
            message = 'with imu alone, session.motion.type must be "imu"'
            raise ValueError(message)
        return self

    def inputs(self) -> dict[str, str]:
        """Return the type of each topic that the robot publishes."""
        is_json = self.scan_type == "json"
        wanted = {
            self.odometry: "nav_msgs/msg/Odometry",
            self.imu: "sensor_msgs/msg/Imu",
            self.scans: "std_msgs/msg/String"
            if is_json
            else "diagnostic_msgs/msg/DiagnosticArray",
        }
        return {topic: kind for topic, kind in wanted.items() if topic is not None}

    def outputs(self) -> dict[str, str]:
        """Return the type of each topic that the service publishes."""
        made = {self.pose: "geometry_msgs/msg/PoseWithCovarianceStamped"}
        if self.particles is not None:
            made[self.particles] = "geometry_msgs/msg/PoseArray"
        return made


class Mapping(schemas.Wire):
    """All robots of one ROS domain."""

    dialect: Dialect = "rmw_zenoh"
    distro: Literal["humble", "jazzy", "kilted", "lyrical", "rolling"] = "jazzy"
    domain: int = Field(default=0, ge=0, le=232)
    robots: list[RobotIn] = Field(min_length=1, max_length=1000)

    @model_validator(mode="after")
    def _are_different(self) -> Self:
        names = [robot.device for robot in self.robots]
        for name in names:
            if names.count(name) > 1:
                message = f"robots: there are two with the device {name!r}"
                raise ValueError(message)
        return self

    @property
    def graph(self) -> Graph:
        """How topics are named."""
        return Graph(self.dialect, self.domain, self.distro == "humble")


def read_mapping(path: Path) -> Mapping:
    """Return what a mapping file says.

    Parameters
    ----------
    path : pathlib.Path
        TOML.

    Returns
    -------
    Mapping
        Sound.

    Raises
    ------
    ValueError
        If it cannot be read; names the member that is wrong.
    """
    try:
        return Mapping.model_validate(tomllib.loads(path.read_text()))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        message = f"{path}: {where}: {first['msg']}" if where else f"{path}: {first['msg']}"
        raise ValueError(message) from error
    except (OSError, tomllib.TOMLDecodeError) as error:
        message = f"{path}: {error}"
        raise ValueError(message) from error
