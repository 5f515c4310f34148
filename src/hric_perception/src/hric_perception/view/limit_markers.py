"""Limits as markers for rviz: rings for joint ranges, pointers for positions, text near a limit. No node."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from scipy.spatial.transform import Rotation
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from hric_control.limits import JointLimits
from hric_core.robot_time import stamps
from hric_core.urdf import Joint, read

NEAR_POSITION, AT_POSITION = 0.2, 0.05
"""Distance from the end of a joint's range below which the joint is near that end, or at it [rad].

Project default, unconfirmed.
"""
NEAR_RATIO, AT_RATIO = 0.8, 0.95
"""Share of the velocity or effort limit above which a joint is near that limit, or at it [1].

Project default, unconfirmed.
"""
NEAR_WALL, AT_WALL = 0.1, 0.02
"""Distance to a face of the workspace below which the end effector is near it, or at it [m].

Project default, unconfirmed.
"""
RADIUS = 0.12
"""Radius of a ring, outside of the links [m]."""
STEP = math.radians(7.5)
"""Angle between the points of a ring [rad]."""
LINE, HAND, TEXT = 0.004, 0.012, 0.035
"""Line width of a ring and of a pointer, and height of letters [m]."""
LIFETIME = 1.0
"""Lifetime of pointers, texts and walls [s]; that of rings is RING_LIFETIME."""
RING_LIFETIME = 5.0


class Level(IntEnum):
    """Nearness of a value to a limit: far, near or at it."""

    FAR = 0
    NEAR = 1
    AT = 2


@dataclass(frozen=True)
class LimitNearness:
    """Nearness of a joint to its position, velocity and effort limits.

    Attributes:
        level: level of the nearest limit.
        text: list of the near limits for the user; empty: none is near.
    """

    level: Level
    text: str


def of_distance(distance: float, near: float, at: float) -> Level:
    """Return the nearness at a distance from a limit (negative: beyond it); near, at: thresholds in its unit."""
    return Level.AT if distance < at else Level.NEAR if distance < near else Level.FAR


def of_joint(limits: JointLimits, q: float, dq: float, tau: float) -> LimitNearness:
    """Return how near a revolute joint is to its limits.

    Args:
        limits: limits of the joint; infinite ones do not count.
        q: position [rad]; NaN: not known.
        dq: velocity [rad/s]; NaN: not known.
        tau: measured effort [N m]; NaN: not known.
    """
    levels: list[tuple[Level, str]] = []
    for distance, end in ((q - limits.lower, "lower"), (limits.upper - q, "upper")):
        level = of_distance(distance, NEAR_POSITION, AT_POSITION)
        levels.append(
            (
                level,
                f"{distance:.2f} rad from its {end} end"
                if distance >= 0.0
                else f"{-distance:.2f} rad beyond its {end} end",
            )
        )
    for value, limit, what in ((dq, limits.velocity, "velocity"), (tau, limits.effort, "effort")):
        ratio = abs(value) / limit if limit > 0.0 else 0.0
        levels.append(
            (of_distance(1.0 - ratio, 1.0 - NEAR_RATIO, 1.0 - AT_RATIO), f"{100.0 * ratio:.0f} % of its {what}")
        )
    near = [(level, text) for level, text in levels if level]
    return LimitNearness(max((level for level, _ in near), default=Level.FAR), ", ".join(text for _, text in near))


@dataclass(frozen=True)
class Wall:
    """Face of the box-shaped workspace that is near the end effector.

    Attributes:
        axis, side: axis normal to the face, 0 to 2 for x, y, z; side 0: lower face, 1: upper face.
        level: nearness of the end effector.
    """

    axis: int
    side: int
    level: Level


def walls(lower: Sequence[float], upper: Sequence[float], p: Sequence[float]) -> list[Wall]:
    """Return the faces of a box that are near a point.

    Args:
        lower: lower corner, shape (3,) [m].
        upper: upper corner, shape (3,) [m].
        p: position, shape (3,) [m].
    """
    return [
        Wall(axis, side, level)
        for axis in range(3)
        for side, distance in enumerate((p[axis] - lower[axis], upper[axis] - p[axis]))
        if (level := of_distance(distance, NEAR_WALL, AT_WALL))
    ]


COLOURS = {Level.FAR: (0.25, 0.55, 0.35, 0.55), Level.NEAR: (0.95, 0.65, 0.1, 0.95), Level.AT: (0.85, 0.1, 0.1, 1.0)}
"""Colours (red, green, blue, alpha) by nearness: green, amber, red.

