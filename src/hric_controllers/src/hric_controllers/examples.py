"""Controllers with the motions and names of those in franka_example_controllers, for users of franka_ros.

Each motion starts at rest where the arm is, and repeats. Formulas: franka_ros 0.10, franka_example_controllers. In
addition the robot's speed scale slows the motions down.
"""

import math
from dataclasses import dataclass

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface, FrankaVelocityCartesianInterface
from hric_control.controller import Controller
from hric_control.hardware_interface import PositionJointInterface, VelocityJointInterface
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers.parameters import ArmSettings
from hric_core.node import Node
from hric_core.parameters import Settings, names

TO_AND_FRO = math.pi / 5.0
"""Angular frequency of the examples that command joint positions, poses or the elbow [rad/s]."""


@dataclass(frozen=True)
class JointExampleSettings(Settings):
    """Parameters of an example that moves joints."""

    joint_names: tuple[str, ...] = names(text="joints of the arm, in order")


class ExampleController(Controller):
    """Base class of controllers whose motion depends on time alone; the time runs at the rate of the speed scale."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the handle of the robot's speed scale."""
        self._scale, self._elapsed = robot_hw.get(SpeedScaleInterface).handle(), 0.0

    def starting(self, time: float) -> None:
        """Begin the motion."""
        self._elapsed = 0.0

    def update(self, time: float, period: float) -> None:
        """Advance the motion by one cycle."""
        self._elapsed += self._scale.value * period
        self._command(self._elapsed)

    def _command(self, elapsed: float) -> None:
        """Command the motion at `elapsed` [s], the scaled time since its start."""
        raise NotImplementedError

    def _pulse(self, elapsed: float, period: float) -> float:
        """Return the speed scale times a velocity from 0 to 1 and back in each `period` [s], alternating in sign."""
        sign = -1.0 if int(elapsed / period) % 2 else 1.0
        return self._scale.value * sign * 0.5 * (1.0 - math.cos(2.0 * math.pi * elapsed / period))


class JointPositionExampleController(ExampleController):
    """Controller that moves all joints to and fro by 4.5 degrees, the fifth in the opposite direction."""

    settings = (JointExampleSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the joints."""
        super().init(robot_hw, root_node, controller_node)
        joints = JointExampleSettings.read(controller_node).joint_names
        self._group = robot_hw.get(PositionJointInterface).group(list(joints))

    def starting(self, time: float) -> None:
        """Begin the motion at the measured position."""
        super().starting(time)
        self._begin = self._group.positions()

    def _command(self, elapsed: float) -> None:
        moved = 0.2 * math.pi / 16.0 * (1.0 - math.cos(TO_AND_FRO * elapsed))
        self._group.set_command([q - moved if k == 4 else q + moved for k, q in enumerate(self._begin)])


class JointVelocityExampleController(ExampleController):
    """Controller that moves all joints to and fro at up to 0.1 rad/s."""

    settings = (JointExampleSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the joints."""
        super().init(robot_hw, root_node, controller_node)
        self._joints = list(JointExampleSettings.read(controller_node).joint_names)
        self._group = robot_hw.get(VelocityJointInterface).group(self._joints)

    def _command(self, elapsed: float) -> None:
        self._group.set_command([0.1 * self._pulse(elapsed, 8.0)] * len(self._joints))


class CartesianPoseExampleController(ExampleController):
    """Controller that moves the end effector on an arc of radius 0.3 m in the x-z plane of the base."""

    settings = (ArmSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the arm."""
        super().init(robot_hw, root_node, controller_node)
        arm_id = ArmSettings.read(controller_node).arm_id
        self._arm = robot_hw.get(FrankaPoseCartesianInterface).handle(f"{arm_id}_robot")

    def starting(self, time: float) -> None:
        """Begin the motion at the last commanded pose and elbow."""
        super().starting(time)
        state = self._arm.robot_state
        self._pose, self._elbow = list(state.O_T_EE_c), list(state.elbow_c)

    def _command(self, elapsed: float) -> None:
        angle, pose = 0.25 * math.pi * (1.0 - math.cos(TO_AND_FRO * elapsed)), list(self._pose)
        pose[12] -= 0.3 * math.sin(angle)
        pose[14] -= 0.3 * (math.cos(angle) - 1.0)
        self._arm.set_command(pose)


class ElbowExampleController(CartesianPoseExampleController):
    """Controller that moves the elbow by up to 36 degrees and holds the end effector."""

    def _command(self, elapsed: float) -> None:
        angle = 0.1 * math.pi * (1.0 - math.cos(TO_AND_FRO * elapsed))
        self._arm.set_command(self._pose, [self._elbow[0] + angle, self._elbow[1]])


class CartesianVelocityExampleController(ExampleController):
    """Controller that moves the end effector to and fro at up to 0.05 m/s, down and forwards at 45 degrees."""

    settings = (ArmSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the arm."""
        super().init(robot_hw, root_node, controller_node)
        arm_id = ArmSettings.read(controller_node).arm_id
        self._arm = robot_hw.get(FrankaVelocityCartesianInterface).handle(f"{arm_id}_robot")

    def _command(self, elapsed: float) -> None:
        speed = 0.05 * self._pulse(elapsed, 4.0) * math.sqrt(0.5)
        self._arm.set_command([speed, 0.0, -speed, 0.0, 0.0, 0.0])
