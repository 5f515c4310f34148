"""Reader of everything in a bag that an assessment needs, in one pass: arm, persons, contacts. No ROS.

Streams are stored at a limited rate, so that an hour fits into memory.
"""

import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.parts import Bag
from hric_bags.reader import (
    ARRAYS,
    LOG_TYPE,
    BagError,
    ControlRecord,
    FloatArray,
    RobotTime,
    opened,
    robot_time_of,
    seconds,
)
from hric_bags.records import one_publisher
from hric_bags.records.contact_record import CONTACTS_TYPE as PAIRS_TYPE
from hric_bags.records.contact_record import PairForce, add_to
from hric_bags.records.human_record import TORQUE_TYPE, HumanMessages, HumanRecord, human_names
from hric_bags.records.one_publisher import JOINTS, RecordedJointStates, RisingStamps, check_names, publishers
from hric_bags.records.rows import Thinning, in_order, times, xyz, xyz_quaternion
from hric_bags.records.safety_record import EVENT_TYPE, STATE_TYPE, SafetyMessages, SafetyRecord
from hric_core.geometry import Pose, normalized
from hric_core.geometry.poses import difference
from hric_human.body import Body

RATE = 100.0
"""Highest rate of a stored stream [Hz]; project default."""
SAMPLES = 150_000
"""Largest number of stored samples of a stream, so that an hour is stored at a lower rate; project default."""
STATES_TYPE, TRACKING_TYPE = "sensor_msgs/msg/JointState", "hric_msgs/msg/PersonTracking"
ACTIVATION_TYPE, STATIC_TYPE = "hric_msgs/msg/MuscleActivation", "tf2_msgs/msg/TFMessage"
REACTIONS_TYPE = "hric_msgs/msg/JointReactions"
TEXT_TYPE = "std_msgs/msg/String"
_THINNED = (STATES_TYPE, TRACKING_TYPE, ACTIVATION_TYPE, TORQUE_TYPE, REACTIONS_TYPE, STATE_TYPE)
NAMES = {TORQUE_TYPE: "name", ACTIVATION_TYPE: "name", REACTIONS_TYPE: "joint_names", LOG_TYPE: "joint_names"}
"""Message type -> field with names of joints or muscles, which must be unique in each message that is read."""
ONE_PUBLISHER = (LOG_TYPE, TORQUE_TYPE, TRACKING_TYPE, ACTIVATION_TYPE)
"""Message types that only one node may publish on one topic."""
MOVED = 1e-3
"""Largest difference of the poses of a frame that does not move [m], [rad] (project default)."""
LOST = "lost"
"""State of a tracked person whose pose in the message is not known."""
SLACK = 1.0
"""Time by which a bag may begin before, and end after, the samples of arm and persons without extending them [s].

Recorders are started first and stopped last (project default).
"""


@dataclass(frozen=True)
class Columns:
    """Named values of one topic over time.

    Attributes:
        topic: source topic.
        names: names of the columns.
        time: robot time, shape (n,) [s].
        values: values, shape (n, k); NaN if a message does not have one.
    """

    topic: str
    names: tuple[str, ...]
    time: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class TrackedRoot:
    """Root link of a real person over time.

    Attributes:
        topic: source topic.
        frame: tf frame in which the pose is given; of several in a recording, all of them.
        time: robot time, shape (n,) [s].
        pose: position [m] and quaternion x y z w, shape (n, 7); NaN while the person is lost.
        residual: distance between measured and model markers, root mean square, shape (n,) [m].
        calibrated: True if the body model was fitted to the person.
        deviation: standard deviation of each joint angle of the same person, shape (n, j) [rad]; None: not known.
        body: body that was fitted to the person; None: none was.
    """

    topic: str
    frame: str
    time: FloatArray
    pose: FloatArray
    residual: FloatArray
    calibrated: bool
    deviation: FloatArray | None = None
    body: Body | None = None


