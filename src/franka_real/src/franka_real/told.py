"""What a user tells the arm: payload, frames, impedances, thresholds; and the automatic recovery. Carried out by the control loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.transforms import check_transform
from franka_real.connection import Connection
from franka_real.requests import LoopCalls
from franka_real.state import LibfrankaState


class ToldArm:
    """The arm as `ArmServices` sees it.

    Args:
        connection: to the arm.
        calls: into the control loop.
        state: the arm's state.
        models: what shall reckon with the same payload and frames.
        on_recover: called in the loop; ends the error state.
    """

    def __init__(
        self, connection: Connection, calls: LoopCalls, state: LibfrankaState, models: Sequence[FrankaModel], on_recover: Callable[[], None]
    ) -> None:
        self._arm, self._patience, self._calls = connection.arm, connection.patience, calls
        self._state, self._models, self.recover = state, models, on_recover

    def request(self, function: Callable[[], None]) -> None:
        """Call `function` between two cycles and wait for it."""
        self._calls.request(function)

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Payload, beside the end effector."""
        with self._patience():
            self._arm.set_load(mass, list(com), list(inertia))
        for model in self._models:
            model.set_load(mass, com, inertia)

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """End effector in the nominal end-effector frame."""
        T = check_transform(NE_T_EE, "NE_T_EE")
        F_T_NE = np.array(self._state.F_T_NE).reshape(4, 4).T
        with self._patience():
            self._arm.set_EE_frame(list(NE_T_EE))
        self._state.told_NE_T_EE = list(NE_T_EE)
        for model in self._models:
            model.set_ee(F_T_NE @ T)

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Stiffness frame in the end-effector frame."""
        T = check_transform(EE_T_K, "EE_T_K")
        with self._patience():
            self._arm.set_K_frame(list(EE_T_K))
        for model in self._models:
            model.set_stiffness_frame(T)

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Stiffness of the internal joint impedance."""
        with self._patience():
            self._arm.set_joint_impedance(list(stiffness))

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Stiffness of the internal Cartesian impedance."""
        with self._patience():
            self._arm.set_cartesian_impedance(list(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Contact and collision thresholds."""
        with self._patience():
            self._arm.set_collision_behavior(thresholds)
