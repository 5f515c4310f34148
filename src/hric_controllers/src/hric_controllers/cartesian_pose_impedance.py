"""Following a marker, or going to poses, with a spring and a damper instead of the arm's own motion generator: the arm stays compliant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hric_control.node import Registration
from hric_controllers.cartesian_impedance import CartesianImpedanceController
from hric_controllers.pose_tracking import PoseTracking


class CartesianPoseImpedanceController(CartesianImpedanceController):
    """The law of `cartesian_law` on efforts, its equilibrium led by `PoseTracking`; parameters and topics: INTERFACE.md."""

    def _read_input(self) -> None:
        self._tracking = PoseTracking(self._node, f"{self._arm_id}_link0")

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
