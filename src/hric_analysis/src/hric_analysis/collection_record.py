"""Reader of a bag's sensor data: sent counts and recorded samples of each source, synchronised streams. No ROS."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import Bag
from hric_bags.reader import opened, seconds

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
CHUNK, FRAMES, COUNT = "hric_msgs/msg/SampleChunk", "hric_msgs/msg/MocapData", "hric_msgs/msg/SourceCount"
SAMPLE, LAYOUT, STATUS = "hric_msgs/msg/SyncedSample", "hric_msgs/msg/SyncLayout", "hric_msgs/msg/SyncStatus"
TRUTH_TOPIC = "/hric/human/hand"
TYPES = (CHUNK, FRAMES, COUNT, SAMPLE, LAYOUT, STATUS)
DIAGNOSTICS, MISSED = "diagnostic_msgs/msg/DiagnosticArray", "missed deadlines"
TIME_CODE = "time"
"""Name of an emulated device's channel that contains the robot time of each sample (time code)."""
FRAME_COUNTER = 1 << 32
"""Number of frames after which the motion capture frame counter wraps around."""
SIZES = ("frame_size", "value_count", "age_count", "valid_count")
"""Length fields of a serialised SyncedSample."""
BLOCK = 1024
"""Number of synchronised samples that are decoded at a time (project default, unconfirmed)."""


@dataclass
class Numbered:
    """The n recorded samples of one source.

    Attributes:
        source: name of the source in its driver; "": motion capture.
        rate: sample rate reported by the driver [Hz]; NaN: not known.
        stamps: time stamps, shape (n,) [s].
        numbers: sequence numbers of the driver, shape (n,).
        codes: time code of each sample, shape (n,) [s]; None: there is none.
    """

    source: str
    rate: float
    stamps: FloatArray
    numbers: IntArray
    codes: FloatArray | None


@dataclass
class SourceCounts:
    """Contents of the n messages in which a source counts the samples it sent, in order.

    Attributes:
        rate: samples per second of robot time [Hz].
        stamps: stamp of the last sample sent, shape (n,) [s].
        following: sequence number of the next sample, shape (n,).
        sent: number of samples sent so far, shape (n,).
    """

    rate: float
    stamps: FloatArray
    following: IntArray
    sent: IntArray


@dataclass
class SynchronisedStream:
    """The n samples of one synchronised stream.

    Attributes:
        rate: sample rate [Hz]; 0: instants are the stamps of a reference source.
        names, sources: names of the values from which the skew is computed, and the topic of each.
        topics: topics of all sources, in the order of `valid`.
        stamps: instants of the samples, shape (n,) [s].
        values: values, one column per name, shape (n, values).
        valid: True if the values of a source are valid, shape (n, topics).
        skew: largest time skew that the synchroniser reported, by topic [s].
        late: number of samples that arrived after their instants were published, by topic.
    """

    rate: float
    names: list[str]
    sources: list[str]
    topics: list[str]
    stamps: FloatArray
    values: FloatArray
    valid: npt.NDArray[np.bool_]
    skew: dict[str, float] = field(default_factory=dict)
    late: dict[str, int] = field(default_factory=dict)


@dataclass
class Collection:
    """Sensor data of a bag.

    Attributes:
        sources: recorded samples by topic.
        counts: counts of sent samples, by name of the source.
        streams: synchronised samples by topic.
        truth: true path of the emulated hand: robot time (n,) [s], position (n, 3) [m], frame; None: not known.
        frame: reference frame of the motion capture's positions.
    """

    sources: dict[str, Numbered]
    counts: dict[str, SourceCounts]
    streams: dict[str, SynchronisedStream]
    truth: tuple[FloatArray, FloatArray, str] | None = None
    frame: str = ""


