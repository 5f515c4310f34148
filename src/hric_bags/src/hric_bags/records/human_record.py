"""What a simulated human did in a run, from the topics in its bag. No ROS."""

import math
from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, opened, seconds
from hric_bags.records.muscle_record import MuscleMessages, MuscleRecord
from hric_control.geometry import Vector

GRIP_TYPE, TORQUE_TYPE = "hric_msgs/msg/HumanGrip", "hric_msgs/msg/JointTorque"
EVENT_TYPE, CONTACTS_TYPE = "hric_msgs/msg/HumanEvent", "hric_msgs/msg/RegionContacts"
NONE_ENDED = bytes(4)
"""At the end of a serialised RegionContacts in which nothing has ended."""
BLOW = 600_000_000
"""Contacts that last longer are no blow any more [ns]."""
REAL = "/hric/person/"
"""In topics of a real person before the cameras, which are none of the simulated human."""


@dataclass(frozen=True)
class GripRecord:
    """One grip over time.

    Attributes:
        name, held, holder: of it and of both bodies.
        time: robot time, shape (n,) [s].
        closed: whether it held and has said where, which it does from its first step on, shape (n,).
        force, torque: on the holder, world frame, shape (n, 3) [N], [N m].
        point: where they act, world frame, shape (n, 3) [m].
        slipped: since it was closed, shape (n,) [m].
    """

    name: str
    held: str
    holder: str
    time: FloatArray
    closed: npt.NDArray[np.bool_]
    force: FloatArray
    torque: FloatArray
    point: FloatArray
    slipped: FloatArray


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
class Event:
    """Something that happened. Attributes: see hric_msgs/HumanEvent; time: robot time [s]."""

    time: float
    kind: str
    name: str
    value: float
    text: str


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


@dataclass(frozen=True)
class HumanRecord:
    """Of one run.

    Attributes:
        joints: names.
        time: robot time, shape (n,) [s].
        position: of the joints, shape (n, j) [rad].
        torque_time: of the rows of `torque`, shape (m,) [s].
        torque: shape (m, j) [N m].
        share: of the joint's strength, shape (m, j) [1].
        clipped: how often each joint came to its strength.
        grips: by name.
        contacts: with a force, by link.
        events: in order of time.
        meetings: contacts with their begin and peak, in the order in which they ended.
        muscles: None: his joints have none.
    """

    joints: tuple[str, ...]
    time: FloatArray
    position: FloatArray
    torque_time: FloatArray
    torque: FloatArray
    share: FloatArray
    clipped: dict[str, int]
    grips: dict[str, GripRecord] = field(default_factory=dict)
    contacts: dict[str, ContactRecord] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    meetings: list[RegionForce] = field(default_factory=list)
    muscles: MuscleRecord | None = None


def read(bag: Path | Bag, robot_time: Callable[[float], float]) -> HumanRecord | None:
    """What the bag has of a human; None: nothing, or only his events."""
    with opened(bag) as reader:
        messages = HumanMessages(reader.connections)
        muscles = MuscleMessages(messages.names)
        for connection, _, raw in reader.chosen(lambda one: messages.wants(one) or muscles.wants(one)):
            message = reader.deserialize(raw, connection.msgtype)
            if messages.wants(connection):
                messages.add(connection.topic, connection.msgtype, message)
            else:
                muscles.add(connection.topic, message)
    found = messages.record(robot_time)
    return found and replace(found, muscles=muscles.record(robot_time))


class HumanMessages:
    """Takes messages of a human as they come, and keeps their numbers alone: an hour of them fits into memory.

    Args:
        connections: of the bag.
        rate: of joint states, torques and contacts that last, of which no more are kept [Hz]; None: all. All else is
            kept.

    Attributes:
        names: of humans, what their topics begin with.
    """

    def __init__(self, connections: Iterable[Any], rate: float | None = None) -> None:
        torques = {c.topic for c in connections if c.msgtype == TORQUE_TYPE and REAL not in c.topic}
        self.names = {topic.rpartition("/")[0] for topic in torques}
        self._torques, self._states = torques, {f"{name}/joint_states" for name in self.names}
        self._period = 0 if rate is None else round(0.99e9 / rate)
        self._last: dict[str, int] = {}
        self._position, self._torque = _Rows("position"), _Rows("torque", "strength_share")
        self._grips: dict[str, _Grips] = {}
        self._events: list[tuple[float, Any]] = []
        self._contacts, self._pressing = _Contacts(), _Pressing()

    def wants(self, connection: Any) -> bool:
        """Whether a connection is one of a human."""
        return self.takes(connection.topic, connection.msgtype)

    def takes(self, topic: str, kind: str) -> bool:
        """Whether a topic is one of a human."""
        return kind in (GRIP_TYPE, EVENT_TYPE, CONTACTS_TYPE) or topic in self._torques | self._states

    def due(self, topic: str, kind: str, stamp: int, raw: bytes) -> bool:
        """Whether a message is needed at this rate; stamp: of its recording [ns]."""
        if not self._period:
            return True
        if kind == CONTACTS_TYPE:
            return self._pressing.due(stamp, raw, self._period)
        if topic not in self._torques | self._states:
            return True
        if stamp - self._last.get(topic, -self._period) < self._period:
            return False
        self._last[topic] = stamp
        return True

    def add(self, topic: str, kind: str, message: Any) -> None:
        """Take one."""
        stamp = seconds(message.header.stamp)
        if topic in self._states:
            self._position.add(stamp, message)
        elif kind == TORQUE_TYPE:
            self._torque.add(stamp, message)
        elif kind == GRIP_TYPE:
            self._grips.setdefault(message.name, _Grips(message)).add(stamp, message)
        elif kind == EVENT_TYPE:
            self._events.append((stamp, message))
        elif kind == CONTACTS_TYPE:
            self._contacts.add(stamp, message)

    def record(self, robot_time: Callable[[float], float]) -> HumanRecord | None:
        """All that was taken; None: no motion."""
        position, torque = self._position, self._torque
        if position.last is None or torque.last is None:
            return None
        time, q = position.columns(robot_time)
        torque_time, tau, share = torque.columns(robot_time)
        return HumanRecord(
            tuple(position.last.name),
            time,
            q,
            torque_time,
            tau,
            share,
            dict(zip(torque.last.name, map(int, torque.last.clipped), strict=True)),
            {name: grips.record(robot_time) for name, grips in self._grips.items()},
            self._contacts.by_link(robot_time),
            [Event(robot_time(stamp), m.kind, m.name, float(m.value), m.text) for stamp, m in self._events],
            self._contacts.meetings(robot_time),
        )


