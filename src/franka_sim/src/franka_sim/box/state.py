"""Robot state of the control box: measured fields are written each cycle, derived ones are computed when read."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotState, lazy_field
from franka_hw_interface.transforms import column_major
from franka_sim.box.config import CollisionBehavior
from franka_sim.box.kinematics import ArmKinematics
from franka_sim.box.requests import ControllerMode, GeneratorMode
from hric_core.geometry.transforms import inverse

if TYPE_CHECKING:
    from franka_sim.box.compiled_fields import CompiledFields

ELBOW_FLIP = -0.467002423653011
"""Position of joint 4 at which the elbow changes its side (libfranka, RobotState::elbow) [rad]."""

CARTESIAN = frozenset((GeneratorMode.CARTESIAN_POSITION, GeneratorMode.CARTESIAN_VELOCITY))
"""Motion generators that write the desired Cartesian fields of the state themselves."""
_DESIRED = ("O_T_EE_d", "O_T_EE_c", "O_dP_EE_d", "elbow_d", "elbow_c")


def elbow(q: list[float]) -> list[float]:
    """Return the position of joint 3 [rad] and the side of joint 4, -1 or 1."""
    return [q[2], 1.0 if q[3] > ELBOW_FLIP else -1.0]


def _pose(state: BoxState, q: list[float]) -> list[float]:
    return state.kinematics.pose(q)


def _desired_twist(state: BoxState) -> list[float]:
    if not any(state.dq_d):
        return [0.0] * 6
    twist: list[float] = (
        state.model.zero_jacobian(FrankaFrame.END_EFFECTOR, state.q_d) @ np.array(state.dq_d)
    ).tolist()
    return twist


def _written_by_generator(name: str, otherwise: Callable[[BoxState], list[float]]) -> Any:
    """Return a field that a Cartesian motion generator writes while it runs; otherwise it is computed when read."""
    slot = RobotState.__dict__[name]

    def compute(state: BoxState) -> list[float]:
        value: list[float] = slot.__get__(state) if state.generator_mode in CARTESIAN else otherwise(state)
        return value

    return lazy_field(name, compute)


def _levels(values: list[float], thresholds: tuple[float, ...]) -> list[float]:
    return [1.0 if abs(x) > limit else 0.0 for x, limit in zip(values, thresholds, strict=True)]


class BoxState(RobotState):
    """Robot state as the control box sends it. theta and dtheta equal q and dq, since the joints are rigid.

    Attributes:
        controller_mode, generator_mode: modes of the running motion; OTHER and IDLE without one.
        model: model of the arm, with the load and frames that were set.
        kinematics: kinematics of the arm with the end effector that was set.
        fields: compiled computation of the external wrench, and of all derived fields at once.
        thresholds: thresholds of contact and collision.
        wrench_noise: noise of the estimated external wrench, 3 forces [N] and 3 moments [N m], base axes; None: none.
        last_motion_errors: errors that ended the last motion (on the wire: reflex_reason).

    Computed when read, at most once per cycle: poses, elbows, desired twist, dtau_J, external wrench, contacts.
    """

    __slots__ = (
        "computed_at",
        "controller_mode",
        "dq_before",
        "fields",
        "generator_mode",
        "kinematics",
        "model",
        "period",
        "tau_before",
        "thresholds",
        "wrench_noise",
    )

    O_T_EE = lazy_field("O_T_EE", lambda state: _pose(state, state.q))
    O_T_EE_d = _written_by_generator("O_T_EE_d", lambda state: _pose(state, state.q_d))
    O_T_EE_c = _written_by_generator("O_T_EE_c", lambda state: state.O_T_EE_d[:])
    O_dP_EE_d = _written_by_generator("O_dP_EE_d", _desired_twist)
    elbow = lazy_field("elbow", lambda state: elbow(state.q))
    elbow_d = _written_by_generator("elbow_d", lambda state: elbow(state.q_d))
    elbow_c = _written_by_generator("elbow_c", lambda state: elbow(state.q_d))
    dtau_J = lazy_field(
        "dtau_J", lambda state: [(b - a) / state.period for a, b in zip(state.tau_before, state.tau_J, strict=True)]
    )
    O_F_ext_hat_K = lazy_field("O_F_ext_hat_K", lambda state: state.fields.wrench(state)[0])
    K_F_ext_hat_K = lazy_field("K_F_ext_hat_K", lambda state: state.fields.wrench(state)[1])
    joint_contact = lazy_field("joint_contact", lambda state: _levels(state.tau_ext_hat_filtered, state.lower()[0]))
    cartesian_contact = lazy_field("cartesian_contact", lambda state: _levels(state.K_F_ext_hat_K, state.lower()[1]))

    def __init__(
        self, model: KdlFrankaModel, period: float, thresholds: CollisionBehavior, fields: CompiledFields
    ) -> None:
        self.computed_at: dict[str, int] = {}
        self.controller_mode, self.generator_mode = ControllerMode.OTHER, GeneratorMode.IDLE
        super().__init__()
        self.kinematics = ArmKinematics(model)
        self.model, self.period, self.thresholds, self.fields = model, period, thresholds, fields
        self.tau_before, self.dq_before = [0.0] * 7, [0.0] * 7
        self.wrench_noise: list[float] | None = None
        self.theta, self.dtheta = self.q, self.dq
        self.computed_at.clear()
        self.take_configuration()

    def snapshot(self) -> RobotState:
        """Return a copy that later cycles do not change."""
        self.fields.fill(self)
        return super().snapshot()

    def take_configuration(self) -> None:
        """Copy load, end effector, frames and mounting from the model."""
        model = self.model
        self.kinematics.update()
        for name, body in (("ee", model.ee_inertial), ("load", model.load), ("total", model.total_inertial)):
            setattr(self, f"m_{name}", body.mass)
            setattr(self, f"F_x_C{name}", body.com.tolist())
            setattr(self, f"I_{name}", column_major(body.inertia))
        self.F_T_NE, self.F_T_EE, self.EE_T_K = (column_major(T) for T in (model.F_T_NE, model.F_T_EE, model.EE_T_K))
        self.NE_T_EE = column_major(inverse(model.F_T_NE) @ model.F_T_EE)
        self.O_ddP_O = model.gravity_base.tolist()
        self.computed_at.clear()

    @property
    def accelerating(self) -> bool:
        """True if the desired motion accelerates; the `_acceleration` thresholds then replace the `_nominal` ones."""
        return any(self.ddq_d)

    def lower(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the contact thresholds: (7 torques [N m], 3 forces [N] and 3 moments [N m])."""
        t = self.thresholds
        accelerating = (t.lower_torque_acceleration, t.lower_force_acceleration)
        return accelerating if self.accelerating else (t.lower_torque_nominal, t.lower_force_nominal)

    def upper(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the collision thresholds: (7 torques [N m], 3 forces [N] and 3 moments [N m])."""
        t = self.thresholds
        accelerating = (t.upper_torque_acceleration, t.upper_force_acceleration)
        return accelerating if self.accelerating else (t.upper_torque_nominal, t.upper_force_nominal)

    def desired_changed(self) -> None:
        """Invalidate the fields that were computed from the previous desired joint motion."""
        if self.tick not in self.computed_at.values():
            self.computed_at.clear()  # all of them belong to earlier cycles
        for name in _DESIRED:
            self.computed_at.pop(name, None)
