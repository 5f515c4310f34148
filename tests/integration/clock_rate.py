"""Print the run time per wall time on /clock, measured over some seconds of wall time:  clock_rate.py SECONDS"""

from __future__ import annotations

import sys
import time

import rospy
from rosgraph_msgs.msg import Clock


def main(seconds: float) -> None:
    """Listen, then print."""
    rospy.init_node("clock_rate", anonymous=True)
    heard: list[tuple[float, float]] = []
    rospy.Subscriber("/clock", Clock, lambda message: heard.append((message.clock.to_sec(), time.monotonic())), queue_size=1000)
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        time.sleep(0.1)
    (run_0, wall_0), (run_1, wall_1) = heard[0], heard[-1]
    print((run_1 - run_0) / (wall_1 - wall_0))


if __name__ == "__main__":
    main(float(sys.argv[1]))
