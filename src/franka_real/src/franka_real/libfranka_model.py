"""Dynamic model of the arm by libfranka, with the kinematics and masses that the connected arm reports."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from franka_hw_interface.kdl_chain import GRAVITY
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame, Vector
from franka_hw_interface.transforms import check_load, check_transform, column_major, from_column_major
from franka_real.model_functions import Fr3Functions, ModelFunctions, PandaFunctions, Total
from hric_core.errors import CommandError, UnknownNameError
from hric_core.geometry import FloatArray, MassProperties

JOINTS = 7
STATE_FIELDS = ("m_ee", "F_x_Cee", "I_ee", "m_load", "F_x_Cload", "I_load", "F_T_EE", "EE_T_K")
"""Fields of the arm's state that belong to the model."""


class LibfrankaModel:
    """Implementation of `FrankaModel` by libfranka.

    End effector, payload and frames are those of the arm's state, until a setter replaces them. The setters change this
    model alone, not the arm.

    One instance serves one thread; the setters may be called from another.

    Args:
        functions: model functions of libfranka's binding.
        state: state of the arm (libfranka's or a RobotState) with end effector, payload and frames.
        gravity_base: gravity in the base frame, 3 floats [m/s^2]. The FR3's state has it (O_ddP_O), the Panda's does
            not.
    """

    def __init__(self, functions: ModelFunctions, state: Any, gravity_base: Sequence[float] = GRAVITY) -> None:
        self._functions = functions
        self.revision = 0
        self.gravity_base: FloatArray = np.array(_gravity(gravity_base))
        """Gravity in the base frame, shape (3,) [m/s^2]."""
        self.ee_inertial, self.load = MassProperties(), MassProperties()
        """Mass properties of everything mounted at the flange, and of the payload, in the flange frame."""
        self.F_T_EE, self.EE_T_K = np.eye(4), np.eye(4)
        self.gravity_list: Callable[[Sequence[float]], list[float]]
        self._followed: dict[str, object] = {}
        self.follow(state)

    @classmethod
    def for_panda(cls, model: Any, state: Any, gravity_base: Sequence[float] = GRAVITY) -> "LibfrankaModel":
        """Return the model of a Panda.

        Args:
            model: result of `panda_py.libfranka.Robot.load_model`.
            state: state of the arm with end effector, payload and frames.
            gravity_base: gravity in the base frame, 3 floats [m/s^2].
        """
        return cls(PandaFunctions(model), state, gravity_base)

    @classmethod
    def for_fr3(
        cls, model: Any, state: Any, urdf_xml: str, arm_id: str, gravity_base: Sequence[float] | None = None
    ) -> "LibfrankaModel":
        """Return the model of an FR3.

        Args:
            model: result of `pylibfranka.Robot.load_model`.
            state: result of `pylibfranka.Robot.read_once` that nothing else uses, since the model modifies it.
            urdf_xml: robot description, for functions that pylibfranka lacks.
            arm_id: prefix of the links.
            gravity_base: gravity in the base frame, 3 floats [m/s^2]; None: O_ddP_O of the state.

        Raises:
            DescriptionError, UnknownNameError: the robot description does not fit the connected arm.
        """
        reported = {name: getattr(state, name) for name in (*STATE_FIELDS, "O_ddP_O")}
        functions = Fr3Functions(model, state, KdlFrankaModel(urdf_xml, arm_id))
        return cls(
            functions, SimpleNamespace(**reported), reported["O_ddP_O"] if gravity_base is None else gravity_base
        )

    def follow(self, state: Any) -> bool:
        """Copy end effector, payload and frames from a state of the arm; return True if anything has changed.

        Args:
            state: libfranka's state or a RobotState.

        Raises:
            CommandError: a payload or a frame in the state is invalid; the model does not change.
        """
        reported = {name: getattr(state, name) for name in STATE_FIELDS}
        if reported == self._followed:
            return False
        ee, load = (
            _reported_body(reported[f"m_{name}"], reported[f"F_x_C{name}"], reported[f"I_{name}"], name)
            for name in ("ee", "load")
        )
        F_T_EE, EE_T_K = (check_transform(reported[name], name) for name in ("F_T_EE", "EE_T_K"))
        self._followed = {
            name: list(value) if isinstance(value, Sequence) else value for name, value in reported.items()
        }
        self.ee_inertial, self.F_T_EE, self.EE_T_K = ee, F_T_EE, EE_T_K
        self._use(load)
        return True

    def _use(self, load: MassProperties) -> None:
        self.load = load
        self._total = total = Total.of(self.total_inertial)
        gravity, down = self._functions.gravity, self.gravity_base.tolist()
        self._F_T_EE, self._EE_T_K = column_major(self.F_T_EE), column_major(self.EE_T_K)
        self.gravity_list = lambda q: gravity(q, total, down)
        self.revision += 1

    @property
    def total_inertial(self) -> MassProperties:
        """Mass properties of end effector and payload together, in the flange frame."""
        return self.ee_inertial + self.load

    def set_load(self, mass: float, com: Vector, inertia: Vector) -> None:
        """Set the payload.

        Args:
            mass: mass of the payload [kg].
            com: centre of mass in the flange frame, shape (3,) [m].
            inertia: inertia about the centre of mass, axes of the flange frame, 9 values [kg m^2].

        Raises:
            CommandError: not a valid payload; the old one remains.
        """
        self._use(check_load(mass, com, inertia))

    def set_ee(self, F_T_EE: FloatArray) -> None:
        """Set the end effector in the flange frame, shape (4, 4). Raises CommandError if it is not a pose."""
        self.F_T_EE = check_transform(column_major(np.asarray(F_T_EE)), "F_T_EE")
        self._use(self.load)

    def set_stiffness_frame(self, EE_T_K: FloatArray) -> None:
        """Set the stiffness frame in the end-effector frame, shape (4, 4). Raises CommandError if it is not a pose."""
        self.EE_T_K = check_transform(column_major(np.asarray(EE_T_K)), "EE_T_K")
        self._use(self.load)

    def mass(self, q: Vector) -> FloatArray:
        """Return the mass matrix without rotor inertia, shape (7, 7) [kg m^2]; q: shape (7,) [rad]."""
        return from_column_major(self._functions.mass(_joints(q, "joint position"), self._total), JOINTS)

    def coriolis(self, q: Vector, dq: Vector) -> FloatArray:
        """Return the vector C(q, dq) dq, shape (7,) [N m]; dq: shape (7,) [rad/s]."""
        return np.array(
            self._functions.coriolis(_joints(q, "joint position"), _joints(dq, "joint velocity"), self._total)
        )

    def gravity(self, q: Vector, gravity_base: Sequence[float] | None = None) -> FloatArray:
        """Return the torque against gravity, shape (7,) [N m]; gravity_base: in the base frame, 3 floats [m/s^2]."""
        down = self.gravity_base.tolist() if gravity_base is None else _gravity(gravity_base)
        return np.array(self._functions.gravity(_joints(q, "joint position"), self._total, down))

    def pose(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return T_base_frame, shape (4, 4)."""
        return from_column_major(
            self._functions.pose(_frame(frame), _joints(q, "joint position"), self._F_T_EE, self._EE_T_K)
        )

    def zero_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""
        return from_column_major(
            self._functions.zero_jacobian(_frame(frame), _joints(q, "joint position"), self._F_T_EE, self._EE_T_K),
            JOINTS,
        )

    def body_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the frame itself, linear above angular, shape (6, 7)."""
        return from_column_major(
            self._functions.body_jacobian(_frame(frame), _joints(q, "joint position"), self._F_T_EE, self._EE_T_K),
            JOINTS,
        )


def _joints(values: Vector, what: str) -> list[float]:
    plain: list[float] = values.tolist() if isinstance(values, np.ndarray) else list(values)
    if len(plain) != JOINTS:
        raise CommandError(f"{what} has {len(plain)} values for {JOINTS} joints")
    return plain


def _gravity(values: Sequence[float]) -> list[float]:
    plain = [float(value) for value in values]
    if len(plain) != 3 or not np.isfinite(plain).all():
        raise CommandError(f"gravity must be three finite numbers; got {plain}")
    return plain


def _frame(frame: FrankaFrame) -> FrankaFrame:
    if not isinstance(frame, FrankaFrame):
        raise UnknownNameError("frame", frame, [f"Frame.{item.name}" for item in FrankaFrame], "LibfrankaModel")
    return frame


def _reported_body(mass: float, com: Sequence[float], inertia: Sequence[float], name: str) -> MassProperties:
    """Return mass properties that the arm reports, e.g. of its payload, without a check of the principal moments.

    The arm may round the inertia to single precision, so that a principal moment of zero becomes negative.
    """
    tensor = np.array(inertia, dtype=float).reshape(3, 3)
    body = MassProperties(float(mass), np.array(com, dtype=float), 0.5 * (tensor + tensor.T))
    if not (
        np.isfinite(body.mass) and np.isfinite(body.com).all() and np.isfinite(body.inertia).all() and body.mass >= 0.0
    ):
        raise CommandError(
            f"the arm reports an impossible m_{name} {mass}, F_x_C{name} {list(com)} or I_{name} {list(inertia)}"
        )
    return body
