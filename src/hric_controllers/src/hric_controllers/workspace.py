"""Where the end effector may go, and how another frame lies to the robot's base. No ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hric_control.errors import HricError
from hric_controllers.orientation import Vector

Rows = tuple[Vector, Vector, Vector]
ORTHONORMAL = 1e-6
"""How far a rotation matrix may be from orthonormal: rounding in a YAML."""


@dataclass(frozen=True)
class Box:
    """Workspace of the end effector in the base: lower and upper corner [m].

    Raises:
        HricError: not finite, or a corner that is not below the other.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        good = all(math.isfinite(low) and math.isfinite(high) and low < high for low, high in zip(self.lower, self.upper, strict=True))
        if not good:
            raise HricError(f"workspace from {self.lower} to {self.upper}; valid: finite corners, the first below the second on each axis")

    def contains(self, p: Sequence[float]) -> bool:
        """Whether a point is inside or on the border."""
        return all(low <= x <= high for x, low, high in zip(p, self.lower, self.upper, strict=True))

    def nearest(self, p: Sequence[float]) -> Vector:
        """The point of the box that is nearest to a point."""
        x, y, z = (min(max(value, low), high) for value, low, high in zip(p, self.lower, self.upper, strict=True))
        return x, y, z

    def __str__(self) -> str:
        return ", ".join(f"{axis} {low:g} to {high:g}" for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)) + " m"


@dataclass(frozen=True)
class FrameRotation:
    """R_base_marker: turns vectors of a marker's frame into the base.

    Attributes:
        rows: three rows of three numbers.

    Raises:
        HricError: it is no rotation.
    """

    rows: Rows

    def __post_init__(self) -> None:
        x, y, z = self.rows
        dots = (_dot(x, x) - 1.0, _dot(y, y) - 1.0, _dot(z, z) - 1.0, _dot(x, y), _dot(y, z), _dot(z, x))
        cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
        # Written so that a NaN fails.
        if not (max(map(abs, dots)) <= ORTHONORMAL and _dot(cross, z) > 0.0):
            raise HricError(f"frame rotation {[list(row) for row in self.rows]}; valid: a rotation matrix, orthonormal rows and determinant 1")

    def turned(self, v: Sequence[float]) -> Vector:
        """R v."""
        x, y, z = self.rows
        return _dot(x, v), _dot(y, v), _dot(z, v)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
