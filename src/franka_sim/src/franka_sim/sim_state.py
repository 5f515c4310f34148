"""The simulated arm's state: what a cycle needs is copied, the rest is computed when somebody reads it."""

from __future__ import annotations

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import Frame
from franka_hw_interface.robot_state import RobotState, lazy_field
from franka_hw_interface.transforms import column_major
from hric_control.hardware_interface import JointStates

ELBOW_FLIP = -0.467002423653011
"""Position of joint 4 at which the elbow changes its side (libfranka, RobotState::elbow) [rad]."""


def _elbow(q: list[float]) -> list[float]:
    return [q[2], 1.0 if q[3] > ELBOW_FLIP else -1.0]


class SimRobotState(RobotState):
    """State of the simulated arm; q, dq and tau_J are the lists of the joint states themselves, theta and dtheta too (the joints are rigid).

    Computed when read, once per tick: O_T_EE, O_T_EE_d, elbow, elbow_d, dtau_J. Always zero or the identity so far: the estimates of external
    torque and wrench, contact and collision flags, errors, and all that belongs to Cartesian commands (O_T_EE_c and its derivatives, elbow_c, ...).
    """

    __slots__ = ("_model", "computed_at", "period", "tau_before")

    O_T_EE = lazy_field("O_T_EE", lambda state: column_major(state._model.pose(Frame.END_EFFECTOR, state.q)))
    O_T_EE_d = lazy_field("O_T_EE_d", lambda state: column_major(state._model.pose(Frame.END_EFFECTOR, state.q_d)))
    elbow = lazy_field("elbow", lambda state: _elbow(state.q))
    elbow_d = lazy_field("elbow_d", lambda state: _elbow(state.q_d))
    dtau_J = lazy_field("dtau_J", lambda state: [(b - a) / state.period for a, b in zip(state.tau_before, state.tau_J, strict=True)])

    def __init__(self, states: JointStates, model: KdlFrankaModel, period: float) -> None:
        self.computed_at: dict[str, int] = {}
        super().__init__()
        self._model, self.period = model, period
        self.tau_before = [0.0] * len(states.names)
        self.q = self.theta = states.position
        self.dq = self.dtheta = states.velocity
        self.tau_J = states.effort
        self.take_configuration()

    def take_configuration(self) -> None:
        """Copy what the model was told: load, end effector, frames, and the mounting."""
        model = self._model
        for name, body in (("ee", model.ee_inertial), ("load", model.load), ("total", model.total_inertial)):
            setattr(self, f"m_{name}", body.mass)
            setattr(self, f"F_x_C{name}", body.com.tolist())
            setattr(self, f"I_{name}", column_major(body.inertia))
        self.F_T_NE, self.F_T_EE, self.EE_T_K = (column_major(T) for T in (model.F_T_NE, model.F_T_EE, model.EE_T_K))
        self.NE_T_EE = column_major(np.linalg.inv(model.F_T_NE) @ model.F_T_EE)
        self.O_ddP_O = model.gravity_base.tolist()
        self.computed_at.clear()
