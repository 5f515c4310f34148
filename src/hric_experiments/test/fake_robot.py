"""Simulated interface of a robot: robot time at four times the speed of wall time, a control log, a controller without
dynamics, and a controller manager that lists it."""

import sys
import time
from pathlib import Path

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from controller_manager_msgs.msg import ControllerState
from controller_manager_msgs.srv import ListControllers, ListControllersResponse
from hric_msgs.msg import ControlLog

sys.path.insert(0, str(Path(__file__).parents[2] / "hric_bags" / "test"))
from synthetic import BATCH, PERIOD

JOINTS = [f"j{i}" for i in range(1, 4)]
SPEED = 4.0


class FakeRobot:
    """Publishes batches of cycles in which the joints approach the last command."""

    def __init__(self) -> None:
        self.q, self.target, self.cycle = [0.0] * 3, [0.0] * 3, 0
        self.clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self.log = rospy.Publisher("control_log", ControlLog, queue_size=100)
        rospy.Subscriber("pd/command", Float64MultiArray, self.command)
        states = [ControllerState(name="pd", state="running", type="fake/PD")]
        rospy.Service(
            "controller_manager/list_controllers", ListControllers, lambda _: ListControllersResponse(controller=states)
        )

    def command(self, message: Float64MultiArray) -> None:
        """Receive a setpoint."""
        self.target = list(message.data)

    def step(self) -> None:
        """Publish one batch."""
        message = ControlLog(
            joint_names=JOINTS, command_interface=["effort"] * 3, first_cycle=self.cycle, n_cycles=BATCH
        )
        message.header.stamp = rospy.Time.from_sec(self.cycle * PERIOD)
        for i in range(BATCH):
            self.q = [q + 0.05 * (target - q) for q, target in zip(self.q, self.target, strict=True)]
            message.time.append((self.cycle + i) * PERIOD)
            for name in ("position", "velocity", "effort", "command_raw", "command"):
                getattr(message, name).extend(self.q)
        self.cycle += BATCH
        self.log.publish(message)
        self.clock.publish(Clock(rospy.Time.from_sec(self.cycle * PERIOD)))


def main() -> None:
    """Run until killed."""
    rospy.init_node("robot", disable_signals=True)
    robot = FakeRobot()
    start = time.monotonic()
    while not rospy.is_shutdown():
        robot.step()
        time.sleep(max(0.0, start + robot.cycle * PERIOD / SPEED - time.monotonic()))


if __name__ == "__main__":
    main()
