"""Positions, orientations and the two conventions for the vertical axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from mocap_natnet.codec.types import Quaternion, Vector

ORIGIN: Vector = (0.0, 0.0, 0.0)
IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)
UP_AXES = ("y", "z")
"""Motive streams y up by default, z up on request."""


class Pose(NamedTuple):
    """Position [m] and orientation (unit quaternion x, y, z, w) of a frame in another."""

    position: Vector = ORIGIN
    orientation: Quaternion = IDENTITY


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The quaternion of the rotation b followed by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """A vector turned by a unit quaternion: v + 2 w (u x v) + 2 u x (u x v), with u its vector part."""
    x, y, z, w = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx


def transform(pose: Pose, point: Vector) -> Vector:
    """A point of the frame, in the frame that the pose is given in."""
    x, y, z = rotate(pose.orientation, point)
    return pose.position[0] + x, pose.position[1] + y, pose.position[2] + z


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """T_a_c."""
    return Pose(transform(T_a_b, T_b_c.position), multiply(T_a_b.orientation, T_b_c.orientation))


def from_rotation_vector(rotation: Sequence[float]) -> Quaternion:
    """The quaternion of a rotation vector (axis times angle) [rad]."""
    x, y, z = rotation
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return (x / 2, y / 2, z / 2, 1.0)
    factor = math.sin(angle / 2) / angle
    return (x * factor, y * factor, z * factor, math.cos(angle / 2))


def normalized(q: Sequence[float]) -> Quaternion:
    """A unit quaternion. Raises ZeroDivisionError for zero."""
    x, y, z, w = q
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return (x / norm, y / norm, z / norm, w / norm)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Angle of the rotation from one orientation to the other [rad], 0 to pi."""
    x, y, z, w = multiply((-a[0], -a[1], -a[2], a[3]), b)
    return 2 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w))


def z_up(up: str, v: Vector) -> Vector:
    """A vector of the stream in axes with z up: (x, -z, y) where y is up (thesis eq. of chapter 3.3: +90 degrees about x)."""
    return v if up == "z" else (v[0], -v[2], v[1])


def stream_axes(up: str, v: Vector) -> Vector:
    """The other direction of `z_up`."""
    return v if up == "z" else (v[0], v[2], -v[1])


def pose_z_up(up: str, pose: Pose) -> Pose:
    """A pose of the stream in axes with z up.

    World and body axes are renamed alike (the vector part is mapped: q' = A q A^-1), as Motive does when the setting is changed, so that a body that
    is aligned with the world stays aligned.
    """
    if up == "z":
        return pose
    (px, py, pz), (x, y, z, w) = pose
    return Pose((px, -pz, py), (x, -z, y, w))


def pose_stream_axes(up: str, pose: Pose) -> Pose:
    """The other direction of `pose_z_up`."""
    if up == "z":
        return pose
    (px, py, pz), (x, y, z, w) = pose
    return Pose((px, pz, -py), (x, z, -y, w))
