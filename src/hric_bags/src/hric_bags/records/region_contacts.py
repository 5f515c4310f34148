"""Contacts of a person over time, from hric_msgs/RegionContacts in a bag. No ROS."""

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_bags.reader import FloatArray
from hric_bags.records.rows import times, xyz
from hric_core.geometry import Vector

CONTACTS_TYPE = "hric_msgs/msg/RegionContacts"


@dataclass(frozen=True)
class ContactRecord:
    """Force on one link over time.

    Attributes:
        link: link of the human.
        regions: regions of ISO/TS 15066 that the link belongs to.
        time: robot time, shape (n,) [s].
        force: largest force of all contacts at an instant, or the peak of one that has ended since the instant before;
            0: no contact, or only contacts without a meaningful force; shape (n,) [N].
        point: point where it acts, world frame, shape (n, 3) [m].
        normal: unit vector along which it acts on the link, world frame, shape (n, 3).
    """

    link: str
    regions: tuple[str, ...]
    time: FloatArray
    force: FloatArray
    point: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class Course:
    """Time series of a contact at the instants of its messages; values as recorded, NaN included.

    Attributes:
        time: robot time, shape (n,) [s].
        force: contact force, shape (n,) [N].
        reached: largest force of all cycles since the begin, shape (n,) [N].
        reached_time: robot time of the largest force, shape (n,) [s].
        since_begin: duration of the contact by the message, shape (n,) [s].
        point, normal: as in ContactRecord, shape (n, 3).
    """

    time: FloatArray
    force: FloatArray
    reached: FloatArray
    reached_time: FloatArray
    since_begin: FloatArray
    point: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class RegionContact:
    """One contact of a region, from the first touch until the bodies parted or the recording ended.

    Attributes:
        regions: regions of ISO/TS 15066 that the link belongs to.
        link, other: link of the person, and the body that touched it.
        kind: "penalty", or "rigid", which has no force.
        begin: robot time of the begin [s].
        duration: duration in the last message [s].
        peak, peak_time, impulse: peak of the normal force, its time, and the impulse; None: rigid [N], [s], [N s].
        point, normal: point of the first touch, and unit vector along which the force then acted on the person, world
            frame, 3 floats each [m]; None: not known.
        speed: approach speed along the normal at the first touch [m/s]; None: rigid, or not known.
    """

    regions: tuple[str, ...]
    link: str
    other: str
    kind: str
    begin: float
    duration: float
    peak: float | None
    peak_time: float | None
    impulse: float | None
    point: Vector | None
    normal: Vector | None
    speed: float | None


@dataclass(frozen=True)
class RegionForce(RegionContact):
    """Contact of a region with its time series.

    Attributes:
        course: time series with one row for each message that has the contact.
        dominant: True if the messages place it on the side of the dominant hand; None: they differ.
        area: smallest contact area in its messages [m^2], as recorded; None: some message does not have it.
        ended: True if a message says that the bodies parted.
        interrupted: True if there are messages between two of it at another instant, without the contact and its end.
    """

    course: Course
    dominant: bool | None = False
    area: float | None = None
    ended: bool = True
    interrupted: bool = False

    @property
    def end(self) -> float:
        """Robot time of the end [s]."""
        return self.begin + self.duration


@dataclass(frozen=True)
class ContactStream:
    """Recorded messages of a contact topic.

    Attributes:
        time: robot time of each message, shape (n,) [s].
        silent: number of messages without a present or ended contact.
        lost: begin and end of each stretch in which sequence numbers are missing, robot time [s].
    """

    time: FloatArray
    silent: int
    lost: tuple[tuple[float, float], ...]


@dataclass
class _Contact:
    """Messages of one contact: the last one, the number of its instant, and the rows of its time series."""

    last: Any
    rows: "array[float]" = field(default_factory=lambda: array("d"))
    regions: dict[str, None] = field(default_factory=dict)
    sides: set[bool] = field(default_factory=set)
    kinds: set[str] = field(default_factory=set)
    area: float = math.inf
    ended: bool = False
    instant: int = -1
    interrupted: bool = False


