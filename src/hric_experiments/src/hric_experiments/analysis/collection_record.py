"""Reads from a bag what each source sent and what of it was recorded, and the synchronised streams. No ROS."""

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
"""Channel that holds robot time of each sample, of an emulated device."""
FRAME_NUMBERS = 1 << 32
"""After so many frames their counter begins again [frames]."""


@dataclass
class Numbered:
    """What came of one source, n samples.

    Attributes:
        source: as the driver calls it; "": a motion capture.
        rate: by the driver [Hz]; NaN: not known.
        stamps: shape (n,) [s].
        numbers: of the driver, shape (n,).
        codes: time code of each sample, shape (n,) [s]; None: there is none.
    """

    source: str
    rate: float
    stamps: FloatArray
    numbers: IntArray
    codes: FloatArray | None


@dataclass
class Counts:
    """What a source counted of what it sent, in order.

    Attributes:
        rate: per second of robot time [Hz].
        stamps: of the last sample sent, shape (n,) [s].
        following: number of the next one, shape (n,).
        sent: so far, shape (n,).
    """

    rate: float
    stamps: FloatArray
    following: IntArray
    sent: IntArray


@dataclass
class Stream:
    """Synchronised samples.

    Attributes:
        rate: [Hz]; 0: at the stamps of a reference.
        names, sources: of the values, and the topic of each.
        stamps: shape (n,) [s].
        values: shape (n, values).
        valid: shape (n, topics), in the order in which they first appear in `sources`.
        skew: topic -> the largest that the synchroniser reported [s].
        late: topic -> samples that came after their instants had gone out.
    """

    rate: float
    names: list[str]
    sources: list[str]
    stamps: FloatArray
    values: FloatArray
    valid: npt.NDArray[np.bool_]
    skew: dict[str, float] = field(default_factory=dict)
    late: dict[str, int] = field(default_factory=dict)

    @property
    def topics(self) -> list[str]:
        """Of `valid`."""
        return list(dict.fromkeys(self.sources))


@dataclass
class Collection:
    """All that a bag has of its sources.

    Attributes:
        sources: topic -> what came.
        counts: source -> what it sent.
        streams: topic -> synchronised samples.
        truth: where the emulated hand was: (robot time (n,) [s], position (n, 3) [m]), and the frame of it; None: not
            known.
        frame: that the motion capture's positions are given in.
    """

    sources: dict[str, Numbered]
    counts: dict[str, Counts]
    streams: dict[str, Stream]
    truth: tuple[FloatArray, FloatArray, str] | None = None
    frame: str = ""


def read(bag: Path | Bag) -> Collection | None:
    """Read a bag with all its parts; None: it has neither samples nor frames nor synchronised samples."""
    found: dict[str, dict[str, list[Any]]] = {kind: {} for kind in (*TYPES, TRUTH_TOPIC)}
    with opened(bag) as reader:
        counted = [c for c in reader.connections if c.msgtype in TYPES or c.topic.endswith(TRUTH_TOPIC)]
        if not any(c.msgtype in (CHUNK, FRAMES, SAMPLE) for c in counted):
            return None
        for connection, _, raw in reader.messages(connections=counted):
            kind = TRUTH_TOPIC if connection.topic.endswith(TRUTH_TOPIC) else connection.msgtype
            message = reader.deserialize(raw, connection.msgtype)
            found[kind].setdefault(connection.topic, []).append(_ROWS[kind](message) if kind in _ROWS else message)
    sources = {topic: _chunks(messages) for topic, messages in found[CHUNK].items()}
    sources |= {topic: _frames(rows) for topic, rows in found[FRAMES].items()}
    statuses = {topic.removesuffix("_status"): messages for topic, messages in found[STATUS].items()}
    layouts = {topic.removesuffix("_layout"): messages[-1] for topic, messages in found[LAYOUT].items()}
    streams = {
        topic: _stream(rows, layouts[topic], statuses.get(topic, []))
        for topic, rows in found[SAMPLE].items()
        if topic in layouts
    }
    frames = [row for rows in found[FRAMES].values() for row in rows]
    return Collection(
        sources,
        _counts(found[COUNT]),
        streams,
        _truth([message for messages in found[TRUTH_TOPIC].values() for message in messages]),
        frames[0][2] if frames else "",
    )


