"""Print robot time per wall time on /clock, measured over some seconds of wall time:  clock_rate.py SECONDS"""

import sys
import time

import rospy
from rosgraph_msgs.msg import Clock


def main(seconds: float) -> None:
    """Hear one tick, wait, hear another; listening all the time would take its share of the processors."""
    rospy.init_node("clock_rate", anonymous=True)
    run_0, wall_0 = _tick()
    time.sleep(seconds)
    run_1, wall_1 = _tick()
    print((run_1 - run_0) / (wall_1 - wall_0))


def _tick() -> tuple[float, float]:
    """Robot time of the next tick and when it was heard [s]."""
    return rospy.wait_for_message("/clock", Clock).clock.to_sec(), time.monotonic()


if __name__ == "__main__":
    main(float(sys.argv[1]))
