"""Poses between messages (position and quaternion x y z w) and homogeneous matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hric_control.errors import CommandError
from hric_control.plant import FloatArray


def rotation(x: float, y: float, z: float, w: float) -> FloatArray:
    """Rotation matrix, shape (3, 3), of a quaternion; all zeros count as no rotation, as an unset message has them.

    Raises:
        CommandError: the norm is not 1 within 1 %.
    """
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm == 0.0:
        return np.eye(3)
    if not abs(norm - 1.0) < 0.01:
        raise CommandError(f"orientation ({x:g}, {y:g}, {z:g}, {w:g}) is not a unit quaternion: its norm is {norm:g}")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(R: FloatArray) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w), w >= 0, of a rotation matrix of shape (3, 3).

    The largest component is found first, so that no case is badly conditioned.
    """
    trace = float(np.trace(R))
    squares = [1.0 + 2.0 * float(R[i, i]) - trace for i in range(3)] + [1.0 + trace]
    k = int(np.argmax(squares))
    q = [0.0] * 4
    q[k] = 0.5 * math.sqrt(squares[k])
    s = 0.25 / q[k]
    off = [(R[2, 1], R[1, 2]), (R[0, 2], R[2, 0]), (R[1, 0], R[0, 1])]
    for i in range(4):
        if i == k:
            continue
        if k == 3 or i == 3:
            a, b = off[min(i, k)]
            q[i] = s * float(a - b)
        else:
            q[i] = s * float(R[i, k] + R[k, i])
    sign = -1.0 if q[3] < 0.0 else 1.0
    return sign * q[0], sign * q[1], sign * q[2], sign * q[3]


def matrix(pose: Any) -> FloatArray:
    """Homogeneous matrix, shape (4, 4), of a geometry_msgs/Pose.

    Raises:
        CommandError: a position that is not finite, or no unit quaternion.
    """
    T = np.eye(4)
    p, q = pose.position, pose.orientation
    T[:3, 3] = finite("position", p.x, p.y, p.z)
    T[:3, :3] = rotation(*finite("orientation", q.x, q.y, q.z, q.w))
    return T


def fill(pose: Any, T: FloatArray) -> None:
    """Write a homogeneous matrix, shape (4, 4), into a geometry_msgs/Pose."""
    pose.position.x, pose.position.y, pose.position.z = T[:3, 3].tolist()
    q = pose.orientation
    q.x, q.y, q.z, q.w = quaternion(T[:3, :3])


def fill_twist(twist: Any, values: FloatArray) -> None:
    """Write a twist, shape (6,), linear then angular, into a geometry_msgs/Twist."""
    twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z = values.tolist()


def finite(what: str, *values: float) -> list[float]:
    """The values, if all are finite.

    Raises:
        CommandError: naming `what`.
    """
    if not all(math.isfinite(value) for value in values):
        raise CommandError(f"{what} is not finite: {', '.join(str(value) for value in values)}")
    return list(values)
