"""Adapter that lets the ROS services franka_control/... change settings of the emulated control box."""

from collections.abc import Callable, Sequence

from franka_hw_interface.arm_services import CollisionThresholds
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import RequestOutcome
from franka_sim.buttons import Buttons
from hric_control.sim.sim_loop import SimLoop
from hric_core.errors import CommandError
from hric_core.node import Node


class BoxAdapter:
    """Adapter that passes service requests to the emulated control box.

    If the box refuses a request, the methods raise a CommandError with its reason.

    Args:
        loop: simulation loop; requests run between its cycles.
        box: the control box.
        recover: function that runs the error recovery.
    """

    def __init__(self, loop: SimLoop, box: ControlBox, recover: Callable[[], None]) -> None:
        self._box, self.request, self.recover = box, loop.request, recover

    def buttons(self, root_node: Node) -> Buttons:
        """Offer the services `franka_control/set_user_stop` and `franka_control/set_guiding`."""
        where = root_node.resolve("franka_control")
        return Buttons(root_node, where, self._box.set_user_stop, self._box.set_guiding, self.request)

    def _send(self, request: Callable[[], RequestOutcome]) -> None:
        box, reasons = self._box, list[str]()
        before, box.report = box.report, reasons.append
        try:
            outcome = request()
        finally:
            box.report = before
        if outcome is not RequestOutcome.SUCCESS:
            raise CommandError(reasons[-1] if reasons else outcome.value)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Set the payload: mass [kg], centre of mass in the flange [m], inertia about it, 9 floats [kg m^2]."""
        self._send(lambda: self._box.set_load(mass, com, inertia))

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major."""
        self._send(lambda: self._box.set_NE_T_EE(NE_T_EE))

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major."""
        self._send(lambda: self._box.set_EE_T_K(EE_T_K))

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]."""
        self._send(lambda: self._box.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal Cartesian impedance, 3 [N/m] and 3 [N m/rad], stiffness-frame axes."""
        self._send(lambda: self._box.set_cartesian_impedance(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds."""
        self._send(lambda: self._box.set_collision_behavior(*thresholds.lists()))