def read(bag: Path | Bag) -> Collection | None:
    """Read the sensor data of a bag; None if it has neither samples nor frames nor synchronised samples."""
    with opened(bag) as reader:
        counted = [c for c in reader.connections if c.msgtype in TYPES or c.topic.endswith(TRUTH_TOPIC)]
        if not any(c.msgtype in (CHUNK, FRAMES, SAMPLE) for c in counted):
            return None
        layouts: dict[str, object] = {}
        for connection, _, raw in reader.chosen(lambda c: c.msgtype == LAYOUT):
            layouts[connection.topic.removesuffix("_layout")] = reader.deserialize(raw, connection.msgtype)
        sources: dict[str, _Chunks | _Frames] = {}
        ticks = {
            topic: _Ticks(layout, lambda raw: reader.deserialize(raw, SAMPLE)) for topic, layout in layouts.items()
        }
        counts: list[Any] = []
        truth = _Truth()
        for connection, _, raw in reader.messages(connections=[c for c in counted if c.msgtype != LAYOUT]):
            topic, kind = connection.topic, connection.msgtype
            if kind == SAMPLE:
                if topic in ticks:
                    ticks[topic].add(raw)
                continue
            message = reader.deserialize(raw, kind)
            if topic.endswith(TRUTH_TOPIC):
                truth.add(message)
            elif kind == COUNT:
                counts.append(message)
            elif kind in (CHUNK, FRAMES):
                if topic not in sources:
                    sources[topic] = _Chunks() if kind == CHUNK else _Frames()
                sources[topic].add(message)
            elif topic.removesuffix("_status") in ticks:
                ticks[topic.removesuffix("_status")].add_status(message)
        for samples in ticks.values():
            samples.decode()
    frames = [source.frame for source in sources.values() if isinstance(source, _Frames)]
    return Collection(
        {topic: source.numbered() for topic, source in sources.items()},
        _counts(counts),
        {topic: source.stream() for topic, source in ticks.items() if len(source)},
        truth.path(),
        frames[0] if frames else "",
    )


class _Chunks:
    """Collector of stamps, numbers and time codes of the samples of one source."""

    def __init__(self) -> None:
        self._stamps, self._codes, self._numbers = array("d"), array("d"), array("q")
        self._source, self._rate = "", np.inf

    def add(self, message: Any) -> None:
        data = np.asarray(message.data, dtype=float).reshape(-1, max(len(message.channels), 1))
        steps = np.arange(len(data))
        code = np.full(len(data), np.nan)
        if TIME_CODE in message.channels:
            code = np.ascontiguousarray(data[:, message.channels.index(TIME_CODE)])
        self._stamps.frombytes((seconds(message.header.stamp) + steps / message.rate).tobytes())
        self._numbers.frombytes((message.first_sample + steps).tobytes())
        self._codes.frombytes(code.tobytes())
        self._source, self._rate = str(message.source), min(self._rate, float(message.rate))

    def numbered(self) -> Numbered:
        codes = np.frombuffer(self._codes)
        return Numbered(
            self._source,
            self._rate,  # the lowest reported rate: it rises while the run is slower than real time
            np.frombuffer(self._stamps),
            np.frombuffer(self._numbers, np.int64),
            None if np.isnan(codes).all() else codes,
        )


class _Frames:
    """Collector of stamps and numbers of motion capture frames."""

    def __init__(self) -> None:
        self._stamps, self._numbers, self.frame = array("d"), array("q"), ""

    def add(self, message: Any) -> None:
        self._stamps.append(seconds(message.header.stamp))
        self._numbers.append(int(message.frame_number))
        self.frame = self.frame or str(message.header.frame_id)

    def numbered(self) -> Numbered:
        numbers = np.unwrap(np.frombuffer(self._numbers, np.int64), period=FRAME_COUNTER)
        return Numbered("", float("nan"), np.frombuffer(self._stamps), np.asarray(numbers, np.int64), None)


class _Truth:
    """Collector of the true path of the emulated hand."""

    def __init__(self) -> None:
        self._rows, self._frame = array("d"), ""

    def add(self, message: Any) -> None:
        if not self._rows:
            self._frame = str(message.header.frame_id)
        point = message.pose.position
        self._rows.extend((seconds(message.header.stamp), point.x, point.y, point.z))

    def path(self) -> tuple[FloatArray, FloatArray, str] | None:
        """Return the path in the form of `Collection.truth`."""
        rows = np.frombuffer(self._rows).reshape(-1, 4)
        if len(rows) < 4:
            return None
        rows = rows[np.diff(rows[:, 0], prepend=-np.inf) > 0]
        return rows[:, 0].copy(), rows[:, 1:].copy(), self._frame


