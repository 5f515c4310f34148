"""Marker samples: subscription and validity check.

About half of the damaged datagrams that can still be decoded have wrong values, so validity is checked a second time
before a sample becomes a target.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Point

from hric_core.geometry import Quaternion, Vector
from hric_core.node import Node
from hric_msgs.msg import MocapData

UNIT = 0.01
"""Tolerance for the norm of a unit quaternion."""


@dataclass(frozen=True)
class MarkerSample:
    """Marker sample as received.

    Attributes:
        position: position in its frame [m].
        valid: True if the cameras see the marker.
        attitude: quaternion in its frame; None: the source has no attitude.
        in_base: True if its frame is the robot's base.
        stamp: time of measurement [s]; None: unknown.
    """

    position: Vector
    valid: bool = True
    attitude: Quaternion | None = None
    in_base: bool = False
    stamp: float | None = None


@dataclass(frozen=True)
class SampleValidator:
    """Conditions that a sample must fulfil.

    Attributes:
        largest_distance: maximum distance from the origin of its frame [m].
        largest_step: maximum distance from the previous sample [m].
        attitude: True if a sample needs an attitude.
    """

    largest_distance: float
    largest_step: float
    attitude: bool = False

    def objection(self, marker: MarkerSample, last: MarkerSample | None) -> str:
        """Return the reason to refuse a sample, empty if valid. `last`: previous sample, None while not following."""
        if not all(map(math.isfinite, marker.position)):
            return "position not finite"
        if math.hypot(*marker.position) > self.largest_distance:
            return "further away than largest_distance"
        if self.attitude and not _is_unit(marker.attitude):
            return "no unit quaternion"
        return "" if last is None else self._after(marker, last)

    def _after(self, marker: MarkerSample, last: MarkerSample) -> str:
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
    node: Node, source: str, topic: str, body: str, base: str, take: Callable[[MarkerSample], None]
) -> None:
    """Call `take` with each marker, in the subscriber's thread.

    Args:
        node: namespace of the controller.
        source: mocap (hric_msgs/MocapData), point (geometry_msgs/Point) or none.
        topic: topic name, relative to the robot's namespace, which contains the controller's.
        body: name of the rigid body; empty: the first of each frame.
        base: name of the robot's base frame.
        take: callback for each marker.
    """
    topic = node.beside(topic) if topic else ""
    if source == "mocap":
        node.subscribe(topic, MocapData, MocapReader(node, topic, body, base, take), queue_size=10)
    elif source == "point":
        node.subscribe(
            topic, Point, lambda message: take(MarkerSample((message.x, message.y, message.z))), queue_size=10
        )


class MocapReader:
    """Callback that selects one rigid body from each frame.

    A frame without the body gives an invalid marker; the first time, a warning lists the bodies of the frame.
    """

    def __init__(self, node: Node, topic: str, body: str, base: str, take: Callable[[MarkerSample], None]) -> None:
        self._node, self._topic, self._body, self._base, self._take = node, topic, body, base, take
        self._warning_logged = False

    def __call__(self, message: Any) -> None:
        """Pass the marker of one MocapData to the callback."""
        body = next((body for body in message.rigid_bodies if not self._body or body.name == self._body), None)
        stamp = message.header.stamp.to_sec() or None
        in_base = message.header.frame_id.lstrip("/") == self._base
        if body is None:
            self._warn_once(message)
            self._take(MarkerSample((0.0, 0.0, 0.0), False, None, in_base, stamp))
            return
        p, q = body.pose.position, body.pose.orientation
        self._take(MarkerSample((p.x, p.y, p.z), bool(body.tracking_valid), (q.x, q.y, q.z, q.w), in_base, stamp))

    def _warn_once(self, message: Any) -> None:
        if not self._warning_logged:
            self._warning_logged = True
            names = ", ".join(body.name for body in message.rigid_bodies) or "none"
            self._node.log_warn(
                f"{self._topic} has no rigid body {self._body or 'at all'}; it has: {names} "
                f"({self._node.resolve('body')})"
            )
