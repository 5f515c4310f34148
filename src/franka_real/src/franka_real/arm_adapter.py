"""Adapter from the real arm to the services of franka_control; the control loop executes their requests."""

from collections.abc import Callable, Sequence

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.transforms import check_transform, from_column_major
from franka_real.connection import ArmConnection
from franka_real.state import LibfrankaState
from hric_control.loop_requests import LoopRequests


class ArmAdapter:
    """Adapter that passes the requests of `ArmServices` to libfranka and to the models.

    Args:
        connection: connection to the arm.
        requests: calls into the control loop, the only one that uses libfranka.
        state: the arm's state.
        models: models that get the same payload and frames.
        on_recover: callback in the loop that ends the error state.
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
        """Set the payload, in addition to the end effector."""
        with self._patience():
            self._arm.set_load(mass, list(com), list(inertia))
        for model in self._models:
            model.set_load(mass, com, inertia)

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """Set the end effector in the nominal end-effector frame."""
        T = check_transform(NE_T_EE, "NE_T_EE")
        F_T_NE = from_column_major(self._state.F_T_NE)
        with self._patience():
            self._arm.set_EE_frame(list(NE_T_EE))
        self._state.set_NE_T_EE = list(NE_T_EE)
        for model in self._models:
            model.set_ee(F_T_NE @ T)

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Set the stiffness frame in the end-effector frame."""
        T = check_transform(EE_T_K, "EE_T_K")
        with self._patience():
            self._arm.set_K_frame(list(EE_T_K))
        for model in self._models:
            model.set_stiffness_frame(T)

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal joint impedance."""
        with self._patience():
            self._arm.set_joint_impedance(list(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal Cartesian impedance."""
        with self._patience():
            self._arm.set_cartesian_impedance(list(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds."""
        with self._patience():
            self._arm.set_collision_behavior(thresholds)
