"""Reader of the data that a report needs from a bag: control log, limit counts, setpoints, desired motion. No ROS."""

import hashlib
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from franka_hw_interface.robot_state import ERROR_NAMES
from hric_bags import foreign
from hric_bags.indexed import BagError as BagError
from hric_bags.parts import Bag, PartsError, PartsReader

FloatArray = npt.NDArray[np.float64]
LOG_TYPE = "hric_msgs/msg/ControlLog"
COUNTS_TYPE = "hric_msgs/msg/JointLimitCounts"
COMMAND_TYPE = "std_msgs/msg/Float64MultiArray"
STATE_TYPE = "control_msgs/msg/JointTrajectoryControllerState"
FRANKA_TYPE = "franka_msgs/msg/FrankaState"
TYPES = (LOG_TYPE, COUNTS_TYPE, COMMAND_TYPE, STATE_TYPE, FRANKA_TYPE)
ROS_TYPES = {kind.replace("/msg/", "/"): kind for kind in TYPES}
"""The types by the names that ROS messages have, without `msg`."""
_CONTROLLER_COMMAND = re.compile(r"/[^/]+/command$")
SAME_CLOCK = 1e-6
"""Largest drift between robot time and stamps with which both count as one clock [s]: it is only rounding."""
RobotTime = Callable[[float], float]
"""Function from a stamp to robot time [s]."""
ARRAYS = ("position", "velocity", "effort", "command_raw", "command")


@dataclass(frozen=True)
class ControlRecord:
    """Control log of a run as arrays: n control cycles of j joints, each cycle once.

    Attributes:
        joint_names: joints in the order of the columns.
        interfaces: command interface of each joint at the end of the run, e.g. "effort".
        time: robot time of each cycle, shape (n,) [s].
        position, velocity, effort: measured values, shape (n, j) [rad, rad/s, N m].
        command_raw, command: command before and after the limiters, shape (n, j) [unit of the interface].
        first_cycle: index of the first recorded cycle, counted from the start of the run.
        gaps: missing cycles after the first recorded one, as (first missing, how many).
        repeats: cycles recorded twice, as (first repeated, how many).
        by_effort: True if the command was an effort, shape (n, j); None: as in `interfaces` in all cycles.
    """

    joint_names: tuple[str, ...]
    interfaces: tuple[str, ...]
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    command_raw: FloatArray
    command: FloatArray
    first_cycle: int
    gaps: tuple[tuple[int, int], ...]
    repeats: tuple[tuple[int, int], ...]
    by_effort: npt.NDArray[np.bool_] | None = None

    @property
    def torque(self) -> FloatArray:
        """Commanded torque if a cycle commands the joint by effort, else measured torque, shape (n, j) [N m]."""
        by_effort = [kind == "effort" for kind in self.interfaces] if self.by_effort is None else self.by_effort
        return np.where(by_effort, self.command_raw, self.effort)

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return len(self.time)

    def state_sha256(self) -> str:
        """Return a hash of the bits of position, velocity and command, equal for bit-identical runs."""
        digest = hashlib.sha256()
        for values in (self.position, self.velocity, self.command):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class SentSetpoint:
    """Recorded setpoint of a controller.

    Attributes:
        time: robot time of the recording [s].
        controller: name of the controller, of one of several arms with the arm's name: `left/joint_pd_controller`.
        positions: joint positions, shape (j,) [rad].
    """

    time: float
    controller: str
    positions: FloatArray


@dataclass
class RunRecord:
    """Everything that a report takes from a bag.

    Attributes:
        log: control log of the run.
        setpoints: setpoints in order of time.
        profiles: desired motion of each controller: (time (n,) [s], desired position (n, j) [rad], joint names).
        limit_counts: last hric_msgs/JointLimitCounts; None if there were none.
        topics: number of messages by topic.
        duration: time from the first to the last message [s].
        reflexes: (robot time [s], names of the errors) of each moment at which a Franka arm entered an error.
        robot_time: function from stamps to robot time.
    """

    log: ControlRecord
    setpoints: list[SentSetpoint] = field(default_factory=list)
    profiles: dict[str, tuple[FloatArray, FloatArray, tuple[str, ...]]] = field(default_factory=dict)
    limit_counts: Any = None
    topics: dict[str, int] = field(default_factory=dict)
    duration: float = 0.0
    reflexes: list[tuple[float, tuple[str, ...]]] = field(default_factory=list)
    robot_time: RobotTime = float


