"""Which shapes touch. Far pairs cost next to nothing: a pair is looked at again only when what moved since could have closed its gap."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_control.plants.faces import Corner, corners
from hric_control.plants.spatial import FloatArray
from opensim_ros_control.shapes import FAR, Pairing, Shape, Touch, pose

MARGIN = 2e-3
"""Shapes that are nearer than this are looked at in every step [m] (our choice)."""
AT_ONCE = 20.0
"""When one pair must be looked at, so are those that would have to be within so many steps: the poses cost more than the pairs (our choice)."""


@dataclass
class Collider:
    """One shape of one link in the model.

    Attributes:
        link: "model::link".
        model: its model.
        mobile: OpenSim's number of the moving body that carries it, 0 for the ground.
        T_body_shape: its pose in that body, shape (4, 4).
        moved_by: how far a point of the shape goes at the most per change of each coordinate, shape (nq,) [m/rad or 1].
    """

    link: str
    model: str
    shape: Shape
    mobile: int
    T_body_shape: FloatArray
    moved_by: FloatArray


@dataclass
class Meeting:
    """Two colliders that touch, or nearly do, in the ground frame."""

    a: Collider
    b: Collider
    touch: Touch
    points: list[FloatArray]


def _path_per_change(a: Collider, b: Collider) -> FloatArray:
    """What moves both moves them alike: only the coordinates that move one of them count."""
    apart = (a.moved_by > 0.0) != (b.moved_by > 0.0)
    return np.where(apart, a.moved_by + b.moved_by, 0.0)


class Collisions:
    """All pairs of colliders that may touch.

    Args:
        pairs: of colliders.
        nq: number of coordinates.
    """

    def __init__(self, pairs: Sequence[tuple[Collider, Collider]], nq: int) -> None:
        self.pairs = list(pairs)
        self._path = np.array([_path_per_change(a, b) for a, b in self.pairs]).reshape(len(self.pairs), nq)
        self._slack = np.full(len(self.pairs), -1.0)
        self._last: FloatArray | None = None
        self._ask = Pairing(MARGIN)
        self._placed: dict[int, Any] = {}

    def near(self, q: FloatArray) -> list[int]:
        """Pairs that must be looked at, and those that soon must, given all coordinates, shape (nq,)."""
        if not self.pairs:
            return []
        spent = np.zeros(1) if self._last is None else self._path @ np.abs(q - self._last)
        self._slack -= spent
        self._last = q
        if self._slack.min() >= 0.0:
            return []
        return np.flatnonzero(self._slack < AT_ONCE * spent).tolist()

    def meetings(self, near: Sequence[int], body_pose: Callable[[int], FloatArray], areas: Callable[[Collider, Collider], bool]) -> Iterator[Meeting]:
        """What touches, or nearly does.

        Args:
            near: of `near`.
            body_pose: T_ground_body of a moving body by OpenSim's number, shape (4, 4).
            areas: whether the whole area of a meeting is wanted.
        """
        self._placed.clear()
        for i in near:
            a, b = self.pairs[i]
            T_a, T_b = self._place(a, body_pose), self._place(b, body_pose)
            gap = self._ask.distance(a.shape.geometry, T_a, b.shape.geometry, T_b)
            self._slack[i] = gap - MARGIN
            if gap >= MARGIN:
                continue
            touch = self._ask.touch(a.shape.geometry, T_a, b.shape.geometry, T_b)
            if touch is not None:
                corners = self._ask.patch(a.shape.geometry, T_a, b.shape.geometry, T_b) if areas(a, b) else []
                yield Meeting(a, b, touch, corners or touch.points)

    def depths(self, meeting: Meeting) -> list[tuple[FloatArray, float]]:
        """(point, depth [m]) of each point of the meeting that was last handed out, or before in the same step."""
        if len(meeting.points) == 1:
            return [(meeting.points[0], meeting.touch.depth)]
        sides = [(c.shape.geometry, self._placed[id(c)]) for c in (meeting.a, meeting.b)]
        return [(point, -sum(self._ask.beyond(point, *side) for side in sides)) for point in meeting.points]

    def corners(self, meeting: Meeting, body_pose: Callable[[int], FloatArray]) -> list[Corner]:
        """Where the sides of the two shapes meet; their deepest point where they do not."""
        a, b, touch = meeting.a, meeting.b, meeting.touch
        T_a, T_b = body_pose(a.mobile) @ a.T_body_shape, body_pose(b.mobile) @ b.T_body_shape
        return corners(a.shape.solid, T_a, b.shape.solid, T_b, touch.normal, touch.points[0], touch.depth)

    def _place(self, collider: Collider, body_pose: Callable[[int], FloatArray]) -> Any:
        key = id(collider)
        if key not in self._placed:
            self._placed[key] = pose(body_pose(collider.mobile) @ collider.T_body_shape)
        return self._placed[key]


def bounded(length: float) -> float:
    """A length that may be infinite, as a number that can be multiplied by zero."""
    return min(length, FAR)
