"""Rotations as unit quaternions (x, y, z, w), and vectors, on plain floats."""

import math
from collections.abc import Sequence

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Quaternion x, y, z, w."""
IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the product a b: the rotation b followed by the rotation a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(q: Quaternion) -> Quaternion:
    """Return the inverse rotation."""
    return -q[0], -q[1], -q[2], q[3]


def normalized(q: Sequence[float]) -> Quaternion:
    """Return q divided by its norm. Raises ZeroDivisionError if q is zero."""
    x, y, z, w = q
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return x / norm, y / norm, z / norm, w / norm


def rotated(q: Quaternion, v: Vector) -> Vector:
    """Return the vector v after the rotation q: v + 2 w (u x v) + 2 u x (u x v), u the vector part of q."""
    x, y, z, w = q
    a, b, c = v
    u0, u1, u2 = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * u0 + y * u2 - z * u1, b + w * u1 + z * u0 - x * u2, c + w * u2 + x * u1 - y * u0


def rotation_vector(q: Quaternion) -> Vector:
    """Return the rotation vector of q: axis times angle of the shorter rotation, at most pi [rad]."""
    x, y, z, w = canonical(q)
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, w) / sine
    return scale * x, scale * y, scale * z


def from_rotation_vector(v: Sequence[float]) -> Quaternion:
    """Return the rotation about the axis v by the angle |v| [rad], as a unit quaternion."""
    x, y, z = v
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return scale * x, scale * y, scale * z, math.cos(0.5 * angle)


def difference(a: Quaternion, b: Quaternion) -> Vector:
    """Return the rotation vector from b to a, in the axes in which both are expressed [rad]."""
    return rotation_vector(product(a, inverse(b)))


def interpolated(start: Quaternion, goal: Quaternion, share: float) -> Quaternion:
    """Return the orientation at a fraction `share` (0 to 1) of the shorter rotation from start to goal (slerp)."""
    x, y, z = difference(goal, start)
    return product(from_rotation_vector((share * x, share * y, share * z)), start)


def from_elements(*R: float) -> Quaternion:
    """Return the unit quaternion of a rotation matrix given row by row, 9 floats; its largest component is positive.

    It is computed from that component (Shepperd 1978) for accuracy, and normalised if R is not quite orthonormal. The
    sign is not chosen so that w >= 0: w is about zero for a hand that points down, and noise would flip the sign.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = R
    diagonal = (1.0 + r00 - r11 - r22, 1.0 - r00 + r11 - r22, 1.0 - r00 - r11 + r22, 1.0 + r00 + r11 + r22)
    rows = (
        (diagonal[0], r10 + r01, r02 + r20, r21 - r12),
        (r10 + r01, diagonal[1], r21 + r12, r02 - r20),
        (r02 + r20, r21 + r12, diagonal[2], r10 - r01),
        (r21 - r12, r02 - r20, r10 - r01, diagonal[3]),
    )
    x, y, z, w = rows[diagonal.index(max(diagonal))]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return x / norm, y / norm, z / norm, w / norm


def canonical(q: Quaternion) -> Quaternion:
    """Return q or -q, which are the same rotation, with w >= 0."""
    return q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])


def is_rotation(x: Sequence[float], y: Sequence[float], z: Sequence[float], tolerance: float) -> bool:
    """Return True if three vectors are the columns (or rows) of a rotation: orthonormal, right-handed, without NaN."""
    (a, b, c), (d, e, f), (g, h, i) = x, y, z
    return (
        abs(a * a + b * b + c * c - 1.0) <= tolerance
        and abs(d * d + e * e + f * f - 1.0) <= tolerance
        and abs(g * g + h * h + i * i - 1.0) <= tolerance
        and abs(a * d + b * e + c * f) <= tolerance
        and abs(d * g + e * h + f * i) <= tolerance
        and abs(g * a + h * b + i * c) <= tolerance
        and (b * f - c * e) * g + (c * d - a * f) * h + (a * e - b * d) * i > 0.0
    )


def angular_velocity(v: Vector, rate: Vector) -> Vector:
    """Return the angular velocity of a rotation whose rotation vector v changes with `rate` [rad/s], in the axes of v.

    The left Jacobian of SO(3): w = rate + (1 - cos a)/a^2 v x rate + (a - sin a)/a^3 v x (v x rate), a = |v|
    (Chirikjian, "Stochastic Models, Information Theory, and Lie Groups", vol. 2, ch. 10).
    """
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if angle < 1e-4:
        first, second = 0.5, 1.0 / 6.0
    else:
        first, second = 2.0 * (math.sin(0.5 * angle) / angle) ** 2, (angle - math.sin(angle)) / angle**3
    once = cross(v, rate)
    twice = cross(v, once)
    x, y, z = (r + first * a + second * b for r, a, b in zip(rate, once, twice, strict=True))
    return x, y, z


def cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Return the cross product a x b of two vectors of 3 floats."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