class RegionMessages:
    """Collector of the messages of one topic in their order."""

    def __init__(self) -> None:
        self._stamps = array("d")
        self._all_stamps, self._numbers, self._silent = array("d"), array("q"), 0
        self._contacts: dict[tuple[str, str, float], _Contact] = {}
        self._links: dict[str, tuple[tuple[str, ...], array[float]]] = {}
        self._order: list[_Contact] = []
        self._instant = 0

    def note(self, raw: bytes) -> None:
        """Count a message, read or not; raw: serialised message."""
        number, seconds, nanoseconds = (int.from_bytes(raw[k : k + 4], "little") for k in (0, 4, 8))
        self._numbers.append(number)
        self._all_stamps.append(seconds + 1e-9 * nanoseconds)
        self._silent += raw[-8:] == bytes(8) and len(raw) == 24 + int.from_bytes(raw[12:16], "little")

    def stream(self, robot_time: Callable[[float], float]) -> ContactStream:
        """Return the stream of recorded messages."""
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
        begin = round(contact.begin, 6) if math.isfinite(contact.begin) else math.inf
        known = self._contacts.setdefault((contact.link, contact.other, begin), _Contact(contact))
        known.interrupted |= bool(known.rows) and self._instant > known.instant + 1
        known.last, known.instant = contact, self._instant
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
        """Return forces at the times of the messages; a peak between two messages counts at the later one."""
        time = times(self._stamps, robot_time)
        records, n = dict[str, ContactRecord](), len(time)
        for link, (regions, values) in self._links.items():
            record = ContactRecord(link, regions, time, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
            for index, stamp, force, *where in np.array(values).reshape(-1, 9).tolist():
                at = int(index)
                if not math.isnan(stamp):
                    at = min(int(np.searchsorted(time, robot_time(stamp))), at)
                if force > record.force[at]:
                    record.force[at], record.point[at], record.normal[at] = force, where[:3], where[3:]
            records[link] = record
        return records

    def meetings(self, robot_time: Callable[[float], float]) -> list[RegionForce]:
        """Return all contacts in the order in which they ended; those that did not end come last."""
        open_contacts = [contact for contact in self._contacts.values() if not contact.ended]
        return [self._meeting(contact, robot_time) for contact in (*self._order, *open_contacts)]

    def _meeting(self, contact: _Contact, robot_time: Callable[[float], float]) -> RegionForce:
        last, rows = contact.last, np.array(contact.rows).reshape(-1, 11)
        kind = last.kind if len(contact.kinds) == 1 else " and ".join(sorted(contact.kinds))
        known = kind == "penalty"
        profile = Course(
            times(rows[:, 0], robot_time),
            rows[:, 1],
            rows[:, 2],
            times(rows[:, 3], robot_time),
            rows[:, 4],
            rows[:, 5:8],
            rows[:, 8:],
        )
        stated = math.isfinite(last.begin)  # else it begins with its first message, of unknown duration
        return RegionForce(
            tuple(contact.regions),
            last.link,
            last.other,
            kind,
            robot_time(last.begin) if stated else float(profile.time[0]),
            float(last.duration) if stated else math.nan,
            float(last.peak) if known else None,
            robot_time(last.peak_time) if known else None,
            float(last.impulse) if known else None,
            _known(last.begin_point),
            _known(last.begin_normal),
            None if math.isnan(last.begin_speed) else float(last.begin_speed),
            profile,
            contact.sides.copy().pop() if len(contact.sides) == 1 else None,
            None if math.isnan(contact.area) or contact.area == math.inf else float(contact.area),
            contact.ended,
            contact.interrupted,
        )


def _known(v: Any) -> Vector | None:
    return None if math.isnan(v.x) else xyz(v)
