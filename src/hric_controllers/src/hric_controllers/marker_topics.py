"""Markers as they come on topics, brought into one form; called by subscriptions, outside the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point

from hric_control.node import Node, Registration
from hric_controllers.marker import Marker
from hric_msgs.msg import MocapData


def subscribe_markers(node: Node, source: str, topic: str, body: str, base: str, take: Callable[[Marker], None]) -> list[Registration]:
    """Have `take` called with each marker.

    Args:
        source: mocap (hric_msgs/MocapData), point (geometry_msgs/Point) or none.
        topic: its name.
        body: of the rigid body; empty: the first of each frame.
        base: name of the robot's base frame.
        take: takes it; in the subscriber's thread.
    """
    if source == "mocap":
        return [node.subscribe(topic, MocapData, MocapReader(node, topic, body, base, take), queue_size=10)]
    if source == "point":
        return [node.subscribe(topic, Point, lambda message: take(Marker((message.x, message.y, message.z))), queue_size=10)]
    return []


class MocapReader:
    """Picks one rigid body out of each frame. Without it in the frame the marker counts as not seen; that is told once, with the bodies that are."""

    def __init__(self, node: Node, topic: str, body: str, base: str, take: Callable[[Marker], None]) -> None:
        self._node, self._topic, self._body, self._base, self._take, self._told = node, topic, body, base, take, False

    def __call__(self, message: Any) -> None:
        """One MocapData."""
        found = next((one for one in message.rigid_bodies if not self._body or one.name == self._body), None)
        stamp = message.header.stamp.to_sec() or None
        in_base = message.header.frame_id.lstrip("/") == self._base
        if found is None:
            self._tell(message)
            self._take(Marker((0.0, 0.0, 0.0), False, None, in_base, stamp))
            return
        p, q = found.pose.position, found.pose.orientation
        self._take(Marker((p.x, p.y, p.z), bool(found.tracking_valid), (q.x, q.y, q.z, q.w), in_base, stamp))

    def _tell(self, message: Any) -> None:
        if not self._told:
            self._told = True
            names = ", ".join(one.name for one in message.rigid_bodies) or "none"
            self._node.log_warn(f"{self._topic} has no rigid body {self._body or 'at all'}; it has: {names} ({self._node.resolve('body')})")
