"""Adapter that lets the ROS services franka_control/... change settings of the real arm, between control cycles."""

from collections.abc import Callable, Sequence

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.transforms import check_frame, from_column_major
from franka_real.connection import ArmConnection
from franka_real.state import LibfrankaState
from hric_control.loop_requests import LoopRequests


class ArmAdapter:
    """Adapter that passes service requests to the arm through libfranka, and to the models of the arm.

    Args:
        connection: connection to the arm.
        requests: queue of calls that the control loop executes, since only its thread may use libfranka.
        state: Franka state of the arm.
        models: models that get the same payload and frames as the arm.
        on_recover: function that runs the error recovery, called in the control loop.
    """

    def __init__(
        self,
        connection: ArmConnection,
        requests: LoopRequests,
        state: LibfrankaState,
        models: Sequence[FrankaModel],
        on_recover: Callable[[], None],
    ) -> None:
        self._arm, self._patience = connection.arm, connection.patience
        self._state, self._models = state, models
        self.request, self.recover = requests.request, on_recover

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Set the payload: mass [kg], centre of mass in the flange [m], inertia about it, 9 floats [kg m^2]."""
        with self._patience():
            self._arm.set_load(mass, list(com), list(inertia))
        for model in self._models:
            model.set_load(mass, com, inertia)

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major."""
        T = check_frame(NE_T_EE, "NE_T_EE")
        F_T_NE = from_column_major(self._state.F_T_NE)
        with self._patience():
            self._arm.set_EE_frame(list(NE_T_EE))
        self._state.set_NE_T_EE = list(NE_T_EE)
        for model in self._models:
            model.set_ee(F_T_NE @ T)

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major."""
        T = check_frame(EE_T_K, "EE_T_K")
        with self._patience():
            self._arm.set_K_frame(list(EE_T_K))
        for model in self._models:
            model.set_stiffness_frame(T)

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]."""
        with self._patience():
            self._arm.set_joint_impedance(list(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal Cartesian impedance, 3 [N/m] and 3 [N m/rad], stiffness-frame axes."""
        with self._patience():
            self._arm.set_cartesian_impedance(list(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds."""
        with self._patience():
            self._arm.set_collision_behavior(thresholds)
