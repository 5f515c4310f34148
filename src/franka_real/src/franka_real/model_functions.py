"""Functions of libfranka's dynamic model through its two Python bindings, with one interface for both.

Arguments q [rad], dq [rad/s]: 7 floats. Column-major results: poses 16 floats, Jacobians 42, mass matrices 49."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.transforms import column_major, from_column_major
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties

Floats = Sequence[float]

SAME_KINEMATICS = 1e-4
"""Maximum difference between two Jacobians of the flange, by the robot description and by libfranka [m; 1].

Project default, unconfirmed: above the rounding of a URDF, below any link.
"""
_PROBES = ((0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854), (0.5, 0.3, -0.8, -1.2, 0.9, 2.0, -0.4))
"""Joint positions at which the two Jacobians of the flange are compared [rad]."""


@dataclass(frozen=True)
class Total:
    """Mass properties of end effector and payload together, as arguments of libfranka's model functions.

    Attributes:
        inertia: inertia about the centre of mass, axes of the flange frame, 9 floats [kg m^2].
        mass: total mass [kg].
        com: centre of mass in the flange frame, 3 floats [m].
    """

    inertia: list[float]
    mass: float
    com: list[float]

    @classmethod
    def of(cls, body: MassProperties) -> "Total":
        """Convert the mass properties of a body in the flange frame."""
        return cls(column_major(body.inertia), float(body.mass), [float(value) for value in body.com])


class _Model(Protocol):
    """Model object of one of the bindings; both have functions of these names, but with different arguments."""

    mass: Callable[..., list[float]]
    coriolis: Callable[..., list[float]]
    gravity: Callable[..., list[float]]
    pose: Callable[..., list[float]]
    zero_jacobian: Callable[..., list[float]]
    body_jacobian: Callable[..., list[float]]


class PandaFunctions:
    """Model functions of a Panda by libfranka 0.9.2 (panda_py), computed by the library downloaded from the arm.

    Args:
        model: model object, a `panda_py.libfranka.Model`.
    """

    def __init__(self, model: _Model) -> None:
        from panda_py.libfranka import Frame as Name  # a binary wheel that only this class needs

        self._model = model
        self._names = dict(zip(FrankaFrame, (getattr(Name, name) for name in _NAMES), strict=True))

    def mass(self, q: Floats, total: Total) -> list[float]:
        """Return the mass matrix M(q), 49 floats [kg m^2]."""
        return self._model.mass(q, total.inertia, total.mass, total.com)

    def coriolis(self, q: Floats, dq: Floats, total: Total) -> list[float]:
        """Return the Coriolis torque C(q, dq) dq, 7 floats [N m]."""
        return self._model.coriolis(q, dq, total.inertia, total.mass, total.com)

    def gravity(self, q: Floats, total: Total, gravity_base: Floats) -> list[float]:
        """Return the gravity torque g(q), 7 floats [N m]; gravity_base: gravity in the base frame [m/s^2]."""
        return self._model.gravity(q, total.mass, total.com, gravity_base)

    def pose(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the pose of a frame in the base frame, T_base_frame, 16 floats."""
        return self._model.pose(self._names[frame], q, F_T_EE, EE_T_K)

    def zero_jacobian(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the Jacobian of a frame's origin in base axes, 42 floats."""
        return self._model.zero_jacobian(self._names[frame], q, F_T_EE, EE_T_K)

    def body_jacobian(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the Jacobian of a frame's origin in the frame's own axes, 42 floats."""
        return self._model.body_jacobian(self._names[frame], q, F_T_EE, EE_T_K)


_NAMES = (*(f"kJoint{i}" for i in range(1, 8)), "kFlange", "kEndEffector", "kStiffness")
"""Names of libfranka's frames in the order of `FrankaFrame`."""


class Fr3Functions:
    """Model functions of an FR3 by libfranka 0.18 or later (pylibfranka).

    pylibfranka's functions have a complete robot state as argument, and know no other frame than the end effector. So
    libfranka computes the dynamics and the Jacobians of frames fixed to the flange; the arguments are written into a
    robot state for it. Poses, the Jacobians of joint frames and the axes of body Jacobians come from the robot
    description, whose kinematics must equal those that libfranka read from the arm.

    Args:
        model: model object, a `pylibfranka.Model`.
        state: a `pylibfranka.RobotState` that nothing else uses, since it is modified.
        kinematics: kinematics of the robot description.

    Raises:
        DescriptionError: the robot description is that of another arm.
    """

    def __init__(self, model: _Model, state: Any, kinematics: KdlFrankaModel) -> None:
        self._model, self._state, self._kinematics = model, state, kinematics
        for q in _PROBES:
            there = from_column_major(self._flange_jacobian(q, _IDENTITY), 7)
            apart = float(np.abs(there - kinematics.zero_jacobian(FrankaFrame.FLANGE, q)).max())
            if not apart < SAME_KINEMATICS:
                flange = f"{kinematics.arm_id}_link8"
                raise DescriptionError(
                    f"the robot description is not that of the connected arm: its Jacobian of {flange} differs from "
                    f"libfranka's by {apart:.3g}"
                )

    def _put(self, q: Floats, total: Total) -> Any:
        state = self._state
        state.q, state.I_total, state.m_total, state.F_x_Ctotal = q, total.inertia, total.mass, total.com
        return state

    def mass(self, q: Floats, total: Total) -> list[float]:
        """Return the mass matrix M(q), 49 floats [kg m^2]."""
        return self._model.mass(self._put(q, total))

    def coriolis(self, q: Floats, dq: Floats, total: Total) -> list[float]:
        """Return the Coriolis torque C(q, dq) dq, 7 floats [N m]."""
        state = self._put(q, total)
        state.dq = dq
        return self._model.coriolis(state)

    def gravity(self, q: Floats, total: Total, gravity_base: Floats) -> list[float]:
        """Return the gravity torque g(q), 7 floats [N m]; gravity_base: gravity in the base frame [m/s^2]."""
        state = self._put(q, total)
        state.O_ddP_O = gravity_base
        return self._model.gravity(state)

    def _flange_jacobian(self, q: Floats, F_T_X: list[float]) -> list[float]:
        """Return the Jacobian of a frame fixed to the flange, 42 floats, by passing it as the state's end effector."""
        state = self._state
        state.q, state.F_T_EE = q, F_T_X
        return self._model.zero_jacobian(state)

    def _pose(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray:
        F_T_X = _beyond_flange(frame, F_T_EE, EE_T_K)
        return (
            self._kinematics.pose(frame, q) if F_T_X is None else self._kinematics.pose(FrankaFrame.FLANGE, q) @ F_T_X
        )

    def _jacobian(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray:
        F_T_X = _beyond_flange(frame, F_T_EE, EE_T_K)
        if F_T_X is None:
            return self._kinematics.zero_jacobian(frame, q)
        return from_column_major(self._flange_jacobian(q, column_major(F_T_X)), 7)

    def pose(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the pose of a frame in the base frame, T_base_frame, 16 floats."""
        return column_major(self._pose(frame, q, F_T_EE, EE_T_K))

    def zero_jacobian(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the Jacobian of a frame's origin in base axes, 42 floats."""
        return column_major(self._jacobian(frame, q, F_T_EE, EE_T_K))

    def body_jacobian(self, frame: FrankaFrame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Return the Jacobian of a frame's origin in the frame's own axes, 42 floats."""
        R_frame_base = self._pose(frame, q, F_T_EE, EE_T_K)[:3, :3].T
        zero = self._jacobian(frame, q, F_T_EE, EE_T_K)
        return column_major(np.vstack([R_frame_base @ zero[:3], R_frame_base @ zero[3:]]))


_IDENTITY = column_major(np.eye(4))


def _beyond_flange(frame: FrankaFrame, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray | None:
    """Return the pose of a frame in the flange frame, shape (4, 4), None for a joint frame."""
    if frame is FrankaFrame.FLANGE:
        return np.eye(4)
    if frame is FrankaFrame.END_EFFECTOR:
        return from_column_major(F_T_EE)
    return from_column_major(F_T_EE) @ from_column_major(EE_T_K) if frame is FrankaFrame.STIFFNESS else None


ModelFunctions = PandaFunctions | Fr3Functions
