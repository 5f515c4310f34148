"""Cartesian poses by the arm's own motion generator: following a marker (thesis ch. 3.3), or going to poses."""

from collections.abc import Sequence

import numpy as np

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from hric_control.controller import Controller
from hric_control.node import Node, Registration
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers.cartesian.impedance import CartesianImpedanceController
from hric_controllers.marker.pose_tracking import PoseTracking
from hric_controllers.parameters import ArmSettings


class CartesianPoseController(Controller):
    """Commands the poses of `PoseTracking`; parameters and topics: INTERFACE.md."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read everything first, then advertise, so that a refusal leaves nothing behind."""
        node = controller_node
        arm_id = ArmSettings.read(node).arm_id
        self._arm = robot_hw.get(FrankaPoseCartesianInterface).handle(f"{arm_id}_robot")
        scale = robot_hw.get(SpeedScaleInterface).handle()
        self._tracking = PoseTracking(node, f"{arm_id}_link0", scale)
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


class CartesianPoseImpedanceController(CartesianImpedanceController):
    """The law of `cartesian_law` on efforts, its equilibrium led by `PoseTracking`; parameters and topics:
    INTERFACE.md."""

    def _obeys(self, filter_time: float) -> bool:
        """The motion is slowed down, not the filter, which only gains pass."""
        return True

    def _read_input(self) -> None:
        self._tracking = PoseTracking(self._node, f"{self._arm_id}_link0", self._scale)

    def _open_input(self) -> Sequence[Registration]:
        return self._tracking.open()

    def _start_input(self) -> None:
        """The equilibrium begins where the end effector is, so that nothing pulls."""
        self._tracking.start(self._robot.O_T_EE)

    def _lead(self, time: float, period: float) -> None:
        """The motion is smooth already: no filter, and the damper knows its velocity."""
        tracking, law = self._tracking, self._law
        tracking.update(time, period)
        law.pose = law.target = tracking.pose
        law.twist = np.array(tracking.twist)
        tracking.publish(time, self._robot.O_T_EE)

    def stopping(self, time: float) -> None:
        """From here on poses are refused."""
        super().stopping(time)
        self._tracking.stop()
