"""A robot node without physics: the fake robot under a real controller manager, a loop of 250 Hz. Run with a namespace
as its argument."""

import sys
import time

import rospy

from hric_control import realtime
from hric_control.fakes import FakeController, FakeRobotHW
from hric_control.manager import services as manager_services
from hric_control.manager.controller_manager import ControllerManager
from hric_control.ros import RosNode

PERIOD = 0.004


def main(namespace: str) -> None:
    rospy.init_node("robot")
    node = RosNode(namespace)
    manager = ControllerManager(FakeRobotHW(), node, {"fake/Controller": FakeController})
    begin, cycles, paused = time.monotonic(), 0, False
    node.clock = lambda: cycles * PERIOD
    services = manager_services.serve(manager, node)
    while not rospy.is_shutdown():
        if cycles % 25 == 0:
            paused = rospy.get_param("/paused", False)
        if not paused:
            manager.update(cycles * PERIOD, PERIOD)
        cycles += 1
        time.sleep(max(0.0, begin + cycles * PERIOD - time.monotonic()))
    services.unregister()
    manager.shutdown()
    realtime.shutdown()


if __name__ == "__main__":
    main(sys.argv[1])
