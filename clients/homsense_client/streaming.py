"""Streaming over zenoh; needs ``homsense[zenoh]``."""

from homsense_client._async_robot import AsyncRobot
from homsense_client._robot import Network, Robot, connect

__all__ = ["AsyncRobot", "Network", "Robot", "connect"]
