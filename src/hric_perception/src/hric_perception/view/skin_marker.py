"""Skin of a simulated human as a marker for rviz: triangles that follow the newest posture. No node."""

import io
import struct
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from hric_core.robot_time import stamps
from hric_core.urdf import read
from hric_human.body import Body
from hric_skin import fitted

LIFETIME = 1.0
"""Lifetime of the skin after the last message [s]; project default, unconfirmed."""


class Triangles(Marker):
    """Marker message whose corners and colours are arrays: a hundredth of the time of a message for each of them.

    Attributes:
        corners: three corners of each triangle, shape (3 m, 3) [m].
        colours: red, green, blue, opacity of each corner, shape (3 m, 4).
    """

    corners, colours = np.zeros((0, 3)), np.zeros((0, 4))

    def serialize(self, buff: Any) -> None:
        """Write the message: the arrays in place of `points` and `colors`, which are empty."""
        whole = io.BytesIO()
        super().serialize(whole)
        count, empty = struct.pack("<I", len(self.corners)), bytes(8)
        # Both lists are empty, and follow header and namespace, with their lengths, and 117 bytes of numbers.
        at = 12 + 4 + len(self.header.frame_id.encode()) + 4 + len(self.ns.encode()) + 117
        before, after = whole.getvalue()[:at], whole.getvalue()[at + len(empty) :]
        corners, colours = self.corners.astype("<f8").tobytes(), self.colours.astype("<f4").tobytes()
        buff.write(b"".join((before, count, corners, count, colours, after)))


class SkinMarker:
    """Marker of a human's skin at the newest joint positions; thread-safe.

    Args:
        body: body of the human.
        gripping: sides ("right", "left") whose hand is closed around a handle.
        prefix: prefix of the human's tf frames.
    """

    def __init__(self, body: Body, gripping: Sequence[str], prefix: str) -> None:
        self._skin, self._tree = fitted(body, gripping), read(body.urdf)
        self._corners = self._skin.triangles.ravel()
        opaque = np.ones((len(self._corners), 1))
        self._colours = np.hstack((self._skin.colours[self._corners], opaque)).astype("<f4")
        self._frame = f"{prefix}/{self._tree.root}"
        self._lock = threading.Lock()
        self._message: Any = None

    def push(self, message: Any) -> None:
        """Store a sensor_msgs/JointState."""
        with self._lock:
            self._message = message

    def take(self) -> Any:
        """Return visualization_msgs/Marker of the skin; None without a new posture."""
        with self._lock:
            message, self._message = self._message, None
        if message is None:
            return None
        poses = self._tree.poses(dict(zip(message.name, message.position, strict=True)))
        marker = Triangles(header=Header(frame_id=self._frame), ns="human/skin", type=Marker.TRIANGLE_LIST)
        marker.frame_locked, marker.pose.orientation.w = True, 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = 1.0
        marker.color, marker.lifetime = ColorRGBA(1.0, 1.0, 1.0, 1.0), stamps.to_duration(LIFETIME)
        marker.corners, marker.colours = self._skin.posed(poses)[self._corners], self._colours
        return marker
