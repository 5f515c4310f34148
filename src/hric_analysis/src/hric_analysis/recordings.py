"""Reader of a bag for the report: sensor signals, moving frames and markers, events, synchronisation. No ROS."""

from array import array
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_analysis.collection_record import TIME_CODE
from hric_bags.parts import Bag, PartsReader
from hric_bags.reader import FloatArray, RobotTime, opened, seconds

SignalKey = tuple[str, str, tuple[str, ...]]
"""Key of a signal: topic, unit and names of the channels."""
REPLAY_SPACING = 0.009
"""Minimum time between two stored poses of a frame or marker [s]; shorter than the time step of the replay."""
SIGNAL_TYPES = {"geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PointStamped", "hric_msgs/msg/SampleChunk"}
"""Message types that are read as sensor signals."""
LEVELS = {4: "warning", 8: "error", 16: "fatal"}
"""Names of those levels of rosgraph_msgs/Log that are listed as events."""
CONDITIONS = {0: "good", 1: "warning", 2: "error", 3: "stale"}
"""Names of the levels of diagnostic_msgs/DiagnosticStatus."""


@dataclass(frozen=True)
class RunEvent:
    """Event of a run.

    Attributes:
        time: robot time [s].
        kind: kind, such as setpoint, warning, error, phase.
        source: node, topic or component.
        text: description.
    """

    time: float
    kind: str
    source: str
    text: str


@dataclass(frozen=True)
class Signal:
    """Sensor signal: the channels of a topic that have the same unit.

    Attributes:
        topic: name of the topic.
        unit: unit of all values.
        channels: names of the columns.
        time: robot time, shape (n,) [s].
        values: values, shape (n, channels).
    """

    topic: str
    unit: str
    channels: tuple[str, ...]
    time: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class Moving:
    """Recorded motion of a frame or marker.

    Attributes:
        kind: "frame" or "marker".
        name: name for display.
        frame_id: reference frame of the values.
        time: robot time, shape (n,) [s].
        values: frame: position [m] and quaternion x y z w, shape (n, 7); marker: position, shape (n, 3) [m].
    """

    kind: str
    name: str
    frame_id: str
    time: FloatArray
    values: FloatArray


@dataclass
class Recordings:
    """Contents of a bag that the report shows, besides the control log.

    Attributes:
        signals, moving, events: sensor signals, moving frames and markers, and events.
        statics: static transforms: (parent, translation [m], quaternion x y z w) by child frame.
        layouts, statuses: last SyncLayout and last SyncStatus message, by topic.
        samples: (ages [s], validity) of the sources in each SyncedSample, by topic.
    """

    signals: list[Signal] = field(default_factory=list)
    moving: list[Moving] = field(default_factory=list)
    events: list[RunEvent] = field(default_factory=list)
    statics: dict[str, tuple[str, list[float], list[float]]] = field(default_factory=dict)
    layouts: dict[str, Any] = field(default_factory=dict)
    statuses: dict[str, Any] = field(default_factory=dict)
    samples: dict[str, list[tuple[FloatArray, npt.NDArray[np.bool_]]]] = field(
        default_factory=lambda: defaultdict(list)
    )


def read(bag: Path | PartsReader, robot_time: RobotTime, *, progress: bool = False) -> Recordings:
    """Read sensor signals, motions, events and synchronisation data from a bag.

    Args:
        bag: the bag, or a reader of it.
        robot_time: conversion from stamps to robot time.
        progress: True to show a progress bar on the terminal.
    """
    reading = _Reading(robot_time)
    with opened(bag) as reader:
        reading.take_all(reader, lambda c: reading.wants(c.topic, c.msgtype), "reading the bag" if progress else "")
    return reading.finish()


def signals(bag: Path | Bag, robot_time: RobotTime) -> list[Signal]:
    """Read only the sensor signals of a bag, in one pass, as each pass decompresses the complete bag.

    Args:
        bag: the bag, or a reader of it.
        robot_time: conversion from stamps to robot time.
    """
    reading = _Reading(robot_time)
    with opened(bag) as reader:
        reading.take_all(reader, lambda c: c.msgtype in SIGNAL_TYPES)
    return reading.finish().signals