@contextmanager
def opened(bag: Path | Bag) -> Iterator[Bag]:
    """Yield a reader of a bag with all its parts; a reader that is passed in is yielded, and stays open.

    Raises:
        BagError: the bag is missing or damaged.
    """
    if not isinstance(bag, Path):
        yield bag
        return
    _check_file(bag)
    try:
        with PartsReader(bag) as reader:
            yield reader
    except PartsError as error:
        raise BagError(str(error)) from error


def _check_file(path: Path) -> None:
    if foreign.is_ros2(path):
        return
    if path.is_dir() and (kind := foreign.describe(path)):
        raise BagError(kind)
    if not path.is_file():
        unfinished = path.with_name(path.name + ".active")
        hint = (
            f"; the recording did not end properly, try: hric health --salvage {unfinished}"
            if unfinished.is_file()
            else ""
        )
        raise BagError(f"no bag {path.name} in {path.parent}{hint}")


class RunMessages:
    """Collector of the messages that a report needs, in the order of the bag.

    Messages may be those of rosbags, read from a bag, or those of ROS, while the bag is written.
    """

    def __init__(self) -> None:
        self._log, self._namespace = _JoinedLog(), "/"
        self._commands: list[tuple[str, float, Any]] = []
        self._counts: dict[str, Any] = {}
        self._desired: dict[str, list[tuple[float, Any, tuple[str, ...]]]] = {}
        self._errors: dict[str, tuple[str, ...]] = {}
        self._reflexes: list[tuple[float, tuple[str, ...]]] = []

    def add(self, topic: str, kind: str, time: int, message: Any) -> None:
        """Add a message if it is one of TYPES.

        Args:
            topic: absolute topic name.
            kind: message type, e.g. "hric_msgs/msg/ControlLog".
            time: recording time [ns].
            message: message, deserialised.
        """
        if kind == LOG_TYPE:
            self._log.add(message)
            self._namespace = f"{topic.rpartition('/')[0]}/"
        elif kind == COUNTS_TYPE:
            self._counts[topic] = message
        elif kind == COMMAND_TYPE and _CONTROLLER_COMMAND.search(topic):
            self._commands.append((topic, time * 1e-9, message))
        elif kind == STATE_TYPE and len(message.desired.positions) == len(message.joint_names):
            rows, names = self._desired.setdefault(topic, []), tuple(message.joint_names)
            if rows and rows[-1][2] == names:
                names = rows[-1][2]  # shared: a copy per row takes more memory than the numbers
            # Copied, because a view would keep the complete message in memory.
            rows.append((seconds(message.header.stamp), np.array(message.desired.positions, dtype=float), names))
        elif kind == FRANKA_TYPE:
            errors = tuple(name for name in ERROR_NAMES if getattr(message.current_errors, name))
            if errors and errors != self._errors.get(topic):
                self._reflexes.append((seconds(message.header.stamp), errors))
            self._errors[topic] = errors

    def record(self, bag: Bag) -> RunRecord:
        """Return the record of all messages added so far, with topics and duration of their bag.

        Raises:
            BagError: there is no control log.
        """
        topics = {topic: info.msgcount for topic, info in bag.topics.items()}
        if not self._log.clock:
            raise BagError(f"{bag.bag.name} has no control log; topics: {', '.join(sorted(topics)) or 'none'}")
        robot_time = robot_time_of(self._log.clock)
        return RunRecord(
            self._log.record(),
            [
                SentSetpoint(robot_time(stamp), self._controller(topic), np.asarray(message.data, dtype=float))
                for topic, stamp, message in self._commands
            ],
            {self._controller(topic): _profile(rows, robot_time) for topic, rows in self._desired.items()},
            self._counts.get(f"{self._namespace}limit_counts") or next(iter(self._counts.values()), None),
            topics,
            bag.duration * 1e-9 if bag.message_count else 0.0,
            [(robot_time(stamp), errors) for stamp, errors in self._reflexes],
            robot_time,
        )

    def _controller(self, topic: str) -> str:
        """Return the name of a controller from one of its topics, with the arm's name if there are several."""
        name = topic.rpartition("/")[0]
        return name.removeprefix(self._namespace) if name.startswith(self._namespace) else name.rpartition("/")[2]


def read(bag: Path | Bag, known: RunMessages | None = None) -> RunRecord:
    """Read what a report needs from a bag with all its parts.

    Args:
        bag: path of the bag, or a reader of it.
        known: messages collected while the bag was written; None: they are read from the bag.

    Raises:
        BagError: the bag is missing, damaged, or has no control log.
    """
    with opened(bag) as reader:
        if known is None:
            known = RunMessages()
            for connection, stamp, raw in reader.chosen(lambda c: c.msgtype in TYPES):
                known.add(connection.topic, connection.msgtype, stamp, reader.deserialize(raw, connection.msgtype))
        return known.record(reader)


