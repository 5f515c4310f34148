"""A server whose state holds a pattern, `python fci_pattern.py IP VERSION`; the error set has the number of the robot's
milliseconds modulo 41."""

import sys

from test_fci_wire import patterned

from franka_sim.box.requests import MotionCommand
from franka_sim.fci.device import ConstantDevice
from franka_sim.fci.robots import fr3_served_urdf
from franka_sim.fci.server import FciArm, FciServer
from franka_sim.fci.wire import WIRE_ERRORS


class PatternDevice(ConstantDevice):
    """Device whose state has another number in each field, and whose errors are set one after the other."""

    def __init__(self) -> None:
        super().__init__(fr3_served_urdf())
        self.state, self.count = patterned(), 0
        self.state.robot_mode = self.state.robot_mode.IDLE

    def cycle(self, command: MotionCommand | None) -> None:
        self.count += 1
        self.state.current_errors = self.state.last_motion_errors = frozenset({WIRE_ERRORS[self.count % 41]})


if __name__ == "__main__":
    FciServer([FciArm(PatternDevice(), sys.argv[1], int(sys.argv[2]))]).run()
