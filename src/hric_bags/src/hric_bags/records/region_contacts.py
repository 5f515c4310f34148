"""Contacts on a person's body over time, from hric_msgs/RegionContacts in a bag. No ROS."""

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_bags.reader import FloatArray
from hric_bags.records.rows import times, xyz
from hric_core.geometry import Vector
from hric_human.contact import ContactSeries, RegionContact

CONTACTS_TYPE = "hric_msgs/msg/RegionContacts"


@dataclass(frozen=True)
class ContactRecord:
    """Contact force on one link of a person over time.

    Attributes:
        link: link of the person's body.
        regions: body regions of ISO/TS 15066 to which the link belongs.
        time: robot time, shape (n,) [s].
        force: largest force of all contacts at each message, or the peak of a contact that has ended since the message
            before, shape (n,) [N]; 0: no contact, or only rigid contacts, whose force is not meaningful.
        point: point at which the force acts, world frame, shape (n, 3) [m].
        normal: unit vector along which the force acts on the link, world frame, shape (n, 3).
    """

    link: str
    regions: tuple[str, ...]
    time: FloatArray
    force: FloatArray
    point: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class ContactStream:
    """Times and losses of the messages on a contact topic.

    Attributes:
        time: robot time of each message, shape (n,) [s].
        silent: number of messages without a current or ended contact.
        lost: begin and end of each time in which sequence numbers are missing, robot time [s].
    """

    time: FloatArray
    silent: int
    lost: tuple[tuple[float, float], ...]


SAME = 5e-4
"""Largest difference of the begins that messages of one contact state [s]: half a step of 1 ms (project default).

The next contact of the same bodies begins at least two steps later.
"""
RECENT = 8
"""Number of contacts of two bodies, the last ones, to which a message may belong (project default)."""


@dataclass
class _Contact:
    """Collected messages of one contact: its begin, the last one, the number of its instant, and rows of the series."""

    begin: float
    last: Any
    rows: "array[float]" = field(default_factory=lambda: array("d"))
    regions: dict[str, None] = field(default_factory=dict)
    sides: set[bool] = field(default_factory=set)
    kinds: set[str] = field(default_factory=set)
    area: float = math.inf
    ended: bool = False
    instant: int = -1
    message: int = -1
    interrupted: bool = False


