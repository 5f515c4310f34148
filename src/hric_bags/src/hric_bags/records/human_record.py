"""Record of a simulated person in a run, from topics in the person's namespace in a bag. No ROS."""

import math
from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from struct import unpack_from
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, opened, seconds
from hric_bags.records import RecordedHumanEvent
from hric_bags.records.muscle_record import MuscleMessages, MuscleRecord
from hric_bags.records.region_contacts import (
    CONTACTS_TYPE,
    ContactRecord,
    ContactStream,
    RegionMessages,
)
from hric_bags.records.root_record import RootRecord
from hric_bags.records.rows import RecordRows, Thinning, in_order, stamp_of, times, xyz, xyz_quaternion
from hric_human.contact import RegionContact

GRIP_TYPE, TORQUE_TYPE = "hric_msgs/msg/HumanGrip", "hric_msgs/msg/JointTorque"
EVENT_TYPE = "hric_msgs/msg/HumanEvent"
STATES_TYPE, ROOT_TYPE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
TYPES = (GRIP_TYPE, TORQUE_TYPE, EVENT_TYPE, CONTACTS_TYPE)
REAL = "/hric/person/"
"""Part of the names of a real person's topics, which are not those of a simulated person."""


@dataclass(frozen=True)
class GripRecord:
    """Record of one grip, by which a hand holds an object or handle, over time.

    Attributes:
        name, held, holder: names of the grip, of the held body and of the body that holds it.
        time: robot time, shape (n,) [s].
        closed: True while the grip is closed and its point is known, as it is from its first step on, shape (n,).
        force, torque: wrench on the holder, world frame, shape (n, 3) [N], [N m].
        point: point at which the wrench acts, world frame, shape (n, 3) [m].
        slipped: distance slipped since the grip closed, shape (n,) [m].
        left_out: largest force of the messages that were left out [N], and its robot time [s].
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
    left_out: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class HumanRecord:
    """Record of one person in one run; data that the bag does not have are empty.

    Attributes:
        joints: joint names.
        time: robot time, shape (n,) [s].
        position: joint positions, shape (n, j) [rad].
        torque_time: robot time of the rows of `torque`, shape (m,) [s].
        torque: joint torques, shape (m, j) [N m].
        share: torque as a share of the joint's strength, shape (m, j) [1].
        clipped: number of times each joint was limited to its strength.
        grips: grips by name.
        contacts: contacts with a force, by link.
        events: events in order of time.
        region_contacts: contacts with begin and peak, in the order in which they ended.
        muscles: muscle data; None: the body has no muscles.
        root: root pose of a walking person; None: the person's root does not move.
        name: namespace of the person.
        stream: times and losses of the recorded contact messages; None: the bag has no such topic.
        share_left_out: largest absolute share of strength of the messages that were left out, shape (j,) [1].
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
    events: list[RecordedHumanEvent] = field(default_factory=list)
    region_contacts: list[RegionContact] = field(default_factory=list)
    muscles: MuscleRecord | None = None
    root: RootRecord | None = None
    name: str = ""
    stream: ContactStream | None = None
    share_left_out: FloatArray | float = 0.0


def read(bag: Path | Bag, robot_time: Callable[[float], float]) -> HumanRecord | None:
    """Read the first person in a bag; None: the bag has no person with torques and at least two instants."""
    with opened(bag) as reader:
        names = human_names(reader.connections)
        if not names:
            return None
        messages = HumanMessages(names[0])
        muscles = MuscleMessages({names[0]})
        for connection, _, raw in reader.chosen(
            lambda candidate: messages.wants(candidate) or muscles.wants(candidate)
        ):
            message = reader.deserialize(raw, connection.msgtype)
            if messages.wants(connection):
                messages.note(connection, raw)
                messages.add(connection.topic, connection.msgtype, message)
            else:
                muscles.add(connection.topic, message)
    record = messages.record(robot_time)
    if len(record.time) < 2 or not len(record.torque_time):
        return None
    return replace(record, muscles=muscles.record(robot_time))


