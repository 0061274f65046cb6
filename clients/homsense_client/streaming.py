"""Streaming over zenoh; needs ``homsense[zenoh]``."""

from homsense_client._async_robot import AsyncRobot
from homsense_client._network import Network, connect
from homsense_client._robot import Robot

__all__ = ["AsyncRobot", "Network", "Robot", "connect"]
