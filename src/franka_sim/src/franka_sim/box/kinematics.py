"""Compiled forward kinematics of the arm (pose and Jacobian together), and twists between poses.

KDL is not used here: reading the results from its Python containers alone takes longer than this computation.
"""

import math
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.native import load

_end_effector: Callable[..., list[float]] = load("hric_kinematics").end_effector
_placement: Callable[..., tuple[list[float], list[float]]] = load("hric_kinematics").place


@dataclass(frozen=True, slots=True)
class Placement:
    """Pose and Jacobian of a frame of the arm, in the base frame.

    Attributes:
        T: pose, 16 floats, column-major.
        columns: columns of the Jacobian of the frame's origin, linear above angular, 7 x 6 floats.
    """

    T: list[float]
    columns: list[float]

    def jacobian(self) -> FloatArray:
        """Return the Jacobian of the frame's origin in the base frame, shape (6, 7): axis x (p - origin) above axis."""
        return np.array(self.columns).reshape(7, 6).T


class ArmKinematics:
    """Kinematics of the model's arm, with the end effector and stiffness frame that `update` last read from the model.

    Attributes:
        arm: frames of the joints and the end effector, as the buffer that kinematics.c expects.

    Raises:
        DescriptionError: a joint does not rotate about the z axis of its frame.
    """

    def __init__(self, model: KdlFrankaModel) -> None:
        self._model = model
        for segment in model.chain.description.segments:
            if segment.kind != "revolute" or np.abs(np.asarray(segment.axis) - (0.0, 0.0, 1.0)).max() > 1e-12:
                raise DescriptionError(
                    f"the robot description: {segment.joint} must rotate about the z axis of its frame"
                )
        self._joints = [_numbers(segment.T_parent_joint) for segment in model.chain.description.segments]
        self.update()

    def update(self) -> None:
        """Read the end effector and stiffness frame from the model."""
        T_last_ee = np.asarray(self._model.chain.description.T_last_tip, dtype=float) @ self._model.F_T_EE
        self.arm, self._stiffness = self._with_tip(T_last_ee), self._with_tip(T_last_ee @ self._model.EE_T_K)

    def _with_tip(self, T_last_tip: FloatArray) -> "array[float]":
        return array("d", [x for frame in (*self._joints, _numbers(T_last_tip)) for x in frame])

    def pose(self, q: Sequence[float]) -> list[float]:
        """Return the pose of the end effector, 16 floats, column-major; q: 7 floats [rad]."""
        return _end_effector(self.arm, q)

    def end_effector(self, q: Sequence[float]) -> Placement:
        """Return pose and Jacobian of the end effector; q: 7 floats [rad]."""
        return Placement(*_placement(self.arm, q))

    def stiffness_frame(self, q: Sequence[float]) -> Placement:
        """Return pose and Jacobian of the stiffness frame; q: 7 floats [rad]."""
        return Placement(*_placement(self._stiffness, q))


def _numbers(T: FloatArray) -> tuple[float, ...]:
    """Return the three columns of the rotation, then the translation, of a 4x4 transform: 12 floats."""
    return tuple(np.asarray(T, dtype=float)[:3, :].T.ravel().tolist())


twist_between: Callable[[Sequence[float], Sequence[float], float], list[float]] = load("hric_kinematics").twist_between
"""Constant twist from one pose to another in one step: 6 floats, linear then angular, base axes [m/s], [rad/s].

Arguments: (T_from, T_to, time_step [s]), both poses 16 floats, column-major. The rotation vector is that of
R = R_to R_from': sin(angle) axis is half the sum of the cross products of the columns, 1 + 2 cos(angle) its trace.
For rotations above 90 degrees, which no step of a motion makes, the angle is correct but the axis is x.
"""


def moved(T: Sequence[float], twist: Sequence[float], time_step: float) -> list[float]:
    """Return the pose T, moved for one time step [s] with a constant twist: 16 floats, column-major.

    Rodrigues' formula rotates each column. twist: 6 floats, linear then angular, base axes [m/s], [rad/s].
    """
    rx, ry, rz = twist[3] * time_step, twist[4] * time_step, twist[5] * time_step
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    first = math.sin(angle) / angle if angle > 1e-12 else 1.0
    second = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 1e-12 else 0.5
    result: list[float] = []
    for k in (0, 4, 8):
        a, b, c = T[k], T[k + 1], T[k + 2]
        u, v, w = ry * c - rz * b, rz * a - rx * c, rx * b - ry * a
        result += (
            a + first * u + second * (ry * w - rz * v),
            b + first * v + second * (rz * u - rx * w),
            c + first * w + second * (rx * v - ry * u),
            0.0,
        )
    return [*result, *(T[k] + twist[k - 12] * time_step for k in (12, 13, 14)), 1.0]
