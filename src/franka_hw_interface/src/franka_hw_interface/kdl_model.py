"""Dynamics and kinematics of a Franka arm, computed by KDL from the URDF."""

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
import PyKDL

from franka_hw_interface.kdl_chain import GRAVITY, KdlChain, from_kdl_frame, from_kdl_jacobian, to_kdl_frame
from franka_hw_interface.model import FrankaFrame, Vector
from franka_hw_interface.transforms import check_load, check_transform, column_major
from franka_hw_interface.urdf_chain import chain_of
from hric_core.errors import DescriptionError, UnknownNameError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import inverse
from hric_core.urdf import read

JOINTS = 7
_JOINT_FRAMES = {FrankaFrame(f"joint{i}"): i for i in range(1, JOINTS + 1)}


class KdlFrankaModel:
    """Implementation of `FrankaModel` with kinematics, masses and mounting from the URDF.

    The hand: libfranka reads the end effector's mass from the robot's settings; here everything that the URDF fixes to
    the flange link `<arm_id>_link8` is part of the model from the start and is reported as `ee_inertial`. The payload
    of `set_load` is added. The nominal end effector F_T_NE is the pose of `<arm_id>_hand_tcp` if the URDF has that
    link, otherwise the flange; F_T_EE has the same initial value.

    Gravity is `gravity_world` in the frame of the URDF's first link; a tilted mounting of the base is considered.

    One instance serves one thread; the setters may be called from another.

    Args:
        urdf_xml: robot description (pure URDF).
        arm_id: prefix of the links.
        root: base link; `<arm_id>_link0` by default.
        gravity_world: gravity in the frame of the URDF's first link, 3 floats [m/s^2].

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such arm.
    """

    def __init__(
        self, urdf_xml: str, arm_id: str, root: str | None = None, gravity_world: Sequence[float] = GRAVITY
    ) -> None:
        base, flange, tcp = root or f"{arm_id}_link0", f"{arm_id}_link8", f"{arm_id}_hand_tcp"
        self.chain = KdlChain(urdf_xml, base, flange, gravity_world)
        if self.chain.n != JOINTS:
            raise DescriptionError(
                f"the robot description: {self.chain.n} moving joints between {base} and {flange}; a Franka arm has "
                f"{JOINTS}"
            )
        self.arm_id, self.joint_names = arm_id, self.chain.joint_names
        self.revision = 0
        self.ee_inertial = self.chain.description.tip_inertial
        """Mass properties of everything that the URDF fixes to the flange, in the flange frame."""
        self.load = MassProperties()
        """Payload of `set_load`, in the flange frame."""
        self.F_T_NE = _tip_pose(urdf_xml, base, flange, tcp)
        """Nominal end effector in the flange frame, shape (4, 4)."""
        self.F_T_EE, self.EE_T_K = self.F_T_NE.copy(), np.eye(4)
        self.gravity_list: Callable[[Sequence[float]], list[float]] = self.chain.gravity_list
        self._update_frames()

    def __copy__(self) -> "KdlFrankaModel":
        """Return a model whose setters do not change this one."""
        other = object.__new__(KdlFrankaModel)
        other.__dict__.update(self.__dict__, chain=copy(self.chain))
        return other

    def _update_frames(self) -> None:
        flange = self.chain.T_last_tip
        end_effector = flange * to_kdl_frame(self.F_T_EE)
        offsets = {
            FrankaFrame.FLANGE: flange,
            FrankaFrame.END_EFFECTOR: end_effector,
            FrankaFrame.STIFFNESS: end_effector * to_kdl_frame(self.EE_T_K),
        }
        self._points = {frame: list(offset.p) for frame, offset in offsets.items()}
        self._frames: dict[FrankaFrame, tuple[int, PyKDL.Frame | None]] = {
            **{frame: (i, None) for frame, i in _JOINT_FRAMES.items()},
            **{frame: (JOINTS, offset) for frame, offset in offsets.items()},
        }
        self.revision += 1

    @property
    def gravity_base(self) -> FloatArray:
        """Gravity in the base frame, shape (3,) [m/s^2]."""
        return self.chain.gravity_base

    @property
    def total_inertial(self) -> MassProperties:
        """Mass properties of end effector and payload together, in the flange frame."""
        return self.ee_inertial + self.load

    def set_load(self, mass: float, com: Vector, inertia: Vector) -> None:
        """Set the payload.

        Args:
            mass: mass of the payload [kg].
            com: F_x_Cload, centre of mass in the flange frame, shape (3,) [m].
            inertia: I_load, about the centre of mass, axes of the flange frame, 9 values [kg m^2].

        Raises:
            CommandError: not a valid payload; the old one remains.
        """
        load = check_load(mass, com, inertia)
        self.chain.set_load(load)
        self.load, self.gravity_list = load, self.chain.gravity_list
        self.revision += 1

    def set_ee(self, F_T_EE: FloatArray) -> None:
        """Set the end effector in the flange frame, shape (4, 4). Raises CommandError if it is not a pose."""
        self.F_T_EE = check_transform(column_major(np.asarray(F_T_EE)), "F_T_EE")
        self._update_frames()

    def set_stiffness_frame(self, EE_T_K: FloatArray) -> None:
        """Set the stiffness frame in the end-effector frame, shape (4, 4). Raises CommandError if it is not a pose."""
        self.EE_T_K = check_transform(column_major(np.asarray(EE_T_K)), "EE_T_K")
        self._update_frames()

    def mass(self, q: Vector) -> FloatArray:
        """Return the mass matrix without rotor inertia, shape (7, 7) [kg m^2]; q: shape (7,) [rad]."""
        return self.chain.mass(q)

    def coriolis(self, q: Vector, dq: Vector) -> FloatArray:
        """Return the vector C(q, dq) dq, shape (7,) [N m]; dq: shape (7,) [rad/s]."""
        return self.chain.coriolis(q, dq)

    def gravity(self, q: Vector, gravity_base: Sequence[float] | None = None) -> FloatArray:
        """Return the torque against gravity, shape (7,) [N m]; gravity_base: in the base frame, 3 floats [m/s^2]."""
        return self.chain.gravity(q, gravity_base)

    def _frame(self, frame: FrankaFrame) -> tuple[int, PyKDL.Frame | None]:
        if frame not in self._frames:
            raise UnknownNameError("frame", frame, [f"Frame.{item.name}" for item in FrankaFrame], "KdlFrankaModel")
        return self._frames[frame]

    def _kdl_pose(self, frame: FrankaFrame, q: Vector) -> PyKDL.Frame:
        segments, offset = self._frame(frame)
        pose = self.chain.kdl_pose(q, segments)
        return pose if offset is None else pose * offset

    def pose(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return T_base_frame, shape (4, 4)."""
        return from_kdl_frame(self._kdl_pose(frame, q))

    def _kdl_jacobian(self, frame: FrankaFrame, q: Vector) -> PyKDL.Jacobian:
        segments, offset = self._frame(frame)
        jacobian = self.chain.kdl_jacobian(q, segments)
        if offset is not None:
            jacobian.changeRefPoint(self.chain.kdl_pose(q, segments).M * offset.p)
        return jacobian

    def zero_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""
        segments, _ = self._frame(frame)
        return self.chain.point_jacobian(q, segments, self._points.get(frame))

    def body_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the frame itself, linear above angular, shape (6, 7)."""
        jacobian = self._kdl_jacobian(frame, q)
        jacobian.changeBase(self._kdl_pose(frame, q).M.Inverse())
        return from_kdl_jacobian(jacobian, self.chain.jacobian_indices)


def _tip_pose(urdf_xml: str, base: str, flange: str, tcp: str) -> FloatArray:
    """Return the pose of the link `tcp` in the flange frame, shape (4, 4); identity if the URDF has no such link."""
    robot = read(urdf_xml)
    if tcp not in robot.links:
        return np.eye(4)
    return inverse(chain_of(robot, base, flange).T_last_tip) @ chain_of(robot, base, tcp).T_last_tip