def human_names(connections: Iterable[Any]) -> list[str]:
    """Return the namespaces of persons with recorded torques, grips or contacts, simulated persons first.

    A contact topic that is not named `contacts` counts as a namespace itself.
    """
    names = set[str]()
    for connection in connections:
        name, _, end = connection.topic.rpartition("/")
        if connection.msgtype == CONTACTS_TYPE:
            names.add(name if end == "contacts" else connection.topic)
        elif connection.msgtype in (TORQUE_TYPE, GRIP_TYPE) and REAL not in connection.topic:
            names.add(name)
    return sorted(names, key=lambda name: (_is_real(name), name))


def _is_real(name: str) -> bool:
    """Return True for the namespace of a real person, whose motion other code reads."""
    return REAL in f"{name}/"


class HumanMessages:
    """Collector of the messages of one person; only numbers are stored, so that an hour fits into memory.

    The largest grip forces and shares of strength are those of all messages, at any rate.

    Args:
        name: namespace of the person.
        rate: highest rate at which joint states, torques, root poses and each grip are stored [Hz]; None: all. All
            other messages are stored.
    """

    def __init__(self, name: str, rate: float | None = None) -> None:
        self.name = name
        self._states, self._torques, self._roots = (f"{name}/{end}" for end in ("joint_states", "joint_torque", "root"))
        if _is_real(name):
            self._states = self._torques = self._roots = ""
        self._others = {f"{name}/{end}" for end in ("grip", "events", "contacts")} | {name}
        self._thin = None if rate is None else Thinning(rate)
        self._position, self._torque = RecordRows("position"), RecordRows("torque", "strength_share")
        self._root_stamps, self._root, self._frames = array("d"), array("d"), dict[str, None]()
        self._grips: dict[str, _Grips] = {}
        self._shares = _Shares()
        self._events: list[tuple[float, Any]] = []
        self._contacts: RegionMessages | None = None

    def wants(self, connection: Any) -> bool:
        """Return True if a connection has messages of this person that are collected."""
        return self.takes(connection.topic, connection.msgtype)

    def takes(self, topic: str, kind: str) -> bool:
        """Return True if messages of a topic and type are collected for this person."""
        kinds = {self._states: STATES_TYPE, self._torques: TORQUE_TYPE, self._roots: ROOT_TYPE}
        return kinds.get(topic) == kind or (topic in self._others and kind in (GRIP_TYPE, EVENT_TYPE, CONTACTS_TYPE))

    def note(self, connection: Any, raw: bytes) -> None:
        """Take from a message what counts even if `due` leaves it out; raw: serialised message."""
        if connection.msgtype == CONTACTS_TYPE:
            self._contacts = self._contacts or RegionMessages()
            self._contacts.note(raw)
        elif self._thin is None:
            return
        elif connection.msgtype == GRIP_TYPE:
            name, end = _text(raw, _text(raw, 12)[1])
            if (grip := self._grips.get(name.decode())) is not None:
                grip.note(raw, end)
        elif connection.topic == self._torques:
            self._shares.note(raw)

    def due(self, connection: Any, raw: bytes) -> bool:
        """Return True if a message has to be read at the limited rate; raw: serialised message."""
        if self._thin is None or connection.msgtype in (EVENT_TYPE, CONTACTS_TYPE):
            return True
        name = _text(raw, _text(raw, 12)[1])[0] if connection.msgtype == GRIP_TYPE else b""
        return self._thin.due((connection.topic, name), raw)

    def add(self, topic: str, kind: str, message: Any) -> None:
        """Add a message of this person."""
        stamp = seconds(message.header.stamp)
        if topic == self._states:
            self._position.add(stamp, message)
        elif topic == self._torques:
            self._torque.add(stamp, message)
        elif topic == self._roots:
            self._root_stamps.append(stamp)
            self._root.extend(xyz_quaternion(message.pose))
            self._frames[str(message.header.frame_id).strip("/")] = None
        elif kind == GRIP_TYPE:
            self._grips.setdefault(message.name, _Grips(message)).add(stamp, message)
        elif kind == EVENT_TYPE:
            self._events.append((stamp, message))
        elif self._contacts is not None:
            self._contacts.add(stamp, message)

    def record(self, robot_time: Callable[[float], float]) -> HumanRecord:
        """Return the person's record from all messages; robot_time: function from stamps to robot time [s]."""
        position, torque, contacts = self._position, self._torque, self._contacts or RegionMessages()
        time, q = position.columns(robot_time)
        torque_time, tau, share = torque.columns(robot_time)
        joints = () if position.last is None else tuple(position.last.name)
        names = [] if torque.last is None else list(torque.last.name)
        tau, share = (_sorted(values, names, joints) for values in (tau, share))
        return HumanRecord(
            joints,
            time,
            q,
            torque_time,
            tau,
            share,
            {} if torque.last is None else dict(zip(torque.last.name, map(int, torque.last.clipped), strict=True)),
            {name: grips.record(robot_time) for name, grips in self._grips.items()},
            contacts.by_link(robot_time),
            [
                RecordedHumanEvent(robot_time(stamp), m.kind, m.name, float(m.value), m.text)
                for stamp, m in self._events
            ],
            contacts.region_contacts(robot_time),
            root=self._root_record(robot_time),
            name=self.name,
            stream=None if self._contacts is None else contacts.stream(robot_time),
            share_left_out=_sorted(self._shares.largest[None], self._shares.names, joints)[0],
        )

    def _root_record(self, robot_time: Callable[[float], float]) -> RootRecord | None:
        if not self._root_stamps:
            return None
        time, pose = in_order(times(self._root_stamps, robot_time), np.array(self._root).reshape(-1, 7))
        return RootRecord(time, pose, frame=" and ".join(self._frames))


