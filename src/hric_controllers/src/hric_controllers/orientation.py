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


def rotated(q: Quaternion, v: Vector) -> Vector:
    """The vector v after the rotation q."""
    x, y, z, w = q
    a, b, c = v
    u0, u1, u2 = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * u0 + y * u2 - z * u1, b + w * u1 + z * u0 - x * u2, c + w * u2 + x * u1 - y * u0


def angular_velocity(v: Vector, rate: Vector) -> Vector:
    """Angular velocity of a rotation whose rotation vector v changes with `rate` [rad/s], in the axes of v.

    The left Jacobian of SO(3): w = rate + (1 - cos a)/a^2 v x rate + (a - sin a)/a^3 v x (v x rate), a = |v|
    (Chirikjian, "Stochastic Models, Information Theory, and Lie Groups", vol. 2, ch. 10).
    """
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if angle < 1e-4:
        first, second = 0.5, 1.0 / 6.0
    else:
        first, second = 2.0 * (math.sin(0.5 * angle) / angle) ** 2, (angle - math.sin(angle)) / angle**3
    once = _cross(v, rate)
    twice = _cross(v, once)
    x, y, z = (r + first * a + second * b for r, a, b in zip(rate, once, twice, strict=True))
    return x, y, z


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