def stitch(messages: Iterable[Any]) -> ControlRecord:
    """Join hric_msgs/ControlLog messages to one record: every cycle once, in order, with gaps and repeats noted."""
    joined = _JoinedLog()
    for message in messages:
        joined.add(message)
    return joined.record()


class _JoinedLog:
    """Control log as arrays that grow with each message, which takes half of the memory of the messages.

    Attributes:
        clock: (stamp, robot time) of the first cycle of each message [s].
    """

    def __init__(self) -> None:
        self.clock: list[tuple[float, float]] = []
        self._arrays = {name: array("d") for name in ("time", *ARRAYS)}
        self._by_effort: list[tuple[int, list[bool]]] = []
        self._first = self._expected = 0
        self._gaps: list[tuple[int, int]] = []
        self._repeats: list[tuple[int, int]] = []
        self._last: Any = None

    def add(self, message: Any) -> None:
        """Add a hric_msgs/ControlLog. Raises BagError if its joints differ from those of the messages before."""
        start, count, joints = int(message.first_cycle), int(message.n_cycles), len(message.joint_names)
        if self._last is None:
            self._first = self._expected = start
        elif list(message.joint_names) != list(self._last.joint_names):
            raise BagError(
                f"the joints changed within the control log: {list(self._last.joint_names)}, then "
                f"{list(message.joint_names)}"
            )
        if start > self._expected:
            self._gaps.append((self._expected, start - self._expected))
        skip = min(max(self._expected - start, 0), count)
        if skip:
            self._repeats.append((start, skip))
        self._append("time", message.time, count, skip)
        for name in ARRAYS:
            self._append(name, getattr(message, name), count * joints, skip * joints)
        self._by_effort.append((count - skip, [kind == "effort" for kind in message.command_interface]))
        if count:
            self.clock.append((seconds(message.header.stamp), float(message.time[0])))
        self._expected, self._last = max(self._expected, start + count), message

    def _append(self, name: str, values: Any, size: int, skip: int) -> None:
        if len(values) != size:
            raise BagError(f"a message of the control log has {len(values)} values of {name}; valid: {size}")
        new = values[skip:]  # a list from ROS, an array from rosbags
        added = array("d", new if isinstance(new, list) else np.asarray(new, dtype=float).tobytes())
        try:
            self._arrays[name] += added
        except BufferError:  # an earlier record refers to this array
            self._arrays[name] = self._arrays[name] + added

    def record(self) -> ControlRecord:
        """Return the record of all cycles so far. Raises BagError if there are none."""
        if self._last is None:
            raise BagError("the control log is empty")
        rows = {name: np.asarray(values) for name, values in self._arrays.items()}
        time, joints = rows.pop("time"), tuple(self._last.joint_names)
        counts, by_effort = zip(*self._by_effort, strict=True)
        return ControlRecord(
            joints,
            tuple(self._last.command_interface),
            first_cycle=self._first,
            gaps=tuple(self._gaps),
            repeats=tuple(self._repeats),
            time=time,
            by_effort=np.repeat(np.array(by_effort, dtype=bool), counts, axis=0),
            **{name: values.reshape(len(time), len(joints)) for name, values in rows.items()},
        )


def seconds(stamp: Any) -> float:
    """Return a stamp of rosbags or of ROS in seconds [s]; ROS's own conversion would round differently."""
    if hasattr(stamp, "secs"):
        return float(stamp.secs) + 1e-9 * float(stamp.nsecs)
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def robot_time_of(clock: Sequence[tuple[float, float]]) -> RobotTime:
    """Return the function from stamps to robot time, given pairs (stamp, robot time) [s].

    They differ by a constant, except on a robot whose clock drifts against that of this machine.
    """
    stamps, times = map(np.array, zip(*sorted(clock), strict=True))
    offsets = stamps - times
    if np.ptp(offsets) < SAME_CLOCK:
        offset = clock[0][0] - clock[0][1]
        return lambda stamp: stamp - offset
    return lambda stamp: float(stamp - np.interp(stamp, stamps, offsets))


def _profile(
    rows: Sequence[tuple[float, Any, tuple[str, ...]]], robot_time: RobotTime
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    stamps, positions, names = zip(*rows, strict=True)
    return np.array([robot_time(stamp) for stamp in stamps]), np.array(positions, dtype=float), names[0]
