"""Reads what a report needs from a bag, without ROS: the control log, limit counts, setpoints and profile."""

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.highlevel import AnyReaderError

from franka_hw_interface.robot_state import ERROR_NAMES
from hric_bags.parts import PartsError, PartsReader
from hric_control.errors import HricError

FloatArray = npt.NDArray[np.float64]
LOG_TYPE = "hric_msgs/msg/ControlLog"
COUNTS_TYPE = "hric_msgs/msg/JointLimitCounts"
COMMAND_TYPE = "std_msgs/msg/Float64MultiArray"
STATE_TYPE = "control_msgs/msg/JointTrajectoryControllerState"
FRANKA_TYPE = "franka_msgs/msg/FrankaState"
_CONTROLLER_COMMAND = re.compile(r"/[^/]+/command$")
SAME_CLOCK = 1e-6
"""Robot time and the stamps' time are the same clock when they drift apart by less than this, which is what rounding
does [s]."""
RobotTime = Callable[[float], float]
"""Stamp -> robot time [s]."""
ARRAYS = ("position", "velocity", "effort", "command_raw", "command")


class BagError(HricError):
    """A bag that cannot be read, or in which something that a report needs is missing."""


@dataclass(frozen=True)
class ControlRecord:
    """The control log of a run, stitched together: n cycles of j joints, each cycle once.

    Attributes:
        joint_names: order of the columns.
        interfaces: what the command of each joint meant at the end, e.g. "effort".
        time: robot time of each cycle, shape (n,) [s].
        position, velocity, effort: shape (n, j) [rad, rad/s, N m].
        command_raw, command: what was requested and what was sent, shape (n, j) [unit of the interface].
        first_cycle: index of the first recorded cycle, counted from the start of the run.
        gaps: cycles missing after the first, as (first missing, how many).
        repeats: cycles that came twice, as (first repeated, how many).
        by_effort: whether the command was an effort, shape (n, j); None: as in `interfaces` throughout.
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
        """Requested torque where the joint was commanded by effort in that cycle, else that measured, shape (n, j) [N
        m]."""
        by_effort = [kind == "effort" for kind in self.interfaces] if self.by_effort is None else self.by_effort
        return np.where(by_effort, self.command_raw, self.effort)

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return len(self.time)

    def state_sha256(self) -> str:
        """Hash of the bits of position, velocity and command: equal for two runs that are bit-identical."""
        digest = hashlib.sha256()
        for values in (self.position, self.velocity, self.command):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class SentSetpoint:
    """A setpoint as recorded.

    Attributes:
        time: robot time at which it was recorded [s].
        controller: name of the controller's namespace.
        positions: shape (j,) [rad].
    """

    time: float
    controller: str
    positions: FloatArray


@dataclass
class RunRecord:
    """All that a report takes from a bag.

    Attributes:
        log: the control log.
        setpoints: setpoints in order of time.
        profiles: per controller, what it led the joints along: (time (n,) [s], desired position (n, j) [rad], joint
            names).
        limit_counts: last limit counts, by field name; None if there were none.
        topics: message count per topic.
        duration: from the first to the last message [s].
        reflexes: (robot time [s], names of the errors) whenever a Franka arm came into an error.
        robot_time: from stamps to robot time.
    """

    log: ControlRecord
    setpoints: list[SentSetpoint] = field(default_factory=list)
    profiles: dict[str, tuple[FloatArray, FloatArray, tuple[str, ...]]] = field(default_factory=dict)
    limit_counts: dict[str, Any] | None = None
    topics: dict[str, int] = field(default_factory=dict)
    duration: float = 0.0
    reflexes: list[tuple[float, tuple[str, ...]]] = field(default_factory=list)
    robot_time: RobotTime = float


@contextmanager
def opened(bag: Path | PartsReader) -> Iterator[PartsReader]:
    """A reader of a bag with all its parts; one that is open already stays so.

    Raises:
        BagError: the bag is missing or damaged.
    """
    if isinstance(bag, PartsReader):
        yield bag
        return
    _check_file(bag)
    try:
        with PartsReader(bag) as reader:
            yield reader
    except PartsError as error:
        raise BagError(str(error)) from error
    except AnyReaderError as error:
        raise BagError(f"cannot read {bag.name}: {error}") from error


def _check_file(path: Path) -> None:
    if not path.is_file():
        unfinished = path.with_name(path.name + ".active")
        hint = (
            f"; the recording did not end properly, try: rosrun hric_experiments health --salvage {unfinished}"
            if unfinished.is_file()
            else ""
        )
        raise BagError(f"no bag {path.name} in {path.parent}{hint}")


def read(bag: Path | PartsReader) -> RunRecord:
    """Read a bag with all its parts.

    Raises:
        BagError: it is missing, damaged, or has no control log.
    """
    logs: list[Any] = []
    collected: dict[str, list[tuple[str, float, Any]]] = {
        COUNTS_TYPE: [],
        COMMAND_TYPE: [],
        STATE_TYPE: [],
        FRANKA_TYPE: [],
    }
    with opened(bag) as reader:
        topics = {topic: info.msgcount for topic, info in reader.topics.items()}
        duration = reader.duration * 1e-9 if reader.message_count else 0.0
        for connection, stamp, raw in reader.chosen(lambda c: c.msgtype in (LOG_TYPE, *collected)):
            message = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype == LOG_TYPE:
                logs.append(message)
            else:
                collected[connection.msgtype].append((connection.topic, stamp * 1e-9, message))
        return _record(logs, collected, topics, duration, reader.bag.name)


def _record(
    logs: list[Any],
    collected: dict[str, list[tuple[str, float, Any]]],
    topics: dict[str, int],
    duration: float,
    name: str,
) -> RunRecord:
    if not logs:
        raise BagError(f"{name} has no control log; topics: {', '.join(sorted(topics)) or 'none'}")
    robot_time = robot_time_of(logs)
    counts = collected[COUNTS_TYPE]
    return RunRecord(
        stitch(logs),
        [_setpoint(*item, robot_time) for item in collected[COMMAND_TYPE] if _CONTROLLER_COMMAND.search(item[0])],
        _profiles(collected[STATE_TYPE], robot_time),
        _counts(counts[-1][2]) if counts else None,
        topics,
        duration,
        _reflexes(collected[FRANKA_TYPE], robot_time),
        robot_time,
    )


def _reflexes(messages: list[tuple[str, float, Any]], robot_time: RobotTime) -> list[tuple[float, tuple[str, ...]]]:
    found: list[tuple[float, tuple[str, ...]]] = []
    before: dict[str, tuple[str, ...]] = {}
    for topic, _, message in messages:
        errors = tuple(name for name in ERROR_NAMES if getattr(message.current_errors, name))
        if errors and errors != before.get(topic):
            found.append((robot_time(seconds(message.header.stamp)), errors))
        before[topic] = errors
    return found


def stitch(messages: Iterable[Any]) -> ControlRecord:
    """Join control log messages to arrays; every cycle is kept once, in order, and gaps and repeats are noted."""
    parts: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in ("time", *ARRAYS, "by_effort")}
    gaps, repeats = [], []
    expected = None
    first, last = 0, None
    for message in messages:
        start, count, joints = int(message.first_cycle), int(message.n_cycles), len(message.joint_names)
        if last is not None and list(message.joint_names) != list(last.joint_names):
            raise BagError(
                f"the joints changed within the control log: {list(last.joint_names)}, then {list(message.joint_names)}"
            )
        if expected is None:
            first = expected = start
        if start > expected:
            gaps.append((expected, start - expected))
        skip = min(max(expected - start, 0), count)
        if skip:
            repeats.append((start, skip))
        parts["time"].append(np.asarray(message.time, dtype=float)[skip:])
        for name in ARRAYS:
            parts[name].append(np.asarray(getattr(message, name), dtype=float).reshape(count, joints)[skip:])
        parts["by_effort"].append(np.tile([kind == "effort" for kind in message.command_interface], (count, 1))[skip:])
        expected, last = max(expected, start + count), message
    if last is None:
        raise BagError("the control log is empty")
    arrays = {name: np.concatenate(values) for name, values in parts.items()}
    return ControlRecord(
        tuple(last.joint_names),
        tuple(last.command_interface),
        first_cycle=first,
        gaps=tuple(gaps),
        repeats=tuple(repeats),
        **arrays,
    )


def seconds(stamp: Any) -> float:
    """A stamp as rosbags reads it [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def robot_time_of(logs: list[Any]) -> RobotTime:
    """From stamps to robot time. They differ by a constant, except on a robot whose clock does not keep step with that
    of this machine."""
    pairs = sorted((seconds(message.header.stamp), float(message.time[0])) for message in logs)
    offsets = np.array([stamp - time for stamp, time in pairs])
    if np.ptp(offsets) < SAME_CLOCK:
        offset = seconds(logs[0].header.stamp) - float(logs[0].time[0])
        return lambda stamp: stamp - offset
    stamps = np.array([stamp for stamp, _ in pairs])
    return lambda stamp: float(stamp - np.interp(stamp, stamps, offsets))


def _setpoint(topic: str, stamp: float, message: Any, robot_time: RobotTime) -> SentSetpoint:
    return SentSetpoint(robot_time(stamp), topic.strip("/").split("/")[-2], np.asarray(message.data, dtype=float))


def _counts(message: Any) -> dict[str, Any]:
    result: dict[str, Any] = {"joint_names": list(message.joint_names), "cycles": int(message.cycles)}
    for name in ("position", "velocity", "effort", "effort_rate"):
        result[name] = [int(value) for value in getattr(message, name)]
    for name in ("velocity_ratio_max", "position_excess_max"):
        result[name] = [float(value) for value in getattr(message, name)]
    result["started_outside"] = [bool(value) for value in message.started_outside]
    return result


def _profiles(
    messages: list[tuple[str, float, Any]], robot_time: RobotTime
) -> dict[str, tuple[FloatArray, FloatArray, tuple[str, ...]]]:
    result = {}
    for topic in {topic for topic, _, _ in messages}:
        own = [
            message
            for name, _, message in messages
            if name == topic and len(message.desired.positions) == len(message.joint_names)
        ]
        if own:
            times = np.array([robot_time(seconds(message.header.stamp)) for message in own])
            positions = np.array([message.desired.positions for message in own], dtype=float)
            result[topic.strip("/").split("/")[-2]] = (times, positions, tuple(own[0].joint_names))
    return result
