"""Forward kinematics of the arm on plain floats: pose and Jacobian at once, in less time than reading them from KDL's containers takes."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_kinematics import compiled
from hric_control.errors import DescriptionError

FloatArray = npt.NDArray[np.float64]
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where the arm's frames are, in the base frame.

    Attributes:
        axes, origins: of the seven joints [1], [m].
        T: pose of the frame asked for, 16 floats, column-major.
    """

    axes: list[Triple]
    origins: list[Triple]
    T: list[float]

    def jacobian(self) -> FloatArray:
        """Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7): axis x (p - origin) above axis, per joint."""
        px, py, pz = self.T[12], self.T[13], self.T[14]
        columns: list[float] = []
        for (a, b, c), (x, y, z) in zip(self.axes, self.origins, strict=True):
            u, v, w = px - x, py - y, pz - z
            columns += (b * w - c * v, c * u - a * w, a * v - b * u, a, b, c)
        return np.array(columns).reshape(7, 6).T


class ArmKinematics:
    """Kinematics of the model's arm; the end effector is the one that the model knows when `update` is called.

    Attributes:
        arm: the frames of the joints and the end effector, as kinematics.c takes them.

    Raises:
        DescriptionError: a joint does not turn about the z axis of its frame.
    """

    def __init__(self, model: KdlFrankaModel) -> None:
        self._model = model
        for segment in model.chain.description.segments:
            if segment.kind != "revolute" or np.abs(np.asarray(segment.axis) - (0.0, 0.0, 1.0)).max() > 1e-12:
                raise DescriptionError(f"the robot description: {segment.joint} must turn about the z axis of its frame")
        self._joints = [_numbers(segment.T_parent_joint) for segment in model.chain.description.segments]
        self._compiled = compiled()
        self.update()

    def update(self) -> None:
        """Take the model's end effector and stiffness frame."""
        T_last_ee = model_flange(self._model) @ self._model.F_T_EE
        self._end_effector, self._stiffness = _numbers(T_last_ee), _numbers(T_last_ee @ self._model.EE_T_K)
        self.arm = array("d", [x for frame in (*self._joints, self._end_effector) for x in frame])

    def pose(self, q: Sequence[float]) -> list[float]:
        """Pose of the end effector, 16 floats, column-major; q: 7 floats [rad]."""
        if self._compiled is None:
            return self._place(q, self._end_effector).T
        T: list[float] = self._compiled.end_effector(self.arm, q)
        return T

    def end_effector(self, q: Sequence[float]) -> Placement:
        """Joint axes and pose of the end effector; q: 7 floats [rad]."""
        return self._place(q, self._end_effector)

    def stiffness_frame(self, q: Sequence[float]) -> Placement:
        """Joint axes and pose of the stiffness frame; q: 7 floats [rad]."""
        return self._place(q, self._stiffness)

    def _place(self, q: Sequence[float], tip: tuple[float, ...]) -> Placement:
        # Columns of the rotation (x, y, z) and the origin p, carried from joint to joint: R <- R R_fixed Rz(q).
        x: Triple = (1.0, 0.0, 0.0)
        y: Triple = (0.0, 1.0, 0.0)
        z: Triple = (0.0, 0.0, 1.0)
        p: Triple = (0.0, 0.0, 0.0)
        axes: list[Triple] = []
        origins: list[Triple] = []
        for fixed, angle in zip(self._joints, q, strict=True):
            x, y, z, p = _carried(x, y, z, p, fixed)
            cos, sin = math.cos(angle), math.sin(angle)
            x, y = (
                (cos * x[0] + sin * y[0], cos * x[1] + sin * y[1], cos * x[2] + sin * y[2]),
                (cos * y[0] - sin * x[0], cos * y[1] - sin * x[1], cos * y[2] - sin * x[2]),
            )
            axes.append(z)
            origins.append(p)
        x, y, z, p = _carried(x, y, z, p, tip)
        return Placement(axes, origins, [*x, 0.0, *y, 0.0, *z, 0.0, *p, 1.0])


def _carried(x: Triple, y: Triple, z: Triple, p: Triple, fixed: tuple[float, ...]) -> tuple[Triple, Triple, Triple, Triple]:
    """Columns and origin of R R_fixed, p + R p_fixed; fixed: the columns of R_fixed, then p_fixed, 12 floats."""
    x0, x1, x2 = x
    y0, y1, y2 = y
    z0, z1, z2 = z
    a, b, c, d, e, f, g, h, i, u, v, w = fixed
    return (
        (a * x0 + b * y0 + c * z0, a * x1 + b * y1 + c * z1, a * x2 + b * y2 + c * z2),
        (d * x0 + e * y0 + f * z0, d * x1 + e * y1 + f * z1, d * x2 + e * y2 + f * z2),
        (g * x0 + h * y0 + i * z0, g * x1 + h * y1 + i * z1, g * x2 + h * y2 + i * z2),
        (p[0] + u * x0 + v * y0 + w * z0, p[1] + u * x1 + v * y1 + w * z1, p[2] + u * x2 + v * y2 + w * z2),
    )


def model_flange(model: KdlFrankaModel) -> FloatArray:
    """Pose of the flange in the last moving link, shape (4, 4)."""
    return np.asarray(model.chain.description.T_last_tip, dtype=float)


def _numbers(T: FloatArray) -> tuple[float, ...]:
    """The three columns of the rotation, then the translation: 12 floats."""
    return tuple(np.asarray(T, dtype=float)[:3, :].T.ravel().tolist())
