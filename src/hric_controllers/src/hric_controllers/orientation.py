"""Rotations as unit quaternions (x, y, z, w), on plain floats: what a filter of orientations and a rotational spring need."""

from __future__ import annotations

import math

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b followed by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(q: Quaternion) -> Quaternion:
    """The rotation back."""
    return -q[0], -q[1], -q[2], q[3]


def rotation_vector(q: Quaternion) -> Vector:
    """Axis times angle of the shorter way, at most pi [rad]."""
    x, y, z, w = q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, w) / sine
    return scale * x, scale * y, scale * z


def from_rotation_vector(v: Vector) -> Quaternion:
    """The rotation about v by its length [rad]."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return scale * v[0], scale * v[1], scale * v[2], math.cos(0.5 * angle)


def difference(a: Quaternion, b: Quaternion) -> Vector:
    """Rotation vector that leads from b to a, in the axes in which both are expressed [rad]."""
    return rotation_vector(product(a, inverse(b)))


def towards(start: Quaternion, goal: Quaternion, share: float) -> Quaternion:
    """The part `share` (0 to 1) of the shorter way from start to goal (slerp)."""
    x, y, z = difference(goal, start)
    return product(from_rotation_vector((share * x, share * y, share * z)), start)
