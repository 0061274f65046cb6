"""A robot that asks 6000 questions, insists on every answer, and stands still.

``python frozen_robot.py ENDPOINT SITE``; prints a line and stops itself (SIGSTOP).
"""

import os
import signal
import struct
import sys

import zenoh
from homsense_client.streaming import Robot, connect

QUESTIONS = 6000


def main() -> None:
    """Ask and freeze."""
    endpoint, site = sys.argv[1:]
    with connect(endpoint) as network:
        robot = Robot(network, "frozen")
        robot.open(site, particles=200)
        stamp = struct.pack("<Q8s", 0, robot._token)  # noqa: SLF001 - to ask without the SDK
        for _ in range(QUESTIONS):
            network.session.get(
                "homsense/@v1/dev/frozen/rpc/last",
                lambda _reply: None,
                payload=b"{}",
                attachment=stamp,
                timeout=60.0,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        print("frozen", flush=True)
        os.kill(os.getpid(), signal.SIGSTOP)


if __name__ == "__main__":
    main()
