"""Contacts of a simulated human with their courses, from hric_msgs/RegionContacts in a bag. No ROS."""

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_bags.reader import FloatArray
from hric_bags.records.rows import times, xyz
from hric_control.geometry import Vector

CONTACTS_TYPE = "hric_msgs/msg/RegionContacts"
NONE_ENDED = bytes(4)
"""At the end of a serialised RegionContacts in which nothing has ended."""
BLOW = 600_000_000
"""Contacts that last longer are no blow any more [ns]."""


@dataclass(frozen=True)
class ContactRecord:
    """Force on one link over time.

    Attributes:
        link: of the human.
        regions: of ISO/TS 15066 that it belongs to.
        time: robot time, shape (n,) [s].
        force: the largest that touches at an instant, or the peak of what has ended since the one before; 0: nothing
            touches, or only without a force that would mean something; shape (n,) [N].
        point: where it acts, world frame, shape (n, 3) [m].
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
    """A contact over time, at the instants of its messages.

    Attributes:
        time: robot time, shape (n,) [s].
        force: shape (n,) [N].
        reached: peak until then, of all cycles, shape (n,) [N].
        point, normal: as of ContactRecord, shape (n, 3).
    """

    time: FloatArray
    force: FloatArray
    reached: FloatArray
    point: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class RegionForce:
    """One contact of a region, from when they met until they parted or the run ended.

    Attributes:
        regions: of ISO/TS 15066 that the link belongs to.
        link, other: of the human, and what touched it.
        kind: "penalty", or "rigid": without a force.
        begin: robot time [s].
        duration: [s].
        peak, peak_time, impulse: of the normal force; None: rigid [N], [s], [N s].
        point, normal: where they met, and the unit vector along which the force then acted on the human, world frame, 3
            floats each [m]; None: not known.
        speed: along the normal at which they met [m/s]; None: rigid, or not known.
        course: empty of what was between two messages.
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
    course: Course

    @property
    def end(self) -> float:
        """Robot time [s]."""
        return self.begin + self.duration


class Pressing:
    """Finds messages of contacts that go on: as many as in the one before, none ended, for longer than a blow."""

    def __init__(self) -> None:
        self._shape: tuple[int, bytes] = 0, b""
        self._since = self._last = 0

    def due(self, stamp: int, raw: bytes, period: int) -> bool:
        """Whether one is needed; period: shortest between two of contacts that go on [ns]."""
        frame = int.from_bytes(raw[12:16], "little")
        shape = len(raw), bytes(raw[16 + frame : 20 + frame])  # how many touch
        if shape != self._shape or raw[-4:] != NONE_ENDED:
            self._shape, self._since, self._last = shape, stamp, stamp
            return True
        if stamp - self._since > BLOW and stamp - self._last < period:
            return False
        self._last = stamp
        return True


class RegionMessages:
    """Of all messages, in their order."""

    def __init__(self) -> None:
        self._stamps = array("d")
        self._courses: dict[tuple[str, str, float], array[float]] = {}
        self._links: dict[str, tuple[tuple[str, ...], array[float]]] = {}
        self._ended: list[Any] = []
        self._touching: list[Any] = []

    def add(self, stamp: float, message: Any) -> None:
        """Take one; stamp: of its header [s]."""
        index = len(self._stamps)
        self._stamps.append(stamp)
        for one in message.touching:
            course = self._courses.setdefault((one.link, one.other, one.begin), array("d"))
            course.extend((stamp, one.force, one.peak, *xyz(one.point), *xyz(one.normal)))
            self._strongest(one, index, math.nan, one.force)
        for one in message.ended:
            if one.kind == "penalty":
                self._strongest(one, index, one.peak_time, one.peak)
        self._ended += message.ended
        self._touching = list(message.touching)

    def _strongest(self, one: Any, index: int, stamp: float, force: float) -> None:
        if force > 0.0:  # not of a rigid contact, which is NaN
            _, rows = self._links.setdefault(one.link, (tuple(one.regions), array("d")))
            rows.extend((index, stamp, force, *xyz(one.point), *xyz(one.normal)))

    def by_link(self, robot_time: Callable[[float], float]) -> dict[str, ContactRecord]:
        """Forces at the times of the messages, and at the one after it each contact's peak, which may lie between
        two."""
        time = times(self._stamps, robot_time)
        found, n = dict[str, ContactRecord](), len(time)
        for link, (regions, values) in self._links.items():
            kept = ContactRecord(link, regions, time, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
            for index, stamp, force, *where in np.array(values).reshape(-1, 9).tolist():
                at = int(index)
                if not math.isnan(stamp):
                    at = min(int(np.searchsorted(time, robot_time(stamp))), at)
                if force > kept.force[at]:
                    kept.force[at], kept.point[at], kept.normal[at] = force, where[:3], where[3:]
            found[link] = kept
        return found

    def meetings(self, robot_time: Callable[[float], float]) -> list[RegionForce]:
        """Each contact, in the order in which they ended."""
        return [self._meeting(one, robot_time) for one in (*self._ended, *self._touching)]

    def _meeting(self, one: Any, robot_time: Callable[[float], float]) -> RegionForce:
        known = one.kind == "penalty"
        rows = np.array(self._courses.get((one.link, one.other, one.begin), [])).reshape(-1, 9)
        course = Course(times(rows[:, 0], robot_time), rows[:, 1], rows[:, 2], rows[:, 3:6], rows[:, 6:])
        return RegionForce(
            tuple(one.regions),
            one.link,
            one.other,
            one.kind,
            robot_time(one.begin),
            float(one.duration),
            float(one.peak) if known else None,
            robot_time(one.peak_time) if known else None,
            float(one.impulse) if known else None,
            _known(one.begin_point),
            _known(one.begin_normal),
            None if math.isnan(one.begin_speed) else float(one.begin_speed),
            course,
        )


def _known(v: Any) -> Vector | None:
    return None if math.isnan(v.x) else xyz(v)
