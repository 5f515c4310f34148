"""State of a running system for the window: newest joint positions, root poses and forces. No node."""

import math
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

DIGITS = 5
"""Decimals of positions and angles: 0.01 mm and 0.6 millidegrees."""


class Force(NamedTuple):
    """Force that is drawn as an arrow.

    Attributes:
        name: name for display.
        point: point of action in the world [m].
        force: force in the world [N].
    """

    name: str
    point: tuple[float, float, float]
    force: tuple[float, float, float]


class LiveJoints:
    """Newest positions of the joints of one robot or person; thread-safe.

    Args:
        names: joints in the order of the frame.

    Attributes:
        names: the same.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._index = {name: k for k, name in enumerate(names)}
        self._lock = threading.Lock()
        self._positions = [math.nan] * len(names)
        self._root: list[float] | None = None
        self.time = math.nan

    def push(self, message: Any) -> None:
        """Store the positions of a sensor_msgs/JointState, of those joints that it has."""
        with self._lock:
            for name, position in zip(message.name, message.position, strict=False):
                if (index := self._index.get(name)) is not None:
                    self._positions[index] = round(position, DIGITS) if math.isfinite(position) else math.nan
            self.time = message.header.stamp.to_sec()

    def push_root(self, message: Any) -> None:
        """Store the pose of the root link from a geometry_msgs/PoseStamped."""
        p, q = message.pose.position, message.pose.orientation
        pose = p.x, p.y, p.z, q.x, q.y, q.z, q.w
        if all(map(math.isfinite, pose)):
            with self._lock:
                self._root = [round(value, DIGITS) for value in pose]

    def state(self) -> dict[str, Any]:
        """Return positions [rad, m] and, if it moves, the pose of the root: x, y, z [m], quaternion x, y, z, w.

        A joint is null until its position has been received.
        """
        with self._lock:
            positions = [None if math.isnan(position) else position for position in self._positions]
            time = None if math.isnan(self.time) else self.time
            return {"t": time, "q": positions} | ({} if self._root is None else {"root": self._root})


class LiveForces:
    """Largest contact force of each link of the person since the last frame; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._largest: dict[str, Force] = {}

    def push(self, message: Any) -> None:
        """Store the forces of a hric_msgs/RegionContacts, of ended contacts the peaks."""
        with self._lock:
            for contacts, attribute in ((message.touching, "force"), (message.ended, "peak")):
                for contact in contacts:
                    self._note(contact, getattr(contact, attribute))

    def _note(self, contact: Any, size: float) -> None:
        point = contact.point.x, contact.point.y, contact.point.z
        normal = contact.normal.x, contact.normal.y, contact.normal.z
        if not all(map(math.isfinite, (size, *point, *normal))):
            return  # a rigid contact has no force, and one without a point no place
        before = self._largest.get(contact.link)
        if before is None or size > math.hypot(*before.force):
            x, y, z = (size * value for value in normal)
            self._largest[contact.link] = Force(", ".join(contact.regions) or contact.link, point, (x, y, z))

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: a new viewer needs nothing before the first frame, which has the forces."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the forces since the last call."""
        with self._lock:
            forces, self._largest = list(self._largest.values()), {}
        return {
            "forces": [
                {"name": name, "point": [round(v, 4) for v in point], "force": [round(v, 2) for v in force]}
                for name, point, force in forces
            ]
        }