class _Pressing:
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


class _Rows:
    """Rows of arrays of one length, and the last message.

    Args:
        fields: of the messages.
    """

    def __init__(self, *fields: str) -> None:
        self._fields, self._stamps = fields, array("d")
        self._values = {name: array("d") for name in fields}
        self.last: Any = None

    def add(self, stamp: float, message: Any) -> None:
        self._stamps.append(stamp)
        for name, values in self._values.items():
            values.frombytes(np.asarray(getattr(message, name), dtype=float).tobytes())
        self.last = message

    def columns(self, robot_time: Callable[[float], float]) -> list[FloatArray]:
        """Times, and the values of each field, shape (n, j)."""
        n = len(self._stamps)
        return [_times(self._stamps, robot_time), *(np.array(v).reshape(n, -1) for v in self._values.values())]


def _times(stamps: Iterable[float], robot_time: Callable[[float], float]) -> FloatArray:
    return np.array([robot_time(stamp) for stamp in stamps])


def _xyz(v: Any) -> Vector:
    return v.x, v.y, v.z


class _Contacts:
    """Of all messages, in their order."""

    def __init__(self) -> None:
        self._stamps = array("d")
        self._courses: dict[tuple[str, str, float], array[float]] = {}
        self._links: dict[str, tuple[tuple[str, ...], array[float]]] = {}
        self._ended: list[Any] = []
        self._touching: list[Any] = []

    def add(self, stamp: float, message: Any) -> None:
        index = len(self._stamps)
        self._stamps.append(stamp)
        for one in message.touching:
            course = self._courses.setdefault((one.link, one.other, one.begin), array("d"))
            course.extend((stamp, one.force, one.peak, *_xyz(one.point), *_xyz(one.normal)))
            self._strongest(one, index, math.nan, one.force)
        for one in message.ended:
            if one.kind == "penalty":
                self._strongest(one, index, one.peak_time, one.peak)
        self._ended += message.ended
        self._touching = list(message.touching)

    def _strongest(self, one: Any, index: int, stamp: float, force: float) -> None:
        if force > 0.0:  # not of a rigid contact, which is NaN
            _, rows = self._links.setdefault(one.link, (tuple(one.regions), array("d")))
            rows.extend((index, stamp, force, *_xyz(one.point), *_xyz(one.normal)))

    def by_link(self, robot_time: Callable[[float], float]) -> dict[str, ContactRecord]:
        """Forces at the times of the messages, and at the one after it each contact's peak, which may lie between
        two."""
        time = _times(self._stamps, robot_time)
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
        course = Course(_times(rows[:, 0], robot_time), rows[:, 1], rows[:, 2], rows[:, 3:6], rows[:, 6:])
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
    return None if math.isnan(v.x) else _xyz(v)


class _Grips:
    """Of one grip; first: its first message."""

    def __init__(self, first: Any) -> None:
        self._first, self._stamps, self._rows = first, array("d"), array("d")

    def add(self, stamp: float, m: Any) -> None:
        self._stamps.append(stamp)
        self._rows.extend((m.closed, m.slipped, *_xyz(m.wrench.force), *_xyz(m.wrench.torque), *_xyz(m.point)))

    def record(self, robot_time: Callable[[float], float]) -> GripRecord:
        rows, m = np.array(self._rows).reshape(-1, 11), self._first
        force, torque, point = rows[:, 2:5], rows[:, 5:8], rows[:, 8:]
        time, closed = _times(self._stamps, robot_time), (rows[:, 0] > 0.0) & point.any(axis=1)
        return GripRecord(m.name, m.held, m.holder, time, closed, force, torque, point, rows[:, 1])
