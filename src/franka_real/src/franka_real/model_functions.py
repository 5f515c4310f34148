"""libfranka's model through its two bindings, with one interface; vectors and matrices are column-major lists,
as libfranka has them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import Frame
from franka_hw_interface.transforms import column_major, from_column_major
from hric_control.errors import DescriptionError
from hric_control.geometry import FloatArray, MassProperties

Floats = Sequence[float]

SAME_KINEMATICS = 1e-4
"""How far the flange's Jacobian by the description may be from libfranka's [m; 1]. Project default, unconfirmed: above
the rounding of a URDF, below any link."""
_PROBES = ((0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854), (0.5, 0.3, -0.8, -1.2, 0.9, 2.0, -0.4))
"""Poses at which this is looked at [rad]."""


@dataclass(frozen=True)
class Total:
    """End effector and payload together, as libfranka takes them.

    Attributes:
        inertia: about the centre of mass, axes of the flange frame, 9 floats [kg m^2].
        mass: [kg].
        com: centre of mass in the flange frame, 3 floats [m].
    """

    inertia: list[float]
    mass: float
    com: list[float]

    @classmethod
    def of(cls, body: MassProperties) -> "Total":
        """From a body in the flange frame."""
        return cls(column_major(body.inertia), float(body.mass), [float(value) for value in body.com])


class ModelFunctions(Protocol):
    """libfranka's model. q, dq: 7 floats; poses 16, Jacobians 42, mass matrices 49 floats, column-major."""

    def mass(self, q: Floats, total: Total) -> list[float]:
        """M(q) [kg m^2]."""

    def coriolis(self, q: Floats, dq: Floats, total: Total) -> list[float]:
        """C(q, dq) dq [N m]."""

    def gravity(self, q: Floats, total: Total, gravity_base: Floats) -> list[float]:
        """g(q) [N m]."""

    def pose(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """T_base_frame."""

    def zero_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in base axes."""

    def body_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in the frame's own axes."""


class _Model(Protocol):
    """The functions of a binding's model, in which the two agree by name only."""

    mass: Callable[..., list[float]]
    coriolis: Callable[..., list[float]]
    gravity: Callable[..., list[float]]
    pose: Callable[..., list[float]]
    zero_jacobian: Callable[..., list[float]]
    body_jacobian: Callable[..., list[float]]


class PandaFunctions:
    """libfranka 0.9.2 through panda_py: everything is there, computed by the library that the arm sends.

    Args:
        model: panda_py.libfranka.Model.
    """

    def __init__(self, model: _Model) -> None:
        from panda_py.libfranka import Frame as Name  # a binary wheel that only this class needs

        self._model = model
        self._names = dict(zip(Frame, (getattr(Name, name) for name in _NAMES), strict=True))

    def mass(self, q: Floats, total: Total) -> list[float]:
        """M(q)."""
        return self._model.mass(q, total.inertia, total.mass, total.com)

    def coriolis(self, q: Floats, dq: Floats, total: Total) -> list[float]:
        """C(q, dq) dq."""
        return self._model.coriolis(q, dq, total.inertia, total.mass, total.com)

    def gravity(self, q: Floats, total: Total, gravity_base: Floats) -> list[float]:
        """g(q)."""
        return self._model.gravity(q, total.mass, total.com, gravity_base)

    def pose(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """T_base_frame."""
        return self._model.pose(self._names[frame], q, F_T_EE, EE_T_K)

    def zero_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in base axes."""
        return self._model.zero_jacobian(self._names[frame], q, F_T_EE, EE_T_K)

    def body_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in the frame's own axes."""
        return self._model.body_jacobian(self._names[frame], q, F_T_EE, EE_T_K)


_NAMES = (*(f"kJoint{i}" for i in range(1, 8)), "kFlange", "kEndEffector", "kStiffness")
"""libfranka's frames in the order of `Frame`."""


class Fr3Functions:
    """libfranka 0.18 or later through pylibfranka, whose functions take a whole state and know no frame but the end
    effector.

    Dynamics and the Jacobian of what is fixed to the flange are libfranka's; a state of our own carries the arguments.
    Poses, the joints' Jacobians and the axes of body Jacobians come from the robot description, which must have the
    kinematics that libfranka got from the arm.

    Args:
        model: pylibfranka.Model.
        state: a pylibfranka.RobotState that nobody else uses; it is written to.
        kinematics: of the robot description.

    Raises:
        DescriptionError: the description is that of another arm.
    """

    def __init__(self, model: _Model, state: Any, kinematics: KdlFrankaModel) -> None:
        self._model, self._state, self._kinematics = model, state, kinematics
        for q in _PROBES:
            there = from_column_major(self._flange_jacobian(q, _IDENTITY), 7)
            apart = float(np.abs(there - kinematics.zero_jacobian(Frame.FLANGE, q)).max())
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
        """M(q)."""
        return self._model.mass(self._put(q, total))

    def coriolis(self, q: Floats, dq: Floats, total: Total) -> list[float]:
        """C(q, dq) dq."""
        state = self._put(q, total)
        state.dq = dq
        return self._model.coriolis(state)

    def gravity(self, q: Floats, total: Total, gravity_base: Floats) -> list[float]:
        """g(q)."""
        state = self._put(q, total)
        state.O_ddP_O = gravity_base
        return self._model.gravity(state)

    def _flange_jacobian(self, q: Floats, F_T_X: list[float]) -> list[float]:
        """Of a frame fixed to the flange, which the state names as its end effector."""
        state = self._state
        state.q, state.F_T_EE = q, F_T_X
        return self._model.zero_jacobian(state)

    def _pose(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray:
        F_T_X = _beyond_flange(frame, F_T_EE, EE_T_K)
        return self._kinematics.pose(frame, q) if F_T_X is None else self._kinematics.pose(Frame.FLANGE, q) @ F_T_X

    def _jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray:
        F_T_X = _beyond_flange(frame, F_T_EE, EE_T_K)
        if F_T_X is None:
            return self._kinematics.zero_jacobian(frame, q)
        return from_column_major(self._flange_jacobian(q, column_major(F_T_X)), 7)

    def pose(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """T_base_frame."""
        return column_major(self._pose(frame, q, F_T_EE, EE_T_K))

    def zero_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in base axes."""
        return column_major(self._jacobian(frame, q, F_T_EE, EE_T_K))

    def body_jacobian(self, frame: Frame, q: Floats, F_T_EE: list[float], EE_T_K: list[float]) -> list[float]:
        """Jacobian in the frame's own axes."""
        R_frame_base = self._pose(frame, q, F_T_EE, EE_T_K)[:3, :3].T
        zero = self._jacobian(frame, q, F_T_EE, EE_T_K)
        return column_major(np.vstack([R_frame_base @ zero[:3], R_frame_base @ zero[3:]]))


_IDENTITY = column_major(np.eye(4))


def _beyond_flange(frame: Frame, F_T_EE: list[float], EE_T_K: list[float]) -> FloatArray | None:
    """Pose in the flange frame of a frame that is fixed to it, shape (4); None for the joints."""
    if frame is Frame.FLANGE:
        return np.eye(4)
    if frame is Frame.END_EFFECTOR:
        return from_column_major(F_T_EE)
    return from_column_major(F_T_EE) @ from_column_major(EE_T_K) if frame is Frame.STIFFNESS else None
