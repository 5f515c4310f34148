"""Collision detection for an OpenSim model: collision shapes, the pairs that may touch, and the pairs that touch.

A pair that is far apart is checked again only when the motion since the last check could have closed its gap.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_control.plants import faces
from hric_core.geometry import FloatArray
from hric_core.urdf import Robot
from hric_core.urdf.shapes import FAR
from opensim_ros_control.bodies import Kinematics
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.shapes import LinkShape, Pairing, Touch, pose

MARGIN = 2e-3
"""Distance below which two shapes are checked in every step [m] (project default, unconfirmed)."""
FLANK = 1e-6
"""Depth below which a corner of the contact area counts as not overlapping [m] (project default, unconfirmed)."""
AT_ONCE = 20.0
"""Number of steps: if any pair must be checked, pairs due within this many steps are checked together with it.

This saves computing poses several times (project default, unconfirmed).
"""


@dataclass
class Collider:
    """Collision shape of a link in the model.

    Attributes:
        link: "model::link" to which the shape belongs.
        model: name of the model.
        shape: collision shape in the link.
        mobile: OpenSim's number of the body to which the shape is fixed, 0 for ground.
        T_body_shape: pose in that body, shape (4, 4).
        moved_by: maximum travel of a point of the shape per change of each coordinate, shape (nq,) [m/rad or 1].
    """

    link: str
    model: str
    shape: LinkShape
    mobile: int
    T_body_shape: FloatArray
    moved_by: FloatArray


@dataclass
class Meeting:
    """Two colliders that touch or nearly touch, with their contact and contact points in the ground frame."""

    a: Collider
    b: Collider
    touch: Touch
    points: list[FloatArray]


def _path_per_change(a: Collider, b: Collider) -> FloatArray:
    """Return the maximum relative travel of two colliders per change of each coordinate, shape (nq,).

    A coordinate that moves both colliders does not move them relative to each other, and has 0.
    """
    apart = (a.moved_by > 0.0) != (b.moved_by > 0.0)
    return np.where(apart, a.moved_by + b.moved_by, 0.0)


class Collisions:
    """Detector of contact between the pairs of colliders that may touch.

    Args:
        pairs: pairs of colliders that may touch.
        nq: number of coordinates.
    """

    def __init__(self, pairs: Sequence[tuple[Collider, Collider]], nq: int) -> None:
        self.pairs = list(pairs)
        self._path = np.array([_path_per_change(a, b) for a, b in self.pairs]).reshape(len(self.pairs), nq)
        self._slack = np.full(len(self.pairs), -1.0)
        self._last: FloatArray | None = None
        self._pairing = Pairing(MARGIN)
        self._poses: dict[int, Any] = {}

    def near(self, q: FloatArray) -> list[int]:
        """Return the indices of the pairs that must be checked now or soon; q: all coordinates, shape (nq,)."""
        if not self.pairs:
            return []
        spent = np.zeros(1) if self._last is None else self._path @ np.abs(q - self._last)
        self._slack -= spent
        self._last = q
        return [] if self._slack.min() >= 0.0 else np.flatnonzero(self._slack < AT_ONCE * spent).tolist()

    def meetings(
        self, near: Sequence[int], body_pose: Callable[[int], FloatArray], areas: Callable[[Collider, Collider], bool]
    ) -> Iterator[Meeting]:
        """Yield the pairs that touch or nearly touch.

        Args:
            near: indices of the pairs to check, from `near`.
            body_pose: function that returns a body's pose in ground, shape (4, 4), by OpenSim's number.
            areas: function that returns True if the corners of a pair's contact area are needed.
        """
        self._poses.clear()
        for i in near:
            a, b = self.pairs[i]
            T_a, T_b = self._pose(a, body_pose), self._pose(b, body_pose)
            gap = self._pairing.distance(a.shape.geometry, T_a, b.shape.geometry, T_b)
            self._slack[i] = gap - MARGIN
            if gap >= MARGIN:
                continue
            touch = self._pairing.touch(a.shape.geometry, T_a, b.shape.geometry, T_b)
            if touch is not None:
                corners = self._pairing.patch(a.shape.geometry, T_a, b.shape.geometry, T_b) if areas(a, b) else []
                yield Meeting(a, b, touch, corners or touch.points)

    def depths(self, meeting: Meeting) -> list[tuple[FloatArray, float]]:
        """Return (point, depth [m]) of each contact point of a meeting that was yielded in this step."""
        if len(meeting.points) == 1:
            return [(meeting.points[0], meeting.touch.depth)]
        sides = [(c.shape.geometry, self._poses[id(c)]) for c in (meeting.a, meeting.b)]
        depths = [(point, -sum(self._pairing.beyond(point, *side) for side in sides)) for point in meeting.points]
        if meeting.touch.depth > FLANK and max(depth for _, depth in depths) < FLANK:
            return [(meeting.touch.points[0], meeting.touch.depth)]
        return depths

    def corners(self, meeting: Meeting, body_pose: Callable[[int], FloatArray]) -> list[faces.Corner]:
        """Return the corners of the overlap of two shapes, or their deepest point if there are none.

        body_pose: function that returns a body's pose in ground, shape (4, 4), by OpenSim's number.
        """
        a, b, touch = meeting.a, meeting.b, meeting.touch
        T_a, T_b = body_pose(a.mobile) @ a.T_body_shape, body_pose(b.mobile) @ b.T_body_shape
        return faces.corners(a.shape.solid, T_a, b.shape.solid, T_b, touch.normal, touch.points[0], touch.depth)

    def _pose(self, collider: Collider, body_pose: Callable[[int], FloatArray]) -> Any:
        key = id(collider)
        if key not in self._poses:
            self._poses[key] = pose(body_pose(collider.mobile) @ collider.T_body_shape)
        return self._poses[key]


def moved_by(description: Robot, link: str, reach: float, indices: Mapping[str, Sequence[int]], nq: int) -> FloatArray:
    """Return the maximum travel of a point of a link per change of each coordinate, shape (nq,) [m/rad or 1].

    Args:
        description: description of the complete model.
        link: name of the link.
        reach: distance of the point from the link's origin [m].
        indices: indices of each moving joint's coordinates in q; a floating joint has three angles first, a planar one
            an angle.
        nq: number of coordinates.
    """
    result = np.zeros(nq)
    above = {joint.child: joint for joint in description.joints.values()}
    while link in above:
        joint = above[link]
        angles = {"floating": 3, "planar": 1, "prismatic": 0, "fixed": 0}.get(joint.type, 1)
        for i, index in enumerate(indices.get(joint.name, ())):
            result[index] = reach if i < angles else 1.0
        free = {"floating": np.inf, "planar": np.inf, "prismatic": max(abs(joint.lower), abs(joint.upper))}.get(
            joint.type, 0.0
        )
        reach = min(reach + float(np.linalg.norm(joint.T_parent_joint[:3, 3])) + float(free), FAR)
        link = joint.parent
    return result


def make_colliders(
    description: Robot,
    shapes: Mapping[str, Sequence[LinkShape]],
    engine: OpenSimEngine,
    kinematics: Kinematics,
    indices: Mapping[str, Sequence[int]],
    robot: str,
) -> list[Collider]:
    """Return the colliders of all links that have collision shapes.

    Args:
        description: description of the complete model.
        shapes: collision shapes by link of the description.
        engine: engine with the model.
        kinematics: kinematics of the same engine.
        indices: indices of each moving joint's coordinates in q, as for `moved_by`.
        robot: name of the robot's model, to which links without "model::" belong.
    """
    result = []
    nq = engine.nu
    for link, of_link in shapes.items():
        number, T_body_link = kinematics.carrier(engine.frames[link])
        model = link.partition("::")[0] if "::" in link else robot
        for shape in of_link:
            reach = moved_by(description, link, shape.radius, indices, nq)
            full = link if "::" in link else f"{robot}::{link}"
            result.append(Collider(full, model, shape, number, T_body_link @ shape.T_link_shape, reach))
    return result


def colliding_pairs(
    description: Robot,
    colliders: Sequence[Collider],
    robot: str,
    exempt: Set[frozenset[str]],
    self_collision: bool,
    connected: Iterable[tuple[str, str]],
) -> list[tuple[Collider, Collider]]:
    """Return the pairs of colliders that may touch.

    These are colliders of different models, unless both are fixed, and of two links of the robot, unless these have a
    common joint or are masked (`exempt`). Links that a bushing connects do not touch.

    Args:
        description: description of the complete model.
        colliders: all colliders.
        robot: name of the robot's model.
        exempt: pairs of the robot's links that do not collide.
        self_collision: True if links of the robot may touch each other.
        connected: pairs of links, by "model::link", that bushings connect.
    """
    top = {link: name for link, (name, _) in description.rigid_groups().items()}
    name = {link if "::" in link else f"{robot}::{link}": link for link in description.links}
    held = set(map(frozenset, connected))
    result = []
    for i, a in enumerate(colliders):
        for b in colliders[i + 1 :]:
            link_a, link_b = name[a.link], name[b.link]
            if top[link_a] == top[link_b] or frozenset((a.link, b.link)) in held:
                continue
            if a.model != b.model or (
                a.model == robot and self_collision and frozenset((link_a, link_b)) not in exempt
            ):
                result.append((a, b))
    return result
