"""Conversion of poses between ROS messages (position, quaternion x y z w) and homogeneous matrices, with checks."""

import math
from typing import Any

from hric_core.errors import CommandError
from hric_core.geometry.poses import Pose
from hric_core.geometry.quaternions import IDENTITY, Quaternion, normalized
from hric_core.geometry.transforms import FloatArray, homogeneous, rotation_from_quaternion


def unit_quaternion(x: float, y: float, z: float, w: float) -> Quaternion:
    """Return a quaternion, whose norm must be 1 within 1 %, scaled to norm 1.

    Raises:
        CommandError: the norm is not 1 within 1 %.
    """
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) < 0.01:
        raise CommandError(f"orientation ({x:g}, {y:g}, {z:g}, {w:g}) is not a unit quaternion: its norm is {norm:g}")
    return x / norm, y / norm, z / norm, w / norm


def rotation(x: float, y: float, z: float, w: float) -> FloatArray:
    """Return the rotation matrix, shape (3, 3), of a quaternion; four zeros, as in an unset message, mean no rotation.

    Raises:
        CommandError: the norm is not 1 within 1 %.
    """
    return rotation_from_quaternion(unit_quaternion(x, y, z, w) if any((x, y, z, w)) else IDENTITY)


def matrix(pose: Any) -> FloatArray:
    """Return the homogeneous matrix, shape (4, 4), of a geometry_msgs/Pose.

    Raises:
        CommandError: a value is not finite, or the orientation is not a unit quaternion.
    """
    p, q = pose.position, pose.orientation
    return homogeneous(rotation(*finite("orientation", q.x, q.y, q.z, q.w)), finite("position", p.x, p.y, p.z))


def pose_of(message: Any) -> Pose:
    """Return a geometry_msgs/Pose as `Pose` with normalised quaternion; ZeroDivisionError if the quaternion is 0."""
    p, q = message.position, message.orientation
    return Pose((p.x, p.y, p.z), normalized((q.x, q.y, q.z, q.w)))


def finite(what: str, *values: float) -> list[float]:
    """Return the values if all are finite.

    Raises:
        CommandError: a value is NaN or infinite; the message begins with `what`.
    """
    if not all(math.isfinite(value) for value in values):
        raise CommandError(f"{what} is not finite: {', '.join(str(value) for value in values)}")
    return list(values)
