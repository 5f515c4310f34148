"""Marker samples: subscription and validity check.

About half of the damaged datagrams of a motion capture system that can still be decoded have wrong values, so samples
are checked here once more before they become targets.
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
"""Maximum deviation of the norm of a valid quaternion from 1."""


@dataclass(frozen=True)
class MarkerSample:
    """Marker sample as received.

    Attributes:
        position: position of the marker in the frame of the sample [m].
        valid: True if the cameras see the marker.
        attitude: quaternion (x, y, z, w) in the frame of the sample; None: the source has no attitude.
        in_base: True if the frame of the sample is the robot's base frame.
        stamp: time of measurement [s]; None: unknown.
    """

    position: Vector
    valid: bool = True
    attitude: Quaternion | None = None
    in_base: bool = False
    stamp: float | None = None


@dataclass(frozen=True)
class SampleValidator:
    """Check of marker samples before they become targets.

    Attributes:
        largest_distance: maximum distance of the marker from the origin of the sample's frame [m].
        largest_step: maximum distance of the marker from its position in the previous sample [m].
        attitude: True if samples need a valid attitude.
    """

    largest_distance: float
    largest_step: float
    attitude: bool = False

    def objection(self, marker: MarkerSample, last: MarkerSample | None) -> str:
        """Return the reason to refuse a sample as a text, empty if the sample is valid.

        Args:
            marker: sample to check.
            last: previous valid sample; None: no comparison, since no marker is followed at present.
        """
        if not all(map(math.isfinite, marker.position)):
            return "position not finite"
        if math.hypot(*marker.position) > self.largest_distance:
            return "further from the origin of its frame than largest_distance"
        if self.attitude and not _is_unit(marker.attitude):
            return "no unit quaternion"
        return "" if last is None else self._after(marker, last)

    def _after(self, marker: MarkerSample, last: MarkerSample) -> str:
        if marker.in_base != last.in_base:
            return "in another frame than the previous marker"
        if marker.stamp is not None and last.stamp is not None and marker.stamp <= last.stamp:
            return "not newer than the previous marker"
        return (
            "further from the previous marker than largest_step"
            if math.dist(marker.position, last.position) > self.largest_step
            else ""
        )


def _is_unit(q: Sequence[float] | None) -> bool:
    return q is not None and all(map(math.isfinite, q)) and abs(math.hypot(*q) - 1.0) < UNIT


def subscribe_markers(
    node: Node, source: str, topic: str, body: str, base: str, take: Callable[[MarkerSample], None]
) -> None:
    """Subscribe to the markers of a source and call `take` with each one, in the thread of the subscriber.

    Args:
        node: namespace of the controller.
        source: `mocap` (hric_msgs/MocapData), `point` (geometry_msgs/Point) or `none` (no subscription).
        topic: absolute name of the topic.
        body: name of the rigid body to follow; empty: the first one of each MocapData.
        base: name of the robot's base frame.
        take: function that is called with each marker.
    """
    if source == "mocap":
        node.subscribe(topic, MocapData, MocapReader(node, topic, body, base, take), queue_size=10)
    elif source == "point":
        node.subscribe(
            topic, Point, lambda message: take(MarkerSample((message.x, message.y, message.z))), queue_size=10
        )


class MocapReader:
    """Callback that selects one rigid body of each MocapData as the marker.

    A message without the body gives an invalid marker; for the first such message, a warning lists the bodies in it.
    """

    def __init__(self, node: Node, topic: str, body: str, base: str, take: Callable[[MarkerSample], None]) -> None:
        self._node, self._topic, self._body, self._base, self._take = node, topic, body, base, take
        self._warning_logged = False

    def __call__(self, message: Any) -> None:
        """Pass the marker of one MocapData to the function for markers."""
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
                f"a message on {self._topic} has no rigid body {self._body or 'at all'}; it has: {names} "
                f"(parameter {self._node.resolve('body')})"
            )
