"""The way that the followed body has come, for rviz: short pieces of line that disappear by themselves."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point, Quaternion
from visualization_msgs.msg import Marker

from hric_control import stamps
from hric_control.node import Node
from mocap_natnet.codec.types import Vector

TOPIC = "/mocap/trail"
POINTS_RATE = 50.0
"""Points per second of the run. The constants of this file are our choice."""
PIECE = 10
"""Points per message."""
BREAK = 0.25
"""A gap in the times beyond which the line is broken [s]."""
WIDTH = 0.004
"""[m]"""
COLOUR = (0.95, 0.45, 0.1, 0.9)
"""Orange; red, green, blue, alpha."""


class Trail:
    """Publishes visualization_msgs/Marker, a LINE_STRIP of some points each.

    Args:
        node: where to advertise.
        length: how long a piece is shown [s].
    """

    def __init__(self, node: Node, length: float) -> None:
        self._publisher = node.advertise(TOPIC, Marker, queue_size=10)
        self._length, self._points, self._pieces = length, list[Vector](), 0
        self._last = float("-inf")

    def add(self, head: Any, time: float, position: Vector) -> None:
        """The body was there.

        Args:
            head: stamp and frame.
            time: the stamp [s].
            position: in the frame [m].
        """
        since = time - self._last
        if 0.0 <= since < 1.0 / POINTS_RATE:
            return
        if not 0.0 <= since < BREAK:
            self._points = []
        self._last = time
        self._points.append(position)
        if len(self._points) > PIECE:
            self._publisher.publish(self._piece(head))
            self._points = [position]

    def _piece(self, head: Any) -> Any:
        piece = Marker(header=head, ns="trail", id=self._pieces % 2**31, type=Marker.LINE_STRIP, action=Marker.ADD)
        self._pieces += 1
        piece.pose.orientation, piece.scale.x = Quaternion(w=1.0), WIDTH
        piece.color.r, piece.color.g, piece.color.b, piece.color.a = COLOUR
        piece.lifetime = stamps.to_duration(self._length)
        piece.points = [Point(*point) for point in self._points]
        return piece