class _Reading:
    """Collector of a bag's contents, message by message."""

    def __init__(self, robot_time: RobotTime) -> None:
        self._robot_time = robot_time
        self._result = Recordings()
        self._last: dict[str, float] = {}
        self._series: dict[SignalKey, tuple[array[float], array[float]]] = defaultdict(lambda: (array("d"), array("d")))
        self._tracks: dict[tuple[str, str, str], list[tuple[float, tuple[float, ...]]]] = defaultdict(list)
        self._condition: dict[str, int] = {}
        self._starving: dict[str, tuple[str, ...]] = {}
        self._takers: dict[str, Callable[[str, float, Any], None]] = {
            "hric_msgs/msg/MocapData": self._mocap,
            "geometry_msgs/msg/PoseStamped": self._pose,
            "geometry_msgs/msg/WrenchStamped": self._wrench,
            "geometry_msgs/msg/PointStamped": self._point,
            "hric_msgs/msg/SampleChunk": self._chunk,
            "hric_msgs/msg/SyncLayout": self._layout,
            "hric_msgs/msg/SyncStatus": self._status,
            "hric_msgs/msg/SyncedSample": self._sample,
            "rosgraph_msgs/msg/Log": self._log,
            "diagnostic_msgs/msg/DiagnosticArray": self._diagnostics,
            "tf2_msgs/msg/TFMessage": self._transforms,
            "std_msgs/msg/String": self._phase,
        }
        self._thinned = {"hric_msgs/msg/MocapData", "geometry_msgs/msg/PoseStamped"}

    def take_all(self, reader: Bag, chooses: Callable[[Any], bool], label: str = "") -> None:
        """Process the messages of the chosen connections; `label`: name of the progress bar, "": no progress bar."""
        for connection, stamp, raw in reader.chosen(chooses, label):
            kind = connection.msgtype
            self.take(connection.topic, kind, stamp * 1e-9, partial(reader.deserialize, raw, kind))

    def wants(self, topic: str, kind: str) -> bool:
        """Return True if a topic is to be read; /rosout_agg is skipped, as it repeats the messages of /rosout."""
        if kind == "tf2_msgs/msg/TFMessage":
            return topic.endswith("tf_static")
        if kind == "std_msgs/msg/String":
            return topic.endswith("/phase")
        return kind in self._takers and topic != "/rosout_agg"

    def take(self, topic: str, kind: str, stamp: float, message: Callable[[], Any]) -> None:
        """Process one message.

        Args:
            topic: name of the topic.
            kind: message type.
            stamp: time of recording [s].
            message: function that deserialises the message; it is slow, so it is called only if needed.
        """
        if kind in self._thinned:
            if stamp - self._last.get(topic, -np.inf) < REPLAY_SPACING:
                return
            self._last[topic] = stamp
        content = message()
        header = getattr(content, "header", None)
        measured = seconds(header.stamp) if header is not None else 0.0
        self._takers[kind](topic, self._robot_time(measured or stamp), content)

    def finish(self) -> Recordings:
        """Return the collected data, sorted by time."""
        for (topic, unit, channels), (stamps, rows) in self._series.items():
            time, values = np.frombuffer(stamps), np.frombuffer(rows).reshape(len(stamps), -1)
            if (np.diff(time) < 0.0).any():
                order = np.argsort(time, kind="stable")
                time, values = time[order], values[order]
            self._result.signals.append(Signal(topic, unit, channels, time, values))
        for (kind, name, frame), poses in self._tracks.items():
            poses.sort(key=lambda pose: pose[0])
            times, values = (np.array(column) for column in zip(*poses, strict=True))
            self._result.moving.append(Moving(kind, name, frame, times, values))
        self._result.events.sort(key=lambda event: event.time)
        return self._result

    def _event(self, time: float, kind: str, source: str, text: str) -> None:
        self._result.events.append(RunEvent(time, kind, source, text))

    def _mocap(self, topic: str, time: float, message: Any) -> None:
        frame = message.header.frame_id.lstrip("/")
        for body in message.rigid_bodies:
            self._tracks["frame", f"body {body.name}", frame].append(
                (time, _pose(body.pose) if body.tracking_valid else (np.nan,) * 7)
            )
        ids = [int(number) for number in message.labelled_marker_ids]
        for name, number, point in zip(message.labelled_marker_names, ids, message.labelled_markers, strict=True):
            self._tracks["marker", name or f"marker {number}", frame].append((time, _xyz(point)))

    def _pose(self, topic: str, time: float, message: Any) -> None:
        self._tracks["frame", topic, message.header.frame_id.lstrip("/")].append((time, _pose(message.pose)))

    def _wrench(self, topic: str, time: float, message: Any) -> None:
        wrench = message.wrench
        self._row(topic, "force [N]", ("force x", "force y", "force z"), time, _xyz(wrench.force))
        self._row(topic, "torque [N m]", ("torque x", "torque y", "torque z"), time, _xyz(wrench.torque))

    def _point(self, topic: str, time: float, message: Any) -> None:
        self._row(topic, "position [m]", ("x", "y", "z"), time, _xyz(message.point))

    def _row(self, topic: str, unit: str, channels: tuple[str, ...], time: float, values: tuple[float, ...]) -> None:
        stamps, rows = self._series[topic, unit, channels]
        stamps.append(time)
        rows.extend(values)

    def _chunk(self, topic: str, time: float, message: Any) -> None:
        channels, units = tuple(map(str, message.channels)), str(message.unit).replace("N m", "N.m").split()
        values = np.asarray(message.data, dtype=float).reshape(-1, max(1, len(channels)))
        if not len(values) or message.rate <= 0.0:
            return
        times = time + np.arange(len(values)) / message.rate
        channel_units = units if len(units) == len(channels) else [str(message.unit)] * len(channels)
        measured = [k for k, channel in enumerate(channels) if channel != TIME_CODE]
        for unit in dict.fromkeys(channel_units[k] for k in measured):
            columns = [k for k in measured if channel_units[k] == unit]
            stamps, rows = self._series[topic, f"[{unit.replace('.', ' ')}]", tuple(channels[k] for k in columns)]
            stamps.frombytes(times.tobytes())
            rows.frombytes(values[:, columns].tobytes())

    def _layout(self, topic: str, time: float, message: Any) -> None:
        self._result.layouts[topic] = message

    def _status(self, topic: str, time: float, message: Any) -> None:
        self._result.statuses[topic] = message
        starving = tuple(str(s) for s, is_so in zip(message.sources, message.starving, strict=True) if is_so)
        for source in set(starving) ^ set(self._starving.get(topic, ())):
            self._event(time, "sync", source, "no samples (starving)" if source in starving else "samples again")
        self._starving[topic] = starving

    def _sample(self, topic: str, time: float, message: Any) -> None:
        self._result.samples[topic].append(
            (np.asarray(message.age, dtype=float), np.asarray(message.valid, dtype=bool))
        )

    def _log(self, topic: str, time: float, message: Any) -> None:
        if message.level in LEVELS:
            self._event(time, LEVELS[message.level], message.name, message.msg)

    def _diagnostics(self, topic: str, time: float, message: Any) -> None:
        for status in message.status:
            level = int.from_bytes(status.level, "little") if isinstance(status.level, bytes) else int(status.level)
            if level != self._condition.get(status.name, 0):
                self._event(time, "diagnostics", status.name, f"{CONDITIONS.get(level, level)}: {status.message}")
            self._condition[status.name] = level

    def _transforms(self, topic: str, time: float, message: Any) -> None:
        for transform in message.transforms:
            pose, q = transform.transform.translation, transform.transform.rotation
            self._result.statics[transform.child_frame_id.lstrip("/")] = (
                transform.header.frame_id.lstrip("/"),
                list(_xyz(pose)),
                [q.x, q.y, q.z, q.w],
            )

    def _phase(self, topic: str, time: float, message: Any) -> None:
        self._event(time, "phase", topic, message.data)


def _xyz(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def _pose(pose: Any) -> tuple[float, ...]:
    q = pose.orientation
    return (*_xyz(pose.position), q.x, q.y, q.z, q.w)