def _sorted(values: FloatArray, names: list[str], joints: Iterable[str]) -> FloatArray:
    """Return the columns of some joints, shape (n, joints); NaN where `names`, the names of the columns, lack one."""
    columns = [names.index(joint) if joint in names else len(names) for joint in joints]
    return np.hstack([values, np.full((len(values), 1), np.nan)])[:, columns]


def _text(raw: bytes, begin: int) -> tuple[bytes, int]:
    """Return a text of a serialised message, and its end; begin: index of its length."""
    end = begin + 4 + int.from_bytes(raw[begin : begin + 4], "little")
    return bytes(raw[begin + 4 : end]), end


class _Shares:
    """Largest absolute shares of strength of serialised messages of joint torques with the same header and names.

    Attributes:
        names: joint names of these messages.
        largest: largest share of each joint, shape (j,) [1].
    """

    def __init__(self) -> None:
        self._head, self.names, self.largest = b"", list[str](), np.zeros(0)

    def note(self, raw: bytes) -> None:
        """Take the shares of a message."""
        if not self.names:
            end = _text(raw, 12)[1] + 4
            for _ in range(int.from_bytes(raw[end - 4 : end], "little")):
                name, end = _text(raw, end)
                self.names.append(name.decode())
            self._head, self.largest = bytes(raw[12:end]), np.zeros(len(self.names))
        at, n = 20 + len(self._head) + 8 * len(self.names), len(self.names)
        if raw[12 : 12 + len(self._head)] == self._head and raw[at - 4 : at] == n.to_bytes(4, "little"):
            self.largest = np.fmax(self.largest, np.abs(np.frombuffer(raw, "<f8", n, at)))


class _Grips:
    """Collector of the messages of one grip; first: the first of them."""

    def __init__(self, first: Any) -> None:
        self._first, self._stamps, self._rows, self._largest = first, array("d"), array("d"), (0.0, 0.0)

    def add(self, stamp: float, m: Any) -> None:
        self._stamps.append(stamp)
        self._rows.extend((m.closed, m.slipped, *xyz(m.wrench.force), *xyz(m.wrench.torque), *xyz(m.point)))

    def note(self, raw: bytes, end: int) -> None:
        """Take the force of a serialised message; end: end of its name."""
        at = _text(raw, _text(raw, end)[1])[1]
        force = math.hypot(*unpack_from("<3d", raw, at + 1)) if raw[at] else 0.0
        if not (force <= self._largest[0] or math.isnan(self._largest[0])):
            self._largest = force, 1e-9 * stamp_of(raw)

    def record(self, robot_time: Callable[[float], float]) -> GripRecord:
        time, rows = in_order(times(self._stamps, robot_time), np.array(self._rows).reshape(-1, 11))
        m, closed = self._first, (rows[:, 0] > 0.0) & rows[:, 8:].any(axis=1)
        force, torque, point = rows[:, 2:5], rows[:, 5:8], rows[:, 8:]
        largest = self._largest[0], robot_time(self._largest[1])
        return GripRecord(m.name, m.held, m.holder, time, closed, force, torque, point, rows[:, 1], largest)