class RegionMessages:
    """Collector of the messages on one contact topic, in their order."""

    def __init__(self) -> None:
        self._stamps = array("d")
        self._all_stamps, self._numbers, self._silent = array("d"), array("q"), 0
        self._contacts: dict[tuple[str, str], list[_Contact]] = {}
        self._links: dict[str, tuple[tuple[str, ...], array[float]]] = {}
        self._order: list[_Contact] = []
        self._instant = 0

    def note(self, raw: bytes) -> None:
        """Count a message, whether it is read or not; raw: serialised message."""
        number, seconds, nanoseconds = (int.from_bytes(raw[k : k + 4], "little") for k in (0, 4, 8))
        self._numbers.append(number)
        self._all_stamps.append(seconds + 1e-9 * nanoseconds)
        self._silent += raw[-8:] == bytes(8) and len(raw) == 24 + int.from_bytes(raw[12:16], "little")

    def stream(self, robot_time: Callable[[float], float]) -> ContactStream:
        """Return times and losses of all messages; robot_time: function from stamps to robot time [s]."""
        time, numbers = times(self._all_stamps, robot_time), np.array(self._numbers)
        lost = np.flatnonzero(np.diff(numbers) > 1)
        return ContactStream(time, self._silent, tuple((float(time[k]), float(time[k + 1])) for k in lost))

    def add(self, stamp: float, message: Any) -> None:
        """Add a message; stamp: stamp of its header [s]."""
        index = len(self._stamps)
        if not index or stamp != self._stamps[-1] or not (message.touching or message.ended):
            self._instant += 1  # a source may send a message for each link
        self._stamps.append(stamp)
        for contact in message.touching:
            self._note(contact, stamp)
            self._strongest(contact, index, math.nan, contact.force)
        for contact in message.ended:
            known = self._note(contact, contact.begin + contact.duration)
            if not known.ended:
                known.ended = True
                self._order.append(known)
            if contact.kind == "penalty":
                self._strongest(contact, index, contact.peak_time, contact.peak)

    def _note(self, contact: Any, stamp: float) -> _Contact:
        pair = self._contacts.setdefault((contact.link, contact.other), [])
        begin = contact.begin if math.isfinite(contact.begin) else math.inf
        same = (
            one
            for one in reversed(pair[-RECENT:])
            if one.message != len(self._stamps) and (one.begin == begin or abs(one.begin - begin) <= SAME)
        )  # two contacts of one message press at two points of the same bodies
        if (known := next(same, None)) is None:
            pair.append(known := _Contact(begin, contact))
        known.interrupted |= bool(known.rows) and self._instant > known.instant + 1
        known.last, known.instant, known.message = contact, self._instant, len(self._stamps)
        row = (contact.force, contact.peak, contact.peak_time, contact.duration)
        known.rows.extend((stamp, *row, *xyz(contact.point), *xyz(contact.normal)))
        known.regions |= dict.fromkeys(contact.regions)
        known.sides.add(bool(contact.dominant))
        known.kinds.add(contact.kind)
        known.area = math.nan if math.isnan(contact.area + known.area) else min(contact.area, known.area)
        return known

    def _strongest(self, contact: Any, index: int, stamp: float, force: float) -> None:
        if force > 0.0:  # the force of a rigid contact is NaN
            _, rows = self._links.setdefault(contact.link, (tuple(contact.regions), array("d")))
            rows.extend((index, stamp, force, *xyz(contact.point), *xyz(contact.normal)))

    def by_link(self, robot_time: Callable[[float], float]) -> dict[str, ContactRecord]:
        """Return contact forces by link at the times of the messages; a peak between two counts at the later one."""
        time = times(self._stamps, robot_time)
        records, n = dict[str, ContactRecord](), len(time)
        for link, (regions, values) in self._links.items():
            record = ContactRecord(link, regions, time, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
            for index, stamp, force, *vectors in np.array(values).reshape(-1, 9).tolist():
                at = int(index)
                if not math.isnan(stamp):
                    at = min(int(np.searchsorted(time, robot_time(stamp))), at)
                if force > record.force[at]:
                    record.force[at], record.point[at], record.normal[at] = force, vectors[:3], vectors[3:]
            records[link] = record
        return records

    def region_contacts(self, robot_time: Callable[[float], float]) -> list[RegionContact]:
        """Return all contacts in the order in which they ended; contacts that did not end are last."""
        open_contacts = [contact for pair in self._contacts.values() for contact in pair if not contact.ended]
        return [_region_contact(contact, robot_time) for contact in (*self._order, *open_contacts)]


def _region_contact(contact: _Contact, robot_time: Callable[[float], float]) -> RegionContact:
    last, rows = contact.last, np.array(contact.rows).reshape(-1, 11)
    stamps, force, reached, reached_stamps, since_begin = rows[:, :5].T
    time, reached_time = times(stamps, robot_time), times(reached_stamps, robot_time)
    series = ContactSeries(time, force, reached, reached_time, since_begin, rows[:, 5:8], rows[:, 8:])
    kind = last.kind if len(contact.kinds) == 1 else " and ".join(sorted(contact.kinds))
    known = kind == "penalty"
    stated = math.isfinite(last.begin)  # otherwise begin is that of the first message, and the duration unknown
    return RegionContact(
        last.link,
        tuple(contact.regions),
        last.other,
        kind,
        begin=robot_time(last.begin) if stated else float(time[0]),
        duration=float(last.duration) if stated else math.nan,
        dominant=contact.sides.copy().pop() if len(contact.sides) == 1 else None,
        force=float(last.force) if known else None,
        peak=float(last.peak) if known else None,
        peak_time=robot_time(last.peak_time) if known else None,
        impulse=float(last.impulse) if known else None,
        energy=_number(getattr(last, "energy", math.nan)) or None,  # older recordings and sensors do not state it
        area=None if math.isnan(contact.area) or contact.area == math.inf else float(contact.area),
        point=_known(last.point),
        normal=_known(last.normal),
        begin_point=_known(last.begin_point),
        begin_normal=_known(last.begin_normal),
        begin_speed=_number(last.begin_speed),
        series=series,
        ended=contact.ended,
        interrupted=contact.interrupted,
    )


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def _known(v: Any) -> Vector | None:
    return None if math.isnan(v.x) else xyz(v)
