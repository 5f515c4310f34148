"""Muscles of a simulated human as lines for rviz, coloured by activation. No node."""

import itertools
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from hric_core.robot_time import stamps
from hric_core.urdf import read
from hric_human.muscles.lines import colour

WIDTH = 0.007
"""Width of a muscle's line [m]."""
LIFETIME = 0.5
"""Lifetime of the lines after the last message [s]; constants of this file are project defaults, unconfirmed."""


class MuscleMarkers:
    """Markers of a human's muscles, from the newest posture and activation; thread-safe.

    Args:
        description: URDF of the body.
        lines: by muscle, the points of its line: name of the link, and x, y, z in the link's frame [m].
        prefix: prefix of the human's tf frames.
    """

    def __init__(self, description: str, lines: Mapping[str, Sequence[Sequence[Any]]], prefix: str) -> None:
        self._robot = read(description)
        self._frame = f"{prefix}/{self._robot.root}"
        self._names = list(lines)
        self._points = [[(str(link), np.array(position, float)) for link, *position in of] for of in lines.values()]
        self._lock = threading.Lock()
        self._angles: dict[str, float] = {}
        self._activation: Any = None

    def push_joints(self, message: Any) -> None:
        """Store a sensor_msgs/JointState."""
        with self._lock:
            self._angles = dict(zip(message.name, message.position, strict=True))

    def push_activation(self, message: Any) -> None:
        """Store a hric_msgs/MuscleActivation."""
        with self._lock:
            self._activation = message

    def take(self) -> Any:
        """Return visualization_msgs/MarkerArray of the muscles; None without a new activation, or without a posture."""
        with self._lock:
            angles, message, self._activation = self._angles, self._activation, None
        if message is None or not angles:
            return None
        activation = dict(zip(message.name, message.activation, strict=True))
        colours = [ColorRGBA(*rgb, 1.0) for rgb in colour([activation.get(name, 0.0) for name in self._names]).tolist()]
        marker = Marker(header=Header(frame_id=self._frame), ns="human/muscles", type=Marker.LINE_LIST)
        marker.frame_locked, marker.pose.orientation.w, marker.scale.x = True, 1.0, WIDTH
        marker.color, marker.lifetime = ColorRGBA(1.0, 1.0, 1.0, 1.0), stamps.to_duration(LIFETIME)
        poses = self._robot.poses(angles)
        for points, rgba in zip(self._points, colours, strict=True):
            at = [Point(*(poses[link][:3, :3] @ position + poses[link][:3, 3]).tolist()) for link, position in points]
            for ends in itertools.pairwise(at):
                marker.points += ends
                marker.colors += [rgba, rgba]
        return MarkerArray([marker])
