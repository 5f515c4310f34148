"""Poses as lists: 16 floats, column-major, and their differences as twists (linear, then angular, both in the base frame)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from franka_sim.box.compiled_kinematics import compiled


def is_pose(T: Sequence[float], tolerance: float) -> bool:
    """Whether T is finite, its rotation orthonormal and right-handed, its last row 0 0 0 1; column-major, 16 floats."""
    if not all(map(math.isfinite, T)):
        return False
    if abs(T[3]) + abs(T[7]) + abs(T[11]) + abs(T[15] - 1.0) > tolerance:
        return False
    x, y, z = T[0:3], T[4:7], T[8:11]
    products = (_dot(x, x) - 1.0, _dot(y, y) - 1.0, _dot(z, z) - 1.0, _dot(x, y), _dot(y, z), _dot(z, x))
    return max(map(abs, products)) <= tolerance and _dot(_cross(x, y), z) > 0.0


def plain_twist_between(T_from: Sequence[float], T_to: Sequence[float], time_step: float) -> list[float]:
    """Constant twist that leads from one pose to the other in one step, 6 floats [m/s], [rad/s].

    The rotation vector of R = R_to R_from': sin(angle) axis is half the sum of the cross products of the columns, 1 + 2 cos(angle) its trace. Turns
    by more than 90 degrees, which no step of a motion makes, get the right angle but the axis x.
    """
    sx = sy = sz = trace = 0.0
    for k in (0, 4, 8):
        a, b, c = T_from[k], T_from[k + 1], T_from[k + 2]
        u, v, w = T_to[k], T_to[k + 1], T_to[k + 2]
        sx += b * w - c * v
        sy += c * u - a * w
        sz += a * v - b * u
        trace += a * u + b * v + c * w
    sine = 0.5 * math.sqrt(sx * sx + sy * sy + sz * sz)
    cosine = 0.5 * (trace - 1.0)
    linear = [(T_to[k] - T_from[k]) / time_step for k in (12, 13, 14)]
    angle = math.atan2(sine, cosine)
    if cosine < 0.0:
        return [*linear, angle / time_step, 0.0, 0.0]
    factor = 0.5 * (angle / sine if sine > 0.0 else 1.0) / time_step
    return [*linear, sx * factor, sy * factor, sz * factor]


twist_between: Callable[[Sequence[float], Sequence[float], float], list[float]] = getattr(compiled(), "twist_between", plain_twist_between)
"""`plain_twist_between`, by compiled code where there is any."""


def moved(T: Sequence[float], twist: Sequence[float], time_step: float) -> list[float]:
    """The pose one step of a constant twist later, 16 floats (Rodrigues' formula on each column)."""
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


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