_ROWS: dict[str, Callable[[Any], tuple[Any, ...]]] = {
    FRAMES: lambda message: (seconds(message.header.stamp), message.frame_number, message.header.frame_id),
    SAMPLE: lambda message: (seconds(message.header.stamp), message.values, message.valid),
}
"""Of these there are many: what is kept of a message."""


def _chunks(messages: list[Any]) -> Numbered:
    stamps, numbers, codes = [], [], []
    for message in messages:
        width = max(len(message.channels), 1)
        data = np.asarray(message.data).reshape(-1, width)
        steps = np.arange(len(data))
        stamps.append(seconds(message.header.stamp) + steps / message.rate)
        numbers.append(message.first_sample + steps)
        codes.append(
            data[:, message.channels.index(TIME_CODE)] if TIME_CODE in message.channels else np.full(len(data), np.nan)
        )
    code = np.concatenate(codes)
    return Numbered(
        str(messages[-1].source),
        min(float(message.rate) for message in messages),  # higher where the run lost time
        np.concatenate(stamps),
        np.concatenate(numbers).astype(np.int64),
        None if np.isnan(code).all() else code,
    )


def _frames(rows: list[tuple[float, int, str]]) -> Numbered:
    numbers = np.asarray(np.unwrap([int(row[1]) for row in rows], period=FRAME_NUMBERS), np.int64)
    return Numbered("", float("nan"), np.array([row[0] for row in rows]), numbers, None)


def _counts(found: dict[str, list[Any]]) -> dict[str, Counts]:
    by_source: dict[str, list[Any]] = {}
    for messages in found.values():
        for message in messages:
            by_source.setdefault(str(message.source), []).append(message)
    return {
        source: Counts(
            float(messages[-1].rate),
            np.array([seconds(message.header.stamp) for message in messages]),
            np.array([message.next for message in messages], np.int64),
            np.array([message.sent for message in messages], np.int64),
        )
        for source, messages in by_source.items()
    }


def _stream(rows: list[tuple[float, Any, Any]], layout: Any, statuses: list[Any]) -> Stream:
    skew: dict[str, float] = {}
    for message in statuses:
        for topic, largest in zip(message.sources, message.skew_max, strict=True):
            skew[str(topic)] = max(skew.get(str(topic), 0.0), float(largest))
    late = dict(zip(map(str, statuses[-1].sources), map(int, statuses[-1].late), strict=True)) if statuses else {}
    return Stream(
        float(layout.rate),
        [str(name) for name in layout.names],
        [str(source) for source in layout.sources],
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows], dtype=float),
        np.array([row[2] for row in rows], dtype=bool),
        skew,
        late,
    )


def _truth(messages: list[Any]) -> tuple[FloatArray, FloatArray, str] | None:
    if len(messages) < 4:
        return None
    time = np.array([seconds(message.header.stamp) for message in messages])
    points = [message.pose.position for message in messages]
    position = np.array([(point.x, point.y, point.z) for point in points])
    rising = np.concatenate([[True], np.diff(time) > 0])
    return time[rising], position[rising], str(messages[0].header.frame_id)


def missed_deadlines(bag: Bag) -> int | None:
    """Cycles that began late until the last diagnostics, of all control loops; None: no loop said so (headless)."""
    found: dict[str, int] = {}
    for connection, _, raw in bag.chosen(lambda one: one.msgtype == DIAGNOSTICS):
        for status in bag.deserialize(raw, connection.msgtype).status:
            for pair in status.values:
                if pair.key == MISSED:
                    found[status.name] = int(pair.value)
    return sum(found.values()) if found else None
