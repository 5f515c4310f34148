"""Rigid transforms and mass properties, for setting a model up; of these only the cross products are meant for the loop."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def rotation_from_rpy(rpy: Sequence[float]) -> FloatArray:
    """Rotation of URDF roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = (tuple(f(a) for a in rpy) for f in (math.sin, math.cos))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(R: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a rotation, shape (3, 3). At pitch = +-pi/2 the yaw is put at zero."""
    horizontal = math.hypot(R[0, 0], R[1, 0])
    if horizontal < 1e-12:
        return math.atan2(-R[1, 2], R[1, 1]), math.atan2(-R[2, 0], horizontal), 0.0
    return math.atan2(R[2, 1], R[2, 2]), math.atan2(-R[2, 0], horizontal), math.atan2(R[1, 0], R[0, 0])


def transform(xyz: Sequence[float], rpy: Sequence[float]) -> FloatArray:
    """Homogeneous transform of a URDF origin, shape (4, 4); xyz [m], rpy [rad]."""
    T = np.eye(4)
    T[:3, :3] = rotation_from_rpy(rpy)
    T[:3, 3] = xyz
    return T


def inverse(T: FloatArray) -> FloatArray:
    """Inverse of a rigid transform, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = T[:3, :3].T
    result[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return result


def quaternion_from_rotation(R: FloatArray) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w) of a rotation, shape (3, 3)."""
    # Of the four squared components the largest is taken as divisor, so that nothing is lost near half turns.
    squares = np.array([1 + R[0, 0] - R[1, 1] - R[2, 2], 1 - R[0, 0] + R[1, 1] - R[2, 2], 1 - R[0, 0] - R[1, 1] + R[2, 2], 1 + np.trace(R)])
    k = int(np.argmax(squares))
    s = math.sqrt(squares[k]) * 2.0
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, xz, yz = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    q = [(s * s / 4, xy, xz, x), (xy, s * s / 4, yz, y), (xz, yz, s * s / 4, z), (x, y, z, s * s / 4)][k]
    return (float(q[0] / s), float(q[1] / s), float(q[2] / s), float(q[3] / s))


def rotation_from_quaternion(q: Sequence[float]) -> FloatArray:
    """Rotation, shape (3, 3), of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a x b of two vectors, shape (3,); numpy's own takes twenty times as long for so few numbers."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def crossing(b: FloatArray) -> FloatArray:
    """The matrix S, shape (3, 3), with r S = r x b for rows r."""
    x, y, z = b.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of mass and inertia in one frame.

    Attributes:
        mass: [kg].
        com: centre of mass, shape (3,) [m].
        inertia: about the centre of mass, axes of the frame, shape (3, 3) [kg m^2]; need not be physical.
    """

    mass: float
    com: FloatArray
    inertia: FloatArray

    @classmethod
    def zero(cls) -> MassProperties:
        """Nothing."""
        return cls(0.0, np.zeros(3), np.zeros((3, 3)))

    def moved(self, T: FloatArray) -> MassProperties:
        """The same body seen from another frame; T: pose of this frame in the other, shape (4, 4)."""
        R = T[:3, :3]
        return MassProperties(self.mass, R @ self.com + T[:3, 3], R @ self.inertia @ R.T)

    def __add__(self, other: MassProperties) -> MassProperties:
        """Both bodies as one, by the parallel-axis theorem; exact, also for tensors that no real body has."""
        mass = self.mass + other.mass
        if other.mass == 0.0 and not other.inertia.any():
            return self
        if self.mass == 0.0 and not self.inertia.any():
            return other
        com = (self.mass * self.com + other.mass * other.com) / mass if mass > 0.0 else np.zeros(3)
        inertia = np.zeros((3, 3))
        for part in (self, other):
            d = part.com - com
            inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
        return MassProperties(mass, com, inertia)

    def principal(self) -> tuple[FloatArray, FloatArray]:
        """(moments, shape (3,) [kg m^2]; R, shape (3, 3)) with inertia = R diag(moments) R'.

        Of the equivalent orders of the axes, the one whose roll, pitch and yaw lose least to rounding is taken.
        """
        moments, axes = np.linalg.eigh(self.inertia)
        best: tuple[float, FloatArray, FloatArray] | None = None
        for order in itertools.permutations(range(3)):
            R = axes[:, order].copy()
            if np.linalg.det(R) < 0.0:
                R[:, 0] = -R[:, 0]
            if best is None or abs(R[2, 0]) < best[0] - 1e-9:
                best = (abs(float(R[2, 0])), moments[list(order)], R)
        assert best is not None
        return best[1], best[2]
