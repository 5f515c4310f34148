"""What a simulated human did in a run, from the topics in its bag. No ROS."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import PartsReader
from hric_bags.reader import FloatArray, opened, seconds
from hric_control.geometry import Vector
from hric_experiments.analysis import muscle_record
from hric_experiments.analysis.muscle_record import MuscleRecord

GRIP_TYPE, TORQUE_TYPE = "hric_msgs/msg/HumanGrip", "hric_msgs/msg/JointTorque"
EVENT_TYPE, CONTACTS_TYPE = "hric_msgs/msg/HumanEvent", "hric_msgs/msg/RegionContacts"
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
        muscles: that moved him; None: his joints did.
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


def read(bag: Path | PartsReader, robot_time: Callable[[float], float]) -> HumanRecord | None:
    """What the bag has of a human; None: nothing, or only his events."""
    found: dict[str, list[tuple[float, Any]]] = {
        kind: [] for kind in (GRIP_TYPE, TORQUE_TYPE, EVENT_TYPE, CONTACTS_TYPE)
    }
    states: list[tuple[float, Any]] = []
    muscles: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in muscle_record.TOPICS}
    with opened(bag) as reader:
        torque_topics = {c.topic for c in reader.connections if c.msgtype == TORQUE_TYPE and REAL not in c.topic}
        his = {topic.rpartition("/")[0] for topic in torque_topics}
        by_topic = {f"{name}/joint_states": states for name in his}
        by_topic |= {f"{name}/{topic}": rows for name in his for topic, rows in muscles.items()}
        topics = torque_topics | set(by_topic)
        kinds = set(found) - {TORQUE_TYPE}
        for connection, _, raw in reader.chosen(lambda c: c.msgtype in kinds or c.topic in topics):
            message = reader.deserialize(raw, connection.msgtype)
            rows = found[connection.msgtype] if connection.msgtype in found else by_topic[connection.topic]
            rows.append((robot_time(seconds(message.header.stamp)), message))
    if not states or not found[TORQUE_TYPE]:
        return None
    names, torques = tuple(states[0][1].name), found[TORQUE_TYPE]
    time, position = _columns(states, "position")
    torque_time, torque, share = _columns(torques, "torque", "strength_share")
    return HumanRecord(
        names,
        time,
        position,
        torque_time,
        torque,
        share,
        dict(zip(torques[-1][1].name, map(int, torques[-1][1].clipped), strict=True)),
        _grips(found[GRIP_TYPE]),
        _contacts(found[CONTACTS_TYPE], robot_time),
        [Event(time, m.kind, m.name, float(m.value), m.text) for time, m in found[EVENT_TYPE]],
        _meetings(found[CONTACTS_TYPE], robot_time),
        muscle_record.made(muscles),
    )


def _meetings(rows: list[tuple[float, Any]], robot_time: Callable[[float], float]) -> list[RegionForce]:
    courses: dict[tuple[str, str, float], list[tuple[float, Any]]] = {}
    for time, message in rows:
        for one in message.touching:
            courses.setdefault((one.link, one.other, one.begin), []).append((time, one))
    over = [*(one for _, message in rows for one in message.ended), *(rows[-1][1].touching if rows else ())]
    return [_meeting(one, courses.get((one.link, one.other, one.begin), []), robot_time) for one in over]


def _meeting(one: Any, seen: list[tuple[float, Any]], robot_time: Callable[[float], float]) -> RegionForce:
    known = one.kind == "penalty"
    time, force, reached = _columns(seen, "force", "peak")
    course = Course(time, force, reached, _vectors([m.point for _, m in seen]), _vectors([m.normal for _, m in seen]))
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
    return None if math.isnan(v.x) else (float(v.x), float(v.y), float(v.z))


def _vectors(found: Sequence[Any]) -> FloatArray:
    """Shape (n, 3)."""
    return np.array([(v.x, v.y, v.z) for v in found]).reshape(-1, 3)


def _columns(rows: list[tuple[float, Any]], *fields: str) -> list[FloatArray]:
    """Times, and the values of each field."""
    values = [np.array([getattr(message, name) for _, message in rows], dtype=float) for name in fields]
    return [np.array([time for time, _ in rows]), *values]


def _grips(rows: list[tuple[float, Any]]) -> dict[str, GripRecord]:
    by_name: dict[str, list[tuple[float, Any]]] = {}
    for row in rows:
        by_name.setdefault(row[1].name, []).append(row)
    return {name: _grip(name, own) for name, own in by_name.items()}


def _contacts(rows: list[tuple[float, Any]], robot_time: Callable[[float], float]) -> dict[str, ContactRecord]:
    """Forces at the times of the messages, and at the one after it each contact's peak, which may lie between two."""
    time, found = np.array([time for time, _ in rows]), dict[str, ContactRecord]()
    n = len(time)
    for index, (_, message) in enumerate(rows):
        forces = [(one, index, one.force) for one in message.touching]
        for one in message.ended:
            if one.kind == "penalty":
                at = min(int(np.searchsorted(time, robot_time(one.peak_time))), index)
                forces.append((one, at, one.peak))
        for one, at, force in forces:
            if force > 0.0:  # not of a rigid contact, which is NaN
                new = ContactRecord(one.link, tuple(one.regions), time, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))
                kept = found.setdefault(one.link, new)
                if force > kept.force[at]:
                    kept.force[at], kept.point[at], kept.normal[at] = force, *_vectors([one.point, one.normal])
    return found


def _grip(name: str, rows: list[tuple[float, Any]]) -> GripRecord:
    def vectors(of: Callable[[Any], Any]) -> FloatArray:
        return _vectors([of(message) for _, message in rows])

    time, closed, slipped = _columns(rows, "closed", "slipped")
    point = vectors(lambda m: m.point)
    return GripRecord(
        name,
        rows[0][1].held,
        rows[0][1].holder,
        time,
        (closed > 0.0) & point.any(axis=1),
        vectors(lambda m: m.wrench.force),
        vectors(lambda m: m.wrench.torque),
        point,
        slipped,
    )
