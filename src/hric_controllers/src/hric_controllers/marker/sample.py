"""A marker's sample: as it comes on topics, and whether it is valid.

About half of what a damaged datagram still decodes to is wrong, so validity is checked a second time, before a sample
becomes a target.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Point

from hric_control.geometry import Quaternion, Vector
from hric_control.node import Node, Registration
from hric_msgs.msg import MocapData

UNIT = 0.01
"""How far the norm of a quaternion may be from 1."""


@dataclass(frozen=True)
class Marker:
    """One sample as it came.

    Attributes:
        position: in its own frame [m].
        valid: whether the cameras see the marker.
        attitude: quaternion in that frame; None: it has none.
        in_base: whether its frame is the robot's base.
        stamp: time of measurement [s]; None: not known.
    """

    position: Vector
    valid: bool = True
    attitude: Quaternion | None = None
    in_base: bool = False
    stamp: float | None = None


@dataclass(frozen=True)
class SampleValidator:
    """What a sample must fulfil.

    Attributes:
        largest_distance: from the origin of its frame [m].
        largest_step: from the sample before [m].
        attitude: whether it needs one.
    """

    largest_distance: float
    largest_step: float
    attitude: bool = False

    def objection(self, marker: Marker, last: Marker | None) -> str:
        """Why the sample is refused; empty if it is not. `last`: the one before, None while nothing is followed."""
        if not all(map(math.isfinite, marker.position)):
            return "position not finite"
        if math.hypot(*marker.position) > self.largest_distance:
            return "further away than largest_distance"
        if self.attitude and not _is_unit(marker.attitude):
            return "no unit quaternion"
        return "" if last is None else self._after(marker, last)

    def _after(self, marker: Marker, last: Marker) -> str:
        if marker.in_base != last.in_base:
            return "in another frame than the one before"
        if marker.stamp is not None and last.stamp is not None and marker.stamp <= last.stamp:
            return "not newer than the one before"
        return (
            "further from the one before than largest_step"
            if math.dist(marker.position, last.position) > self.largest_step
            else ""
        )


def _is_unit(q: Sequence[float] | None) -> bool:
    return q is not None and all(map(math.isfinite, q)) and abs(math.hypot(*q) - 1.0) < UNIT


def subscribe_markers(
    node: Node, source: str, topic: str, body: str, base: str, take: Callable[[Marker], None]
) -> list[Registration]:
    """Call `take` with each marker, in the subscriber's thread.

    Args:
        source: mocap (hric_msgs/MocapData), point (geometry_msgs/Point) or none.
        topic: its name, in the robot's namespace, which the controller's is in.
        body: of the rigid body; empty: the first of each frame.
        base: name of the robot's base frame.
    """
    if source == "none":
        return []
    topic = node.beside(topic)
    if source == "mocap":
        return [node.subscribe(topic, MocapData, MocapReader(node, topic, body, base, take), queue_size=10)]
    return [
        node.subscribe(topic, Point, lambda message: take(Marker((message.x, message.y, message.z))), queue_size=10)
    ]


class MocapReader:
    """Picks one rigid body out of each frame. Without it in the frame the marker is invalid; a warning says so once and
    lists the bodies of the frame."""

    def __init__(self, node: Node, topic: str, body: str, base: str, take: Callable[[Marker], None]) -> None:
        self._node, self._topic, self._body, self._base, self._take, self._warned = node, topic, body, base, take, False

    def __call__(self, message: Any) -> None:
        """One MocapData."""
        found = next((one for one in message.rigid_bodies if not self._body or one.name == self._body), None)
        stamp = message.header.stamp.to_sec() or None
        in_base = message.header.frame_id.lstrip("/") == self._base
        if found is None:
            self._warn_once(message)
            self._take(Marker((0.0, 0.0, 0.0), False, None, in_base, stamp))
            return
        p, q = found.pose.position, found.pose.orientation
        self._take(Marker((p.x, p.y, p.z), bool(found.tracking_valid), (q.x, q.y, q.z, q.w), in_base, stamp))

    def _warn_once(self, message: Any) -> None:
        if not self._warned:
            self._warned = True
            names = ", ".join(one.name for one in message.rigid_bodies) or "none"
            self._node.log_warn(
                f"{self._topic} has no rigid body {self._body or 'at all'}; it has: {names} "
                f"({self._node.resolve('body')})"
            )
