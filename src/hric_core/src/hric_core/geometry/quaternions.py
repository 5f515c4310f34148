"""Rotations as unit quaternions (x, y, z, w), and vectors, on plain floats; most of it is compiled from C."""

import math
from collections.abc import Callable, Sequence

from hric_core.native import load

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Quaternion x, y, z, w."""
IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)
_built = load("hric_quaternions")

product: Callable[[Quaternion, Quaternion], Quaternion] = _built.product
"""Function (a, b) that returns the product a b: the rotation b followed by the rotation a."""
rotated: Callable[[Quaternion, Vector], Vector] = _built.rotated
"""Function (q, v) that returns the vector v after the rotation q: v + 2 w (u x v) + 2 u x (u x v), u the vector part of
q."""
rotation_vector: Callable[[Quaternion], Vector] = _built.rotation_vector
"""Function (q) that returns the rotation vector of q: axis times angle of the shorter rotation, at most pi [rad]."""
from_rotation_vector: Callable[[Sequence[float]], Quaternion] = _built.from_rotation_vector
"""Function (v) that returns the rotation about the axis v by the angle |v| [rad], as a unit quaternion."""
difference: Callable[[Quaternion, Quaternion], Vector] = _built.difference
"""Function (a, b) that returns the rotation vector from b to a, in the axes in which both are expressed [rad]."""
interpolated: Callable[[Quaternion, Quaternion, float], Quaternion] = _built.interpolated
"""Function (start, goal, share) that returns the orientation at a fraction `share` (0 to 1) of the shorter rotation
from start to goal (slerp)."""
from_elements: Callable[..., Quaternion] = _built.from_elements
"""Function that returns the unit quaternion of a rotation matrix given row by row, 9 floats; its largest component is
positive.

It is computed from that component (Shepperd 1978) for accuracy, and normalised if R is not quite orthonormal. The sign
is not chosen so that w >= 0: w is about zero for a hand that points down, and noise would flip the sign."""


def inverse(q: Quaternion) -> Quaternion:
    """Return the inverse rotation."""
    return -q[0], -q[1], -q[2], q[3]


def normalized(q: Sequence[float]) -> Quaternion:
    """Return q divided by its norm. Raises ZeroDivisionError if q is zero."""
    x, y, z, w = q
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
