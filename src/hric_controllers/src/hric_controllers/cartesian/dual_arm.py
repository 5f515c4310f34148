"""Cartesian impedance of two arms whose hands move as one, as DualArmCartesianImpedanceExampleController of franka_ros.

The centring frame C lies midway between both end effectors and has the orientation of the left one. Where the hands
are in C when the controller starts, they stay: a target of C moves both.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped

from franka_hw_interface.interfaces import FrankaStateInterface
from hric_control.controller import Controller
from hric_control.robot_hw import RobotHW
from hric_controllers.cartesian.impedance import CartesianImpedanceController
from hric_controllers.cartesian.workspace import JumpSettings, new_equilibrium
from hric_core import realtime
from hric_core.errors import HricError
from hric_core.geometry import Pose, stamped
from hric_core.geometry.poses import compose, inverse, pose_of_transform
from hric_core.node import Node
from hric_core.urdf import read

SIDES = ("left", "right")
"""Namespaces with the parameters of both arms, relative to the controller."""


class _Hand(CartesianImpedanceController):
    """Impedance controller of one of two arms, whose equilibrium follows the centring frame.

    Attributes:
        base: name of the arm's base frame.
    """

    @property
    def base(self) -> str:
        return self._base

    @property
    def measured(self) -> Pose:
        """Pose of the end effector in the arm's base."""
        return Pose.of_column_major(self._robot.O_T_EE)

    def lead_to(self, T_base_ee: Pose) -> None:
        """Set the target of the equilibrium, which it approaches with the time constant `filter_time`."""
        self._law.target = T_base_ee

    def _open_input(self) -> None:
        """Have no topic of its own: the centring frame leads both hands."""


class DualArmCartesianImpedanceController(Controller):
    """Cartesian impedance controller of two Franka arms in one robot, led by a pose of their centring frame.

    INTERFACE.md lists its parameters and topics.
    """

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get both arms, and then advertise the topics."""
        node = self._node = controller_node
        arms = robot_hw.get(FrankaStateInterface).names
        if len(arms) < len(SIDES):
            raise HricError(f"{type(robot_hw).__name__} has one Franka arm, {arms[0]}; valid: a robot with two of them")
        self._jump = JumpSettings.read(node)
        self._hands = tuple(_Hand() for _ in SIDES)
        for side, hand in zip(SIDES, self._hands, strict=True):
            hand.init(robot_hw, root_node, node.child(side))
        poses = read(root_node.search_param("robot_description")).poses({})
        self._T_world_base = [pose_of_transform(np.asarray(poses[hand.base])) for hand in self._hands]
        self._target: realtime.LatestValue[Pose | None] = realtime.LatestValue(None)
        self._center, self._running = Pose(), False
        self._rate = realtime.Throttle(100.0)
        self._published = realtime.publisher(node, "centering_frame", PoseStamped)
        node.subscribe("centering_frame_target_pose", PoseStamped, self._on_target, queue_size=1)

    def _on_target(self, message: Any) -> None:
        """Check a target pose of the centring frame, in the base of the left arm, and pass it to the loop.

        Raises:
            CommandError: the pose is refused; the node logs the error's text with the topic's name.
        """
        self._target.set(new_equilibrium(message, self._hands[0].base, self._center, self._jump, self._running))

    def _in_left_base(self, T_base_ee: Sequence[Pose]) -> list[Pose]:
        """Return poses of both end effectors, each given in its arm's base, in the base of the left arm."""
        T_left_world = inverse(self._T_world_base[0])
        return [compose(T_left_world, compose(T, pose)) for T, pose in zip(self._T_world_base, T_base_ee, strict=True)]

    def _center_of(self, T_base_ee: Sequence[Pose]) -> Pose:
        """Return the centring frame in the base of the left arm."""
        left, right = self._in_left_base(T_base_ee)
        x, y, z = (0.5 * (a + b) for a, b in zip(left.position, right.position, strict=True))
        return Pose((x, y, z), left.orientation)

    def starting(self, time: float) -> None:
        """Set both equilibria to the poses of the end effectors, and take these as fixed in the centring frame."""
        self._target.take_new()
        measured = [hand.measured for hand in self._hands]
        self._center = self._center_of(measured)
        self._T_center_ee = [compose(inverse(self._center), pose) for pose in self._in_left_base(measured)]
        for hand in self._hands:
            hand.starting(time)
        self._rate.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """Lead both hands to the newest target and command the torques of one cycle."""
        target = self._target.take_new()
        if target is not None:
            self._center = target
            T_world_center = compose(self._T_world_base[0], target)
            for hand, T_world_base, T_center_ee in zip(self._hands, self._T_world_base, self._T_center_ee, strict=True):
                hand.lead_to(compose(inverse(T_world_base), compose(T_world_center, T_center_ee)))
        for hand in self._hands:
            hand.update(time, period)
        if self._rate.due(time):
            stamp, center = self._node.now(), self._center_of([hand.measured for hand in self._hands])
            base = self._hands[0].base
            self._published.publish(lambda: stamped.pose_stamped(stamped.header(stamp, base), center))

    def stopping(self, time: float) -> None:
        """Stop accepting targets."""
        self._running = False
        for hand in self._hands:
            hand.stopping(time)
