"""A robot node without physics: the fake robot under a real controller manager, a loop of 250 Hz. Run with a namespace
as its argument."""

import signal
import sys
import threading
import time

import rospy
from recorded_calls import FakeController, RecordingRobotHW

from hric_control.manager.controller_manager import ControllerManager
from hric_control.manager.services import ManagerServices
from hric_core import realtime
from hric_core.ros import RosNode
from hric_core.ros.process import shut_down
from hric_core.scoped_node import ScopedNode

PERIOD = 0.004


def main(namespace: str) -> None:
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rospy.init_node("robot", disable_signals=True)  # rospy's handler waits for ever for what get_param holds below it
    rospy.on_shutdown(ended.set)
    node = RosNode(namespace)
    manager = ControllerManager(RecordingRobotHW(), node, {"fake/Controller": FakeController})
    begin, cycles, paused = time.monotonic(), 0, False
    node.clock = lambda: cycles * PERIOD
    offered = ScopedNode(node)
    ManagerServices(manager, offered)
    while not ended.is_set():
        if cycles % 25 == 0:
            paused = rospy.get_param("/paused", False)
        if not paused:
            manager.update(cycles * PERIOD, PERIOD)
        cycles += 1
        time.sleep(max(0.0, begin + cycles * PERIOD - time.monotonic()))
    offered.close()
    manager.shutdown()
    realtime.shutdown()
    shut_down("requested")


if __name__ == "__main__":
    main(sys.argv[1])
