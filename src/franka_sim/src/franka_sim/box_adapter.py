"""The control box as the services of franka_control see it."""

from collections.abc import Callable, Sequence

from franka_hw_interface.arm_services import CollisionThresholds
from franka_sim.box.control_box import ControlBox
from franka_sim.box.requests import Outcome
from hric_control.errors import CommandError
from hric_control.sim.sim_loop import SimLoop


class BoxAdapter:
    """Passes requests on to the box; a refusal becomes a CommandError with the box's words.

    Args:
        loop: whose cycles the requests come between.
        box: the control box.
        recover: ends the error state.
    """

    def __init__(self, loop: SimLoop, box: ControlBox, recover: Callable[[], None]) -> None:
        self._loop, self._box, self.recover = loop, box, recover

    def request(self, function: Callable[[], None]) -> None:
        """Call `function` between two cycles."""
        self._loop.request(function)

    def _send(self, request: Callable[[], Outcome]) -> None:
        box, reasons = self._box, list[str]()
        before, box.report = box.report, reasons.append
        try:
            outcome = request()
        finally:
            box.report = before
        if outcome is not Outcome.SUCCESS:
            raise CommandError(reasons[-1] if reasons else outcome.value)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Payload of the arm's model."""
        self._send(lambda: self._box.set_load(mass, com, inertia))

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """End effector in the nominal end-effector frame."""
        self._send(lambda: self._box.set_NE_T_EE(NE_T_EE))

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Stiffness frame in the end-effector frame."""
        self._send(lambda: self._box.set_EE_T_K(EE_T_K))

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Stiffness of the internal joint impedance."""
        self._send(lambda: self._box.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Stiffness of the internal Cartesian impedance."""
        self._send(lambda: self._box.set_cartesian_impedance(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Contact and collision thresholds."""
        self._send(lambda: self._box.set_collision_behavior(*thresholds.lists()))
