"""How near a joint is to what it must not pass. No ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from hric_control.joint_limits import JointLimits

NEAR_POSITION, AT_POSITION = 0.2, 0.05
"""Distance to the end of the range below which a joint is near it, or at it; our choice [rad]."""
NEAR_RATIO, AT_RATIO = 0.8, 0.95
"""Share of the velocity or effort limit above which a joint is near it, or at it; our choice [1]."""
NEAR_WALL, AT_WALL = 0.1, 0.02
"""Distance of the end effector to the border of its workspace, likewise; our choice [m]."""


class Level(IntEnum):
    """How near."""

    FAR = 0
    NEAR = 1
    AT = 2


@dataclass(frozen=True)
class Nearness:
    """How near something is to its limits.

    Attributes:
        level: of the nearest limit.
        text: which limits are near, for people; empty: none.
    """

    level: Level
    text: str


def of_distance(distance: float, near: float, at: float) -> Level:
    """Level of what is `distance` away; negative: beyond."""
    return Level.AT if distance < at else Level.NEAR if distance < near else Level.FAR


def of_joint(limits: JointLimits, q: float, dq: float, tau: float) -> Nearness:
    """Nearness of a revolute joint.

    Args:
        limits: its limits; infinite ones do not count.
        q, dq, tau: position, velocity, measured effort [rad, rad/s, N m]; NaN: not known.
    """
    found: list[tuple[Level, str]] = []
    for distance, end in ((q - limits.lower, "lower"), (limits.upper - q, "upper")):
        level = of_distance(distance, NEAR_POSITION, AT_POSITION)
        found.append((level, f"{distance:.2f} rad from its {end} end" if distance >= 0.0 else f"{-distance:.2f} rad beyond its {end} end"))
    for value, limit, what in ((dq, limits.velocity, "velocity"), (tau, limits.effort, "effort")):
        ratio = abs(value) / limit if limit > 0.0 else 0.0
        found.append((of_distance(1.0 - ratio, 1.0 - NEAR_RATIO, 1.0 - AT_RATIO), f"{100.0 * ratio:.0f} % of its {what}"))
    told = [(level, text) for level, text in found if level]
    return Nearness(max((level for level, _ in told), default=Level.FAR), ", ".join(text for _, text in told))


@dataclass(frozen=True)
class Wall:
    """A side of a workspace that the end effector is near to.

    Attributes:
        axis, side: 0 to 2 for x, y, z; 0: the lower side, 1: the upper one.
        level: how near.
    """

    axis: int
    side: int
    level: Level


def walls(lower: Sequence[float], upper: Sequence[float], p: Sequence[float]) -> list[Wall]:
    """The sides of a box that a point is near to.

    Args:
        lower, upper: corners, shape (3,) [m].
        p: position, shape (3,) [m].
    """
    found = []
    for axis in range(3):
        for side, distance in enumerate((p[axis] - lower[axis], upper[axis] - p[axis])):
            if level := of_distance(distance, NEAR_WALL, AT_WALL):
                found.append(Wall(axis, side, level))
    return found
