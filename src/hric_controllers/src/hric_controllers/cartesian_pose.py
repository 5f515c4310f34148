"""Cartesian poses by the arm's own motion generator: following a marker (thesis ch. 3.3), or going to poses."""

from __future__ import annotations

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from hric_control.controller import Controller
from hric_control.errors import ParameterError
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_controllers.pose_tracking import PoseTracking


class CartesianPoseController(Controller):
    """Commands the poses of `PoseTracking`; parameters and topics: INTERFACE.md."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read everything first, then advertise, so that a refusal leaves nothing behind."""
        node = controller_node
        arm_id = node.param("arm_id")
        if not isinstance(arm_id, str) or not arm_id:
            raise ParameterError(f"{node.resolve('arm_id')} is {arm_id!r}; valid: the arm's name, e.g. panda")
        self._arm = robot_hw.get(FrankaPoseCartesianInterface).handle(f"{arm_id}_robot")
        self._tracking = PoseTracking(node, f"{arm_id}_link0")
        self._registrations = self._tracking.open()

    def starting(self, time: float) -> None:
        """The motion begins at the pose that the arm was commanded last."""
        self._tracking.start(self._arm.robot_state.O_T_EE_c)

    def update(self, time: float, period: float) -> None:
        """One millisecond of the motion."""
        tracking = self._tracking
        tracking.update(time, period)
        self._arm.set_command(tracking.transform())
        tracking.publish(time, self._arm.robot_state.O_T_EE)

    def stopping(self, time: float) -> None:
        """From here on commands are refused."""
        self._tracking.stop()

    def shutdown(self) -> None:
        """Take back the topics."""
        for registration in self._registrations:
            registration.unregister()
