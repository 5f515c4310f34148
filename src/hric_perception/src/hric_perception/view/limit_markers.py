"""Limits as markers for rviz: a ring about each joint with its range, a hand that stands at its position, words where a limit is near. No node."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from scipy.spatial.transform import Rotation
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from hric_control import stamps, urdf
from hric_control.joint_limits import JointLimits
from hric_perception.view import nearness
from hric_perception.view.nearness import Level, Nearness, Wall

COLOURS = {Level.FAR: (0.25, 0.55, 0.35, 0.55), Level.NEAR: (0.95, 0.65, 0.1, 0.95), Level.AT: (0.85, 0.1, 0.1, 1.0)}
"""Green, amber, red: red, green, blue, alpha. The constants of this file are our choice."""
RADIUS = 0.12
"""Of a ring, outside of the links [m]."""
STEP = math.radians(7.5)
"""Between the points of a ring [rad]."""
LINE, HAND, TEXT = 0.004, 0.012, 0.035
"""Width of the ring and of the hand, height of letters [m]."""
LIFETIME = 1.0
"""A hand, words and walls vanish so long after the last one [s]; rings after RING_LIFETIME."""
RING_LIFETIME = 5.0


@dataclass(frozen=True)
class JointPlace:
    """A revolute joint of the description.

    Attributes:
        limits: its limits.
        parent: link to which its ring is fixed.
        p: origin in the parent, shape (3,) [m].
        R: from the ring's axes (z: the joint's axis; x: position 0) to the parent's, shape (3, 3).
    """

    limits: JointLimits
    parent: str
    p: tuple[float, float, float]
    R: Rotation

    @property
    def pose(self) -> Any:
        """geometry_msgs/Pose of the ring in the parent."""
        return Pose(Point(*self.p), Quaternion(*self.R.as_quat()))


def places(description: str, limits: Mapping[str, JointLimits]) -> dict[str, JointPlace]:
    """The joints that turn within a range, by name; others have no ring.

    Args:
        description: URDF.
        limits: by the name of the joint.

    Raises:
        HricError: the description cannot be read.
    """
    found = {}
    for name, joint in urdf.joints(urdf.parse(description)).items():
        if name in limits and joint.get("type") == "revolute" and math.isfinite(limits[name].lower) and math.isfinite(limits[name].upper):
            found[name] = _place(name, joint, limits[name])
    return found


def _place(name: str, joint: ElementTree.Element, limits: JointLimits) -> JointPlace:
    parent, origin, axis = joint.find("parent"), joint.find("origin"), joint.find("axis")
    p = _vector(origin, "xyz", (0.0, 0.0, 0.0), name)
    rpy = _vector(origin, "rpy", (0.0, 0.0, 0.0), name)
    z = np.array(_vector(axis, "xyz", (1.0, 0.0, 0.0), name))
    turned, _ = Rotation.align_vectors([z], [[0.0, 0.0, 1.0]])
    return JointPlace(limits, "" if parent is None else parent.get("link", ""), p, Rotation.from_euler("xyz", rpy) * turned)


def _vector(element: ElementTree.Element | None, attribute: str, default: tuple[float, float, float], name: str) -> tuple[float, float, float]:
    text = "" if element is None else element.get(attribute, "")
    x, y, z = (urdf.as_number(word, f"joint {name}: {attribute}") for word in text.split()) if text else default
    return x, y, z


def ring(place: JointPlace, number: int) -> Any:
    """The range of a joint, its ends in the colours of what is near them; without a stamp, so that it is drawn at once."""
    low, high = place.limits.lower, place.limits.upper
    angles = np.linspace(low, high, max(2, round((high - low) / STEP) + 1))
    marker = _marker("limits/ranges", number, Marker.LINE_LIST, place.parent, RING_LIFETIME, LINE)
    marker.pose = place.pose
    for first, second in itertools.pairwise(angles):
        distance = min(0.5 * (first + second) - low, high - 0.5 * (first + second))
        _line(marker, _at(first, RADIUS), _at(second, RADIUS), nearness.of_distance(distance, nearness.NEAR_POSITION, nearness.AT_POSITION))
    for end in (low, high):
        _line(marker, _at(end, 0.9 * RADIUS), _at(end, 1.1 * RADIUS), Level.AT)
    return marker


def hand(place: JointPlace, number: int, q: float, near: Nearness) -> list[Any]:
    """Where a joint stands in its range, and in words what it is near to.

    Args:
        place: the joint.
        number: of the marker.
        q: position [rad].
        near: how near it is to which limits.
    """
    line = _marker("limits/positions", number, Marker.LINE_LIST, place.parent, LIFETIME, HAND)
    line.pose = place.pose
    _line(line, _at(q, 0.75 * RADIUS), _at(q, 1.15 * RADIUS), near.level)
    if not near.text:
        return [line]
    words = _marker("limits/words", number, Marker.TEXT_VIEW_FACING, place.parent, LIFETIME, 0.0)
    words.scale.z, words.color = TEXT, ColorRGBA(*COLOURS[near.level])
    words.pose.position = Point(*(np.array(place.p) + place.R.apply(_at(q, 1.6 * RADIUS))))
    words.text = f"{place.limits.name}: {near.text}"
    return [line, words]


def wall(found: Wall, lower: Sequence[float], upper: Sequence[float], frame: str) -> Any:
    """A side of the workspace, as a thin plate in the frame of the box."""
    marker = _marker("limits/workspace", 2 * found.axis + found.side, Marker.CUBE, frame, LIFETIME, 0.0)
    centre, size = [0.5 * (low + high) for low, high in zip(lower, upper, strict=True)], [high - low for low, high in zip(lower, upper, strict=True)]
    centre[found.axis], size[found.axis] = (upper if found.side else lower)[found.axis], LINE
    marker.pose.position = Point(*centre)
    marker.scale.x, marker.scale.y, marker.scale.z = size
    marker.color = ColorRGBA(*COLOURS[found.level][:3], 0.25)
    return marker


def _marker(namespace: str, number: int, kind: int, frame: str, lifetime: float, width: float) -> Any:
    marker = Marker(header=Header(frame_id=frame), ns=namespace, id=number, type=kind, action=Marker.ADD, frame_locked=True)
    marker.pose.orientation.w, marker.scale.x, marker.lifetime = 1.0, width, stamps.to_duration(lifetime)
    marker.color.a = 1.0
    return marker


def _at(angle: float, radius: float) -> tuple[float, float, float]:
    return radius * math.cos(angle), radius * math.sin(angle), 0.0


def _line(marker: Any, first: Sequence[float], second: Sequence[float], level: Level) -> None:
    marker.points += [Point(*first), Point(*second)]
    marker.colors += [ColorRGBA(*COLOURS[level])] * 2