The constants of this file are project defaults, unconfirmed.
"""


@dataclass(frozen=True)
class JointRing:
    """Ring that shows the range of a revolute joint.

    Attributes:
        limits: limits of the joint.
        parent: link to which the ring is fixed.
        p: centre of the ring in the parent, shape (3,) [m].
        R: rotation from the ring's axes (z: the joint's axis; x: position 0) to the parent's, shape (3, 3).
    """

    limits: JointLimits
    parent: str
    p: tuple[float, float, float]
    R: Rotation

    @property
    def pose(self) -> Any:
        """Pose of the ring in the frame of the parent link, a geometry_msgs/Pose."""
        return Pose(Point(*self.p), Quaternion(*self.R.as_quat()))


def rings(description: str, limits: Mapping[str, JointLimits]) -> dict[str, JointRing]:
    """Return a ring for each revolute joint with a finite range, by the joint's name.

    Args:
        description: URDF.
        limits: limits by the name of the joint.

    Raises:
        HricError: the description cannot be read.
    """
    turning = (
        (limits[name], joint)
        for name, joint in read(description).joints.items()
        if name in limits and joint.type == "revolute"
    )
    return {
        of.name: _ring_of(joint, of) for of, joint in turning if math.isfinite(of.lower) and math.isfinite(of.upper)
    }


def _ring_of(joint: Joint, limits: JointLimits) -> JointRing:
    R, (x, y, z) = Rotation.from_matrix(joint.T_parent_joint[:3, :3]), joint.T_parent_joint[:3, 3].tolist()
    turned, _ = Rotation.align_vectors([joint.axis], [[0.0, 0.0, 1.0]])
    return JointRing(limits, joint.parent, (x, y, z), R * turned)


def ring(joint_ring: JointRing, number: int) -> Any:
    """Return the marker of a ring with coloured ends; without a stamp, rviz draws it at the newest transform."""
    low, high = joint_ring.limits.lower, joint_ring.limits.upper
    angles = np.linspace(low, high, max(2, round((high - low) / STEP) + 1))
    marker = _marker("limits/ranges", number, Marker.LINE_LIST, joint_ring.parent, RING_LIFETIME, LINE)
    marker.pose = joint_ring.pose
    for first, second in itertools.pairwise(angles):
        distance = min(0.5 * (first + second) - low, high - 0.5 * (first + second))
        _line(
            marker,
            _at(first, RADIUS),
            _at(second, RADIUS),
            of_distance(distance, NEAR_POSITION, AT_POSITION),
        )
    for end in (low, high):
        _line(marker, _at(end, 0.9 * RADIUS), _at(end, 1.1 * RADIUS), Level.AT)
    return marker


def hand(joint_ring: JointRing, number: int, q: float, near: LimitNearness) -> list[Any]:
    """Return a pointer at a joint's position on its ring, and a text if limits are near.

    Args:
        joint_ring: ring of the joint.
        number: id of both markers.
        q: joint position [rad].
        near: nearness of the joint to its limits.
    """
    line = _marker("limits/positions", number, Marker.LINE_LIST, joint_ring.parent, LIFETIME, HAND)
    line.pose = joint_ring.pose
    _line(line, _at(q, 0.75 * RADIUS), _at(q, 1.15 * RADIUS), near.level)
    if not near.text:
        return [line]
    words = _marker("limits/words", number, Marker.TEXT_VIEW_FACING, joint_ring.parent, LIFETIME, 0.0)
    words.scale.z, words.color = TEXT, ColorRGBA(*COLOURS[near.level])
    words.pose.position = Point(*(np.array(joint_ring.p) + joint_ring.R.apply(_at(q, 1.6 * RADIUS))))
    words.text = f"{joint_ring.limits.name}: {near.text}"
    return [line, words]


def wall(face: Wall, lower: Sequence[float], upper: Sequence[float], frame: str) -> Any:
    """Return the marker of a workspace's face: a thin plate; lower, upper: corners of the box in `frame` [m]."""
    marker = _marker("limits/workspace", 2 * face.axis + face.side, Marker.CUBE, frame, LIFETIME, 0.0)
    centre, size = (
        [0.5 * (low + high) for low, high in zip(lower, upper, strict=True)],
        [high - low for low, high in zip(lower, upper, strict=True)],
    )
    centre[face.axis], size[face.axis] = (upper if face.side else lower)[face.axis], LINE
    marker.pose.position = Point(*centre)
    marker.scale.x, marker.scale.y, marker.scale.z = size
    marker.color = ColorRGBA(*COLOURS[face.level][:3], 0.25)
    return marker


def _marker(namespace: str, number: int, kind: int, frame: str, lifetime: float, width: float) -> Any:
    marker = Marker(
        header=Header(frame_id=frame), ns=namespace, id=number, type=kind, action=Marker.ADD, frame_locked=True
    )
    marker.pose.orientation.w, marker.scale.x, marker.lifetime = 1.0, width, stamps.to_duration(lifetime)
    marker.color.a = 1.0
    return marker


def _at(angle: float, radius: float) -> tuple[float, float, float]:
    return radius * math.cos(angle), radius * math.sin(angle), 0.0


def _line(marker: Any, first: Sequence[float], second: Sequence[float], level: Level) -> None:
    marker.points += [Point(*first), Point(*second)]
    marker.colors += [ColorRGBA(*COLOURS[level])] * 2