@dataclass(frozen=True)
class Recording:
    """Contents of one bag for an assessment; each stream has at most RATE and SAMPLES.

    Attributes:
        topics: number of messages by topic.
        kinds: message types in the bag.
        begin, end: robot time of the first and the last sample of arm or persons, or of a message of any topic that is
            more than SLACK beyond them [s].
        robot_time: function from stamps to robot time.
        log: control log of the arm; None: the bag has none.
        humans: simulated persons by namespace.
        pairs: pairs of bodies that touched, from /sim/contacts; None: the bag has no such topic.
        people: joint positions of persons, simulated or real, by topic.
        tracked: root poses of real persons, by topic.
        activation: muscle activations, by topic.
        contact: magnitude of the contact forces between bones [N], by topic; only with an activation in the same
            namespace.
        shares: joint torques of real persons as shares of joint strength [1], by topic.
        description: URDF of the robot; "": not in the bag, or there are several that differ.
        safety: decisions of a supervisor; None: there was no supervisor.
        static: poses of static tf frames in their parents, by (parent, child), without frames that have moved.
        mechanisms: names of joints in joint states that are not those of a person, by topic.
        notes: what was assumed and left out when the recording was read, one sentence each.
    """

    topics: dict[str, int]
    kinds: frozenset[str]
    begin: float
    end: float
    robot_time: RobotTime
    log: ControlRecord | None
    humans: dict[str, HumanRecord]
    pairs: list[PairForce] | None
    people: dict[str, Columns] = field(default_factory=dict)
    tracked: dict[str, TrackedRoot] = field(default_factory=dict)
    activation: dict[str, Columns] = field(default_factory=dict)
    contact: dict[str, Columns] = field(default_factory=dict)
    shares: dict[str, Columns] = field(default_factory=dict)
    description: str = ""
    static: dict[tuple[str, str], Pose] = field(default_factory=dict)
    safety: SafetyRecord | None = None
    mechanisms: dict[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read(bag: Path | Bag) -> Recording:
    """Read everything in a bag that an assessment needs, in one pass.

    Raises:
        BagError: the bag is missing or damaged, two persons share a namespace, or a clock goes back.
    """
    with opened(bag) as reader:
        seconds_long = 1e-9 * reader.duration if reader.message_count else 0.0
        taken = _Taken(reader, min(RATE, SAMPLES / max(seconds_long, 1.0)))
        for connection, _, raw in reader.chosen(taken.wants):
            taken.note(connection, raw)
            if taken.due(connection, raw):
                taken.add(connection.topic, connection.msgtype, reader.deserialize(raw, connection.msgtype))
        return taken.recording(reader)


class _Taken:
    """Collector of the messages in one pass over a bag."""

    def __init__(self, reader: Bag, rate: float) -> None:
        self._humans = [HumanMessages(name, rate) for name in human_names(reader.connections)]
        self._topics = {c.topic: human for human in self._humans for c in reader.connections if human.wants(c)}
        self._log, self._thin = _ThinLog(rate), Thinning(rate)
        self._people: dict[str, _Named | None] = {}
        self._activation: dict[str, _Named] = {}
        self._contact: dict[str, _Named] = {}
        self._beside = {c.topic.rpartition("/")[0] for c in reader.connections if c.msgtype == ACTIVATION_TYPE}
        self._shares: dict[str, _Named] = {}
        self._roots: dict[str, _Roots] = {}
        self._pairs: dict[tuple[str, str], PairForce] = {}
        self._static: dict[str, tuple[str, Pose]] = {}
        self._moved: dict[str, None] = {}
        self._safety = SafetyMessages()
        self._states: dict[str, RecordedJointStates] = {}
        self._clock = RisingStamps()
        self._descriptions: dict[str, None] = {}

    def wants(self, connection: Any) -> bool:
        if connection.msgtype == REACTIONS_TYPE:  # reactions of a robot's joints are in a namespace without muscles
            return str(connection.topic).rpartition("/")[0] in self._beside
        kinds = (*_THINNED, LOG_TYPE, PAIRS_TYPE, EVENT_TYPE)
        if connection.msgtype in kinds or connection.topic in self._topics:
            return True
        named = {TEXT_TYPE: ("/robot_description",), STATIC_TYPE: ("/tf", "/tf_static")}
        return str(connection.topic).endswith(named.get(connection.msgtype, ()))

    def note(self, connection: Any, raw: bytes) -> None:
        """Count a message, whether it is read or not, and check that joint states on its topic come from one body."""
        if connection.msgtype not in (TEXT_TYPE, STATIC_TYPE) and self._people.get(connection.topic, self) is not None:
            self._clock.note(connection, raw)
        if connection.msgtype == STATES_TYPE:
            self._states.setdefault(connection.topic, RecordedJointStates(connection.topic)).note(connection, raw)
        if connection.topic in self._topics:
            self._topics[connection.topic].note(connection, raw)

    def due(self, connection: Any, raw: bytes) -> bool:
        """Return True if a message has to be read at the limited rate."""
        if connection.topic in self._topics:
            return self._topics[connection.topic].due(connection, raw)
        if self._people.get(connection.topic, self) is None:
            return False
        if connection.topic.endswith("/tf"):
            return not self._static.keys().isdisjoint(_children(raw))
        return connection.msgtype not in _THINNED or self._thin.due(connection.topic, raw)

    def add(self, topic: str, kind: str, message: Any) -> None:
        if kind in NAMES:
            check_names(topic, getattr(message, NAMES[kind]))
        if kind == LOG_TYPE:
            self._log.add(message)
        elif topic in self._topics:
            self._topics[topic].add(topic, kind, message)
        elif kind == STATES_TYPE:
            self._add_states(topic, message)
        elif kind == ACTIVATION_TYPE:
            self._activation.setdefault(topic, _Named()).add(message, message.name, message.activation)
        elif kind == REACTIONS_TYPE:
            sizes = [math.hypot(*xyz(wrench.force)) for wrench in message.wrenches]
            self._contact.setdefault(topic, _Named()).add(message, message.joint_names, sizes)
        elif kind == TORQUE_TYPE:
            self._shares.setdefault(topic, _Named()).add(message, message.name, message.strength_share)
        elif kind == TRACKING_TYPE:
            self._roots.setdefault(topic, _Roots()).add(message)
        elif kind == PAIRS_TYPE:
            add_to(self._pairs, message, seconds(message.header.stamp))
        elif kind in (STATE_TYPE, EVENT_TYPE):
            self._safety.add(kind, message)
        elif kind == TEXT_TYPE:
            self._descriptions[str(message.data)] = None
        elif kind == STATIC_TYPE:
            for transform in message.transforms:
                self._note_frame(transform)

    def _note_frame(self, transform: Any) -> None:
        """Store the pose of a frame in its parent, or note that it has several parents or poses, or an invalid pose."""
        parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
        position, q = xyz(transform.transform.translation), transform.transform.rotation
        orientation = q.x, q.y, q.z, q.w
        if not any(orientation) or not all(map(math.isfinite, (*position, *orientation))):
            self._moved[child] = None
            return
        pose = Pose(position, normalized(orientation))
        first, T_first_child = self._static.setdefault(child, (parent, pose))
        if first != parent or any(abs(value) > MOVED for value in difference(T_first_child, pose)):
            self._moved[child] = None

    def _described(self, joints: Sequence[str]) -> tuple[str, tuple[str, ...]]:
        """Return the description with the arm's joints, "" if several differ, and notes on what is not used."""
        fitting = [text for text in self._descriptions if all(f'"{name}"' in text for name in joints)]
        known = fitting or [*self._descriptions]
        notes = [f"the frame {frame} has several or invalid poses in tf: it is not used" for frame in self._moved]
        if len(known) > 1:
            notes.append("the robot descriptions in the recording differ: none is used")
        return known[0] if len(known) == 1 else "", tuple(notes)

    def _add_states(self, topic: str, message: Any) -> None:
        if topic not in self._people and message.name:
            self._people[topic] = _Named() if JOINTS & set(message.name) else None
        if (named := self._people.get(topic)) is not None:
            named.add(message, message.name, message.position)

    def _check_publishers(self, reader: Bag) -> None:
        """Raise BagError if there are two control logs, or two publishers of one topic of an arm or a person."""
        for states in self._states.values():
            states.end()
        topics: dict[str, list[Any]] = {}
        for connection in reader.connections:
            if connection.msgcount and connection.msgtype in ONE_PUBLISHER:
                topics.setdefault(connection.topic, []).append(connection)
        for topic, connections in topics.items():
            if len(nodes := publishers(connections)) > 1:
                raise BagError(f"{topic}: two publishers, {' and '.join(nodes)}; valid: one, of one arm or one person")
        logs = sorted(topic for topic, (first, *_) in topics.items() if first.msgtype == LOG_TYPE)
        if len(logs) > 1:
            raise BagError(f"two control logs, {' and '.join(logs)}; valid: the bag of one arm")

    def recording(self, reader: Bag) -> Recording:
        """Return the recording of all messages.

        Raises:
            BagError: there are two control logs, or two publishers of one topic.
        """
        self._check_publishers(reader)
        topics = {topic: info.msgcount for topic, info in reader.topics.items()}
        first, last = (1e-9 * reader.start_time, 1e-9 * reader.end_time) if reader.message_count else (0.0, 0.0)
        robot_time = self._log.robot_time or (lambda stamp: stamp - first)
        pairs = [
            replace(pair, time=robot_time(pair.time), first=robot_time(pair.first), last=robot_time(pair.last))
            for _, pair in sorted(self._pairs.items())
        ]
        log = self._log.record()
        description, notes = self._described(() if log is None else log.joint_names)
        humans = {human.name: human.record(robot_time) for human in self._humans}
        people = _columns({topic: named for topic, named in self._people.items() if named is not None}, robot_time)
        streams = [human.time for human in humans.values()] + [columns.time for columns in people.values()]
        streams += [] if log is None else [log.time]
        streams += [human.stream.time for human in humans.values() if human.stream is not None]
        begin, end = robot_time(first), robot_time(last)
        if streams := [time for time in streams if len(time)]:
            begin = min(begin + SLACK, *(time[0] for time in streams))
            end = max(end - SLACK, *(time[-1] for time in streams))
        return Recording(
            topics,
            frozenset(connection.msgtype for connection in reader.connections),
            float(begin),
            float(end),
            robot_time,
            log,
            humans,
            pairs if any(connection.msgtype == PAIRS_TYPE for connection in reader.connections) else None,
            people,
            {topic: roots.tracked(topic, robot_time) for topic, roots in self._roots.items()},
            _columns(self._activation, robot_time),
            _columns(self._contact, robot_time),
            _columns(self._shares, robot_time),
            description,
            {(parent, child): T for child, (parent, T) in self._static.items() if child not in self._moved},
            self._safety.record(robot_time),
            {topic: states.names for topic, states in self._states.items() if topic not in (*people, *self._topics)},
            notes,
        )


def _children(raw: bytes) -> Iterator[str]:
    """Yield the child frames in a serialised tf2_msgs/TFMessage."""
    at = 4
    for _ in range(int.from_bytes(raw[:4], "little")):
        at += 12
        for _ in ("parent", "child"):
            begin, at = at + 4, at + 4 + int.from_bytes(raw[at : at + 4], "little")
        yield bytes(raw[begin:at]).decode(errors="replace").strip("/")
        at += 56  # position and quaternion


class _Named:
    """Collector of named values; the names may differ between messages."""

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._parts: list[tuple[tuple[str, ...], array[float], array[float]]] = []

    def add(self, message: Any, of: Sequence[str], values: Sequence[float]) -> None:
        names = tuple(of)
        if len(values) != len(names):
            return  # unclear which value belongs to which name
        if not self._parts or self._parts[-1][0] != names:
            self._parts.append((names, array("d"), array("d")))
            for name in names:
                self._names.setdefault(name, len(self._names))
        _, stamps, rows = self._parts[-1]
        stamps.append(seconds(message.header.stamp))
        rows.frombytes(np.asarray(values, dtype=float).tobytes())

    def columns(self, topic: str, robot_time: RobotTime) -> Columns:
        """Return the columns of all messages."""
        stamps = [stamp for _, part_stamps, _ in self._parts for stamp in part_stamps]
        values, row = np.full((len(stamps), len(self._names)), np.nan), 0
        for names, part_stamps, rows in self._parts:
            columns, end = [self._names[name] for name in names], row + len(part_stamps)
            values[row:end, columns] = np.array(rows).reshape(len(part_stamps), -1)
            row = end
        return Columns(topic, tuple(self._names), *in_order(times(stamps, robot_time), values))


def _columns(streams: dict[str, _Named], robot_time: RobotTime) -> dict[str, Columns]:
    return {topic: named.columns(topic, robot_time) for topic, named in streams.items()}


class _Roots:
    """Collector of root poses of one tracked person."""

    def __init__(self) -> None:
        self._stamps, self._rows = array("d"), array("d")
        self._frames, self._calibrated = dict[str, None](), True

    def add(self, message: Any) -> None:
        self._stamps.append(seconds(message.header.stamp))
        pose = (math.nan,) * 7 if message.root_state == LOST else xyz_quaternion(message.root)
        self._rows.extend((*pose, message.residual))
        self._frames[str(message.header.frame_id).strip("/")] = None
        self._calibrated &= bool(message.calibrated)

    def tracked(self, topic: str, robot_time: RobotTime) -> TrackedRoot:
        """Return the root link of the person over time."""
        time, rows = in_order(times(self._stamps, robot_time), np.array(self._rows).reshape(-1, 8))
        return TrackedRoot(topic, " and ".join(self._frames), time, rows[:, :7], rows[:, 7], self._calibrated)


class _ThinLog:
    """Collector of control log cycles at a limited rate [Hz]; repeated cycles are stored once."""

    def __init__(self, rate: float) -> None:
        self._rate, self._slot, self._last, self._rose = rate, -math.inf, -math.inf, -math.inf
        self._time = array("d")
        self._values = {name: array("d") for name in (*ARRAYS, "by_effort")}
        self._clock: list[tuple[float, float]] = []
        self._message: Any = None

    def add(self, message: Any) -> None:
        time, joints = np.asarray(message.time, dtype=float), len(message.joint_names)
        if not len(time):
            return
        for name, size in (*dict.fromkeys(ARRAYS, len(time) * joints).items(), ("command_interface", joints)):
            if (count := len(getattr(message, name))) != size:
                raise BagError(
                    f"a message of the control log at {time[0]:.3f} s has {count} values of {name}; valid: {size}"
                )
        if self._message is not None and list(message.joint_names) != list(self._message.joint_names):
            raise BagError(
                f"the joints of the control log change at {time[0]:.3f} s, from {', '.join(self._message.joint_names)} "
                f"to {', '.join(message.joint_names)}; valid: the bag of one arm"
            )
        self._check_clock(seconds(message.header.stamp), time[-1])
        slots = np.floor(time * self._rate + 1e-6)
        chosen = (np.diff(slots, prepend=self._slot) > 0.0) & (time > self._last)
        self._slot, self._last = max(self._slot, slots[-1]), max(self._last, time[-1])
        self._time.frombytes(time[chosen].tobytes())
        for name in ARRAYS:
            rows = np.asarray(getattr(message, name), dtype=float).reshape(len(time), joints)
            self._values[name].frombytes(rows[chosen].tobytes())
        effort = [kind == "effort" for kind in message.command_interface]
        self._values["by_effort"].frombytes(np.tile(np.array(effort, dtype=float), (chosen.sum(), 1)).tobytes())
        if np.isfinite(time[:1]).all():
            self._clock.append((seconds(message.header.stamp), float(time[0])))
            self._message = message

    def _check_clock(self, stamp: float, time: float) -> None:
        """Raise BagError if the robot time of the last cycle [s] does not rise while the stamps [s] do."""
        if not time <= self._last:
            self._rose = stamp
        elif stamp - self._rose > one_publisher.BACK_IN_TIME:
            raise BagError(
                f"the clock of the control log does not rise above {self._last:.3f} s, as if it stood still or a run "
                "started again; valid: the bag of one run"
            )

    @property
    def robot_time(self) -> RobotTime | None:
        """Function from stamps to robot time [s]; None: there is no control log."""
        return robot_time_of(self._clock) if self._clock else None

    def record(self) -> ControlRecord | None:
        """Return the record of the stored cycles; None: there are none."""
        if self._message is None:
            return None
        n, names = len(self._time), tuple(self._message.joint_names)
        arrays = {name: np.array(values).reshape(n, len(names)) for name, values in self._values.items()}
        by_effort = arrays.pop("by_effort") > 0.0
        kinds = tuple(self._message.command_interface)
        return ControlRecord(
            names, kinds, np.array(self._time), first_cycle=0, gaps=(), repeats=(), by_effort=by_effort, **arrays
        )
