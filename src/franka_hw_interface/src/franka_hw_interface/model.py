"""The model of the arm as controllers see it: one protocol, several implementations, and a handle that computes on
demand."""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np

from franka_hw_interface.robot_state import RobotState
from hric_control.geometry import FloatArray

Vector = Sequence[float] | FloatArray


class Frame(Enum):
    """Frames of libfranka: the seven joints, the flange, the end effector (flange * F_T_EE) and the stiffness frame
    (end effector * EE_T_K)."""

    JOINT1 = "joint1"
    JOINT2 = "joint2"
    JOINT3 = "joint3"
    JOINT4 = "joint4"
    JOINT5 = "joint5"
    JOINT6 = "joint6"
    JOINT7 = "joint7"
    FLANGE = "flange"
    END_EFFECTOR = "end_effector"
    STIFFNESS = "stiffness"


@runtime_checkable
class FrankaModel(Protocol):
    """Dynamics and kinematics of a Franka arm with the load and the frames that were set. Arrays are the caller's own.

    Base frame: O, `<arm_id>_link0`. What is mounted at the flange (the hand) counts; where it is known from depends on
    the implementation.

    Attributes:
        gravity_list: q (7 floats) -> g(q), 7 floats [N m]; the fast path for control loops, without checks.
        revision: counts the changes of load and frames.
    """

    revision: int
    gravity_list: Callable[[Sequence[float]], list[float]]

    def mass(self, q: Vector) -> FloatArray:
        """Mass matrix without rotor inertia, shape (7, 7) [kg m^2]; q: shape (7,) [rad]."""

    def coriolis(self, q: Vector, dq: Vector) -> FloatArray:
        """The vector C(q, dq) dq, shape (7,) [N m]; dq: shape (7,) [rad/s]."""

    def gravity(self, q: Vector, gravity_base: Sequence[float] | None = None) -> FloatArray:
        """Torque against gravity, shape (7,) [N m]; gravity_base: other gravity in the base frame, 3 floats [m/s^2]."""

    def pose(self, frame: Frame, q: Vector) -> FloatArray:
        """T_base_frame, shape (4, 4)."""

    def zero_jacobian(self, frame: Frame, q: Vector) -> FloatArray:
        """Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""

    def body_jacobian(self, frame: Frame, q: Vector) -> FloatArray:
        """The same in the frame itself, shape (6, 7)."""

    def set_load(self, mass: float, com: Vector, inertia: Vector | FloatArray) -> None:
        """Payload [kg], its centre of mass in the flange frame [m], its inertia about that [kg m^2]; in place of the
        one before."""

    def set_ee(self, F_T_EE: FloatArray) -> None:
        """End effector in the flange frame, shape (4, 4)."""

    def set_stiffness_frame(self, EE_T_K: FloatArray) -> None:
        """Stiffness frame in the end-effector frame, shape (4, 4)."""


class FrankaModelHandle:
    """The model at the robot's present state. Each value is computed when it is first read, once per tick.

    The arrays are shared within the tick and read-only.
    """

    def __init__(self, name: str, model: FrankaModel, state: RobotState) -> None:
        self.name, self._model, self._state = name, model, state
        self._cache: dict[object, FloatArray] = {}
        self._valid = (-1, -1)

    def _cached(self, key: object, compute: Callable[[], FloatArray]) -> FloatArray:
        now = (self._state.tick, self._model.revision)
        if now != self._valid:
            self._cache.clear()
            self._valid = now
        value = self._cache.get(key)
        if value is None:
            value = self._cache[key] = compute()
            value.setflags(write=False)
        return value

    def mass(self) -> FloatArray:
        """Mass matrix without rotor inertia, shape (7, 7) [kg m^2]."""
        return self._cached("mass", lambda: self._model.mass(self._state.q))

    def coriolis(self) -> FloatArray:
        """The vector C(q, dq) dq, shape (7,) [N m]."""
        return self._cached("coriolis", lambda: self._model.coriolis(self._state.q, self._state.dq))

    def gravity(self) -> FloatArray:
        """Torque against gravity with the load that was set, shape (7,) [N m]."""
        return self._cached("gravity", lambda: np.array(self._model.gravity_list(self._state.q)))

    def pose(self, frame: Frame) -> FloatArray:
        """T_base_frame, shape (4, 4)."""
        return self._cached(("pose", frame), lambda: self._model.pose(frame, self._state.q))

    def zero_jacobian(self, frame: Frame) -> FloatArray:
        """Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""
        return self._cached(("zero", frame), lambda: self._model.zero_jacobian(frame, self._state.q))

    def body_jacobian(self, frame: Frame) -> FloatArray:
        """The same in the frame itself, shape (6, 7)."""
        return self._cached(("body", frame), lambda: self._model.body_jacobian(frame, self._state.q))
