"""Forces on a simulated human as markers for rviz: grip forces at the hand, contacts at a region. No node."""

import math
import threading
from typing import Any

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from hric_core.robot_time import stamps
from hric_msgs.msg import HumanGrip

PER_NEWTON_GRIP, PER_NEWTON_CONTACT = 0.02, 0.002
"""Arrow length per force: of grips, as of the force on the arm, and of contacts with hundreds of newtons [m/N]."""
SHAFT, HEAD, TEXT = 0.01, 0.025, 0.04
"""Diameters of an arrow's shaft and head, and height of letters [m]."""
FORCE_MIN = 0.1
"""Smallest force that is shown by an arrow [N]."""
GRIP_LIFETIME, CONTACT_LIFETIME = 0.5, 1.0
"""Lifetimes of the markers [s]: long enough to see an impact that lasts milliseconds.

The constants of this file are project defaults, unconfirmed.
"""
GRIP, CONTACT = ColorRGBA(0.1, 0.35, 0.75, 1.0), ColorRGBA(0.8, 0.12, 0.1, 1.0)


class HumanMarkers:
    """Markers of a human's newest grip loads and largest contact forces since the last `take`; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._grips: dict[str, HumanGrip] = {}
        self._contacts: dict[str, tuple[float, str, Any]] = {}
        self._numbers: dict[str, int] = {}

    def push_grip(self, message: Any) -> None:
        """Store a hric_msgs/HumanGrip."""
        with self._lock:
            self._grips[message.name] = message

    def push_contacts(self, message: Any) -> None:
        """Store the forces of current contacts and the peaks of ended ones from hric_msgs/RegionContacts."""
        with self._lock:
            frame = message.header.frame_id
            for contact in message.touching:
                self._note(contact, contact.force, frame)
            for contact in message.ended:
                self._note(contact, contact.peak, frame)

    def _note(self, contact: Any, force: float, frame: str) -> None:
        """Store a contact that has a position if its force is the link's largest; any force replaces NaN (rigid)."""
        before = self._contacts[contact.link][0] if contact.link in self._contacts else math.nan
        if not math.isnan(contact.point.x) and (math.isnan(before) or force > before):
            self._contacts[contact.link] = force, frame, contact

    def take(self) -> Any:
        """Return visualization_msgs/MarkerArray of grips and contacts since the last call; None if there are none."""
        with self._lock:
            grips, self._grips = self._grips, {}
            contacts, self._contacts = self._contacts, {}
        markers = [marker for grip in grips.values() if grip.closed for marker in self._grip(grip)]
        markers += [marker for link, contact in contacts.items() for marker in self._contact(link, *contact)]
        return MarkerArray(markers) if markers else None

    def _grip(self, grip: Any) -> list[Any]:
        """Return arrow and text of a grip's force on the hand; the arrow starts at the point of application."""
        force, point, frame = grip.wrench.force, grip.point, grip.header.frame_id
        size = math.hypot(force.x, force.y, force.z)
        tip = Point(*(a + PER_NEWTON_GRIP * f for a, f in zip(_xyz(point), _xyz(force), strict=True)))
        words = self._words("human/grips/words", grip.name, frame, tip, f"{grip.name}: {size:.1f} N", GRIP)
        return [*self._arrow("human/grips", grip.name, frame, point, tip, size, GRIP), words]

    def _contact(self, link: str, force: float, frame: str, contact: Any) -> list[Any]:
        """Return arrow and text of a contact force; the arrow ends at the contact, so the body does not hide it."""
        length, regions = (
            PER_NEWTON_CONTACT * (0.0 if math.isnan(force) else force),
            " / ".join(contact.regions) or link,
        )
        tip, along = contact.point, _xyz(contact.normal)
        tail = Point(*(a - length * n for a, n in zip(_xyz(tip), along, strict=True)))
        text = f"{regions}: rigid" if math.isnan(force) else f"{regions}: {force:.0f} N"
        words = self._words("human/contacts/words", link, frame, tail, text, CONTACT)
        return [*self._arrow("human/contacts", link, frame, tail, tip, force, CONTACT), words]

    def _arrow(self, space: str, name: str, frame: str, tail: Any, tip: Any, force: float, colour: Any) -> list[Any]:
        """Return an arrow from tail to tip; empty if the force is below FORCE_MIN or NaN."""
        if not force >= FORCE_MIN:
            return []
        marker = self._marker(space, name, frame, Marker.ARROW, colour)
        marker.points, marker.scale.x, marker.scale.y = [tail, tip], SHAFT, HEAD
        return [marker]

    def _words(self, space: str, name: str, frame: str, at: Any, text: str, colour: Any) -> Any:
        marker = self._marker(space, name, frame, Marker.TEXT_VIEW_FACING, colour)
        marker.pose.position = Point(at.x, at.y, at.z + TEXT)
        marker.scale.z, marker.text = TEXT, text
        return marker

    def _marker(self, space: str, name: str, frame: str, kind: int, colour: Any) -> Any:
        number = self._numbers.setdefault(name, len(self._numbers))
        marker = Marker(header=Header(frame_id=frame), ns=space, id=number, type=kind, frame_locked=True)
        marker.pose.orientation.w, marker.color = 1.0, colour
        marker.lifetime = stamps.to_duration(GRIP_LIFETIME if colour is GRIP else CONTACT_LIFETIME)
        return marker


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z
