"""A robot that streams odometry at 100 Hz and scans, and prints where it is."""

import math
import time

from homsense_client.streaming import Robot, connect

ENDPOINT = globals().get("ENDPOINT", "tcp/127.0.0.1:7447")
SITE = globals().get("SITE", "block")
SCANS = globals().get("SCANS", 8)
SEEN = [["cafe", "bank"], ["bank", "gym"], ["gym", "shop"], ["shop", "cafe"]]

with connect(ENDPOINT) as network, Robot(network, "example") as robot:
    robot.on_pose(lambda pose: print(pose.status, f"{pose.best.x_m:.1f} {pose.best.y_m:.1f}"))
    robot.on_event(lambda event: print(event["code"], event["detail"]))
    robot.open(SITE, particles=2000)
    for number in range(SCANS):
        for _ in range(100):
            robot.move({"forward_m": 0.05, "turn_rad": math.pi / 400}, dt_s=0.01)
            time.sleep(0.01)
        robot.scan(SEEN[number % 4])
    robot.close()
