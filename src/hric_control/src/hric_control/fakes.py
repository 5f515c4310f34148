"""Robot without physics, for tests of code that needs a robot."""

from collections.abc import Sequence

from hric_control.hardware_interface import (
    EffortJointInterface,
    JointCommands,
    JointStateInterface,
    JointStates,
    PositionJointInterface,
)
from hric_control.robot_hw import RobotHW


class FakeRobotHW(RobotHW):
    """Robot with effort and position interfaces whose commands have no effect.

    Attributes:
        states: storage of the joint states.
        effort, position: storage of the effort and position commands.
    """

    def __init__(self, joints: Sequence[str] = ("joint1", "joint2")) -> None:
        super().__init__()
        self.states = JointStates(joints)
        self.effort, self.position = JointCommands(self.states), JointCommands(self.states)
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(EffortJointInterface(self.effort))
        self.register_interface(PositionJointInterface(self.position))
