"""Rotation matrices and homogeneous transforms as numpy arrays; only `cross` and `skew` suit the control loop."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hric_core.geometry import quaternions
from hric_core.geometry.quaternions import Quaternion

FloatArray = npt.NDArray[np.float64]

R_YUP_ZUP: FloatArray = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation of coordinates with z up into coordinates with y up, those of OpenSim's ground frame."""


def rotation_from_rpy(rpy: Sequence[float]) -> FloatArray:
    """Return the rotation of URDF roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = (tuple(f(a) for a in rpy) for f in (math.sin, math.cos))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(R: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad] of a rotation, shape (3, 3). At pitch = +-pi/2 the yaw is set to zero."""
    horizontal = math.hypot(R[0, 0], R[1, 0])
    if horizontal < 1e-12:
        return math.atan2(-R[1, 2], R[1, 1]), math.atan2(-R[2, 0], horizontal), 0.0
    return math.atan2(R[2, 1], R[2, 2]), math.atan2(-R[2, 0], horizontal), math.atan2(R[1, 0], R[0, 0])


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Return the rotation by an angle [rad] about a unit vector, shape (3,), by Rodrigues' formula; shape (3, 3)."""
    K = skew(axis)
    return np.eye(3) + (math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K)


def rotation_from_quaternion(q: Sequence[float]) -> FloatArray:
    """Return the rotation, shape (3, 3), of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(R: FloatArray) -> Quaternion:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation, shape (3, 3)."""
    return quaternions.canonical(quaternions.from_elements(*R.ravel().tolist()))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross product a x b of two vectors, shape (3,); `numpy.cross` takes twenty times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def skew(v: FloatArray) -> FloatArray:
    """Return the matrix S, shape (3, 3), with S r = v x r for columns r, and r S = r x v for rows r."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def vectors_z_up(up: str, vectors: FloatArray) -> FloatArray:
    """Return vectors, shape (..., 3), in axes with z up: (x, -z, y) if `up` is "y"."""
    return vectors if up == "z" else np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def homogeneous(R: FloatArray, p: Sequence[float] | FloatArray = (0.0, 0.0, 0.0)) -> FloatArray:
    """Return the transform of a rotation, shape (3, 3), and a translation, 3 numbers [m]; shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def transform_from_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> FloatArray:
    """Return the transform of a URDF origin, shape (4, 4); xyz [m], rpy [rad]."""
    return homogeneous(rotation_from_rpy(rpy), xyz)


def inverse(T: FloatArray) -> FloatArray:
    """Return the inverse of a rigid transform, shape (4, 4)."""
    return homogeneous(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


def rotation_onto(start: int, end: FloatArray) -> FloatArray:
    """Return a rotation matrix, shape (3, 3), that turns a coordinate axis onto the unit vector `end`, shape (3,).

    `start` is the number of the axis (0, 1, 2: x, y, z). If the angle between the two is at most 90 degrees, the result
    is the smallest rotation, R = E + [v] + [v]^2 / (1 + cos) with v = axis x end (Rodrigues). Otherwise a half turn
    about the next axis (for z: x, for x: y) is applied first, which keeps the denominator away from zero.
    """
    flip = np.diag([1.0 if i == (start + 1) % 3 else -1.0 for i in range(3)]) if end[start] < 0.0 else np.eye(3)
    begin = flip[:, start]
    v = skew(np.cross(begin, end))
    return np.asarray((np.eye(3) + v + v @ v / (1.0 + float(begin @ end))) @ flip)
