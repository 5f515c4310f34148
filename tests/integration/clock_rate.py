"""Print robot time per wall time on /clock, measured over some seconds of wall time:  clock_rate.py SECONDS"""

import sys
import time

import rospy
from rosgraph_msgs.msg import Clock


def main(seconds: float) -> None:
    """Measure between two messages on /clock, without subscribing in between, which would need processor time."""
    rospy.init_node("clock_rate", anonymous=True)
    run_0, wall_0 = _tick()
    time.sleep(seconds)
    run_1, wall_1 = _tick()
    print((run_1 - run_0) / (wall_1 - wall_0))


def _tick() -> tuple[float, float]:
    """Return the robot time in the next message on /clock, and its wall time of arrival [s]."""
    return rospy.wait_for_message("/clock", Clock).clock.to_sec(), time.monotonic()


if __name__ == "__main__":
    main(float(sys.argv[1]))