class _Ticks:
    """Collector of one synchronised stream: the values needed for its skew, and the synchroniser's status."""

    def __init__(self, layout: Any, deserialize: Callable[[bytes], Any]) -> None:
        self._layout, self._deserialize = layout, deserialize
        self._columns = [k for k, name in enumerate(layout.names) if "position" in name or f"[{TIME_CODE}]" in name]
        self._stamps, self._values, self._valid = array("d"), array("d"), bytearray()
        self._skew: dict[str, float] = {}
        self._late: dict[str, int] = {}
        self._waiting: list[bytes] = []

    def __len__(self) -> int:
        return len(self._stamps)

    def add_status(self, message: Any) -> None:
        """Add a status message of the synchroniser."""
        for topic, largest in zip(message.sources, message.skew_max, strict=True):
            self._skew[str(topic)] = max(self._skew.get(str(topic), 0.0), float(largest))
        self._late = dict(zip(map(str, message.sources), map(int, message.late), strict=True))

    def add(self, raw: bytes) -> None:
        """Add a serialised sample; call `decode` after the last one."""
        if len(self._waiting) == BLOCK or (self._waiting and len(raw) != len(self._waiting[0])):
            self.decode()
        self._waiting.append(raw)

    def decode(self) -> None:
        """Decode the pending samples, at once if all their fields have equal lengths, else one by one."""
        waiting, self._waiting = self._waiting, []
        while waiting:
            block = np.frombuffer(b"".join(waiting), _layout_of(self._deserialize(waiting[0])))
            if any((block[name] != block[name][0]).any() for name in SIZES):
                block, waiting = block[:1], waiting[1:]
            else:
                waiting = []
            self._stamps.frombytes((block["secs"] + 1e-9 * block["nsecs"]).tobytes())
            self._values.frombytes(block["values"][:, self._columns].tobytes())
            self._valid += block["valid"].tobytes()

    def stream(self) -> SynchronisedStream:
        layout, n = self._layout, len(self)
        return SynchronisedStream(
            float(layout.rate),
            [str(layout.names[k]) for k in self._columns],
            [str(layout.sources[k]) for k in self._columns],
            list(dict.fromkeys(map(str, layout.sources))),
            np.frombuffer(self._stamps),
            np.frombuffer(self._values).reshape(n, len(self._columns)),
            np.frombuffer(self._valid, dtype=bool).reshape(n, -1),
            self._skew,
            self._late,
        )


def _layout_of(sample: Any) -> np.dtype[Any]:
    """Return the memory layout of serialised SyncedSamples whose strings and arrays are as long as in `sample`."""
    return np.dtype(
        [
            *((name, "<u4") for name in ("seq", "secs", "nsecs", "frame_size")),
            ("frame_id", "u1", len(sample.header.frame_id.encode())),
            *(("value_count", "<u4"), ("values", "<f8", len(sample.values))),
            *(("age_count", "<u4"), ("age", "<f4", len(sample.age))),
            *(("valid_count", "<u4"), ("valid", "?", len(sample.valid))),
        ]
    )


def _counts(messages: list[Any]) -> dict[str, SourceCounts]:
    by_source: dict[str, list[Any]] = {}
    for message in messages:
        by_source.setdefault(str(message.source), []).append(message)
    return {
        source: SourceCounts(
            float(messages[-1].rate),
            np.array([seconds(message.header.stamp) for message in messages]),
            np.array([message.next for message in messages], np.int64),
            np.array([message.sent for message in messages], np.int64),
        )
        for source, messages in by_source.items()
    }


def missed_deadlines(bag: Bag) -> int | None:
    """Return the total number of missed deadlines of all control loops; None: not published, as in a headless run."""
    missed: dict[str, int] = {}
    for connection, _, raw in bag.chosen(lambda connection: connection.msgtype == DIAGNOSTICS):
        for status in bag.deserialize(raw, connection.msgtype).status:
            for pair in status.values:
                if pair.key == MISSED:
                    missed[status.name] = int(pair.value)
    return sum(missed.values()) if missed else None
