"""Copies of a bag: with one message per sample, for viewers that draw one value per message, or as a bag of ROS 2.

In the first, messages with many samples (control logs, sample chunks) are split; all others are copied.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.chunked_writer import ChunkedWriter
from hric_bags.export import batches
from hric_bags.export.anonymous import Anonymiser
from hric_bags.export.recording import ExportSource, open_reader
from hric_bags.export.table import ExportError, IntArray
from hric_bags.parts import PartsReader
from hric_bags.reader import ARRAYS
from hric_bags.ros2 import Ros2Writer

Fields = dict[str, npt.NDArray[Any]]
"""Field of a message -> values of that field, one row per sample."""


def write(
    source: ExportSource,
    target: Path,
    topics: tuple[str, ...] = (),
    *,
    progress: bool = False,
    anonymous: Anonymiser | None = None,
) -> int:
    """Write a copy of a bag in which each sample is a message, recorded at the time of the sample.

    Args:
        source: bag to be read.
        target: path of the new bag; must not exist.
        topics: topics to be copied; empty: all.
        progress: True to draw a progress bar.
        anonymous: anonymiser of the messages; None: they are not anonymised.

    Returns:
        Number of messages written.

    Raises:
        ExportError: the bag cannot be read.
    """
    count = 0
    with open_reader(source) as reader, ChunkedWriter(target) as writer:
        connections = [c for c in reader.connections if not topics or c.topic in topics]
        if anonymous is not None:
            connections = [c for c in connections if not anonymous.hides(c.msgtype)]
        by_key = {_key(c): c for c in connections}
        added = {key: _add(writer, c, anonymous) for key, c in by_key.items()}
        target_of = {id(c): added[_key(c)] for c in connections}
        for connection, time, raw in reader.chosen(connections.__contains__, "bag" if progress else ""):
            end = target_of[id(connection)]
            for at, data in _parts(reader, connection, time, raw, anonymous):
                writer.write(end, at, data)
                count += 1
    return count


def write_ros2(
    source: ExportSource,
    folder: Path,
    kind: str,
    topics: tuple[str, ...] = (),
    *,
    progress: bool = False,
    anonymous: Anonymiser | None = None,
) -> None:
    """Write the messages of a bag as a bag of ROS 2, each with its recording time.

    Args:
        source: bag to be read.
        folder: folder of the new bag, which must not exist.
        kind: storage of the new bag, one of `ros2.STORAGES`.
        topics: topics to be copied; empty: all.
        progress: True to draw a progress bar.
        anonymous: anonymiser of the messages; None: they are not anonymised.

    Raises:
        ExportError: two types of messages share a topic, which ROS 2 does not permit.
    """
    with open_reader(source) as reader, Ros2Writer(folder, kind, reader.typestore) as writer:
        connections = [c for c in reader.connections if not topics or c.topic in topics]
        if anonymous is not None:
            connections = [c for c in connections if not anonymous.hides(c.msgtype)]
        latching = {c.topic for c in connections if getattr(c.ext, "latching", 0)}
        targets = {}
        for topic, type_name in dict.fromkeys((c.topic, c.msgtype) for c in connections):
            if topic in targets:
                raise ExportError(f"{topic} has messages of two types; valid in ROS 2: one; leave it out by --topics")
            name = topic if anonymous is None else anonymous.name(topic)
            targets[topic] = writer.add_topic(name, type_name, latching=topic in latching)
        for connection, time, raw in reader.chosen(connections.__contains__, kind if progress else ""):
            if anonymous is not None:
                raw, time = anonymous.serialised(reader, connection, raw), anonymous.time(time)
            writer.write_ros1(targets[connection.topic], time, raw)


def _key(connection: Any) -> tuple[Any, ...]:
    """Return a key that is equal for the connections of one publisher in all parts of a bag."""
    return connection.topic, connection.msgtype, connection.digest, connection.ext.callerid, connection.ext.latching


def _add(writer: ChunkedWriter, connection: Any, anonymous: Anonymiser | None) -> Any:
    name = str if anonymous is None else anonymous.name
    definition: str = connection.msgdef.data
    return writer.add_connection(
        name(connection.topic),
        connection.msgtype,
        msgdef=definition if anonymous is None else re.sub(r"[ \t]*#.*", "", definition),  # comments are texts
        md5sum=connection.digest,
        callerid=None if connection.ext.callerid is None else name(connection.ext.callerid),
        latching=connection.ext.latching,
    )


def _parts(
    reader: PartsReader, connection: Any, time: int, raw: bytes, anonymous: Anonymiser | None
) -> Iterator[tuple[int, Any]]:
    """Yield (time [ns], serialised message) of each sample in a message."""
    kind = connection.msgtype
    if kind not in batches.BATCHED:
        if anonymous is not None:
            raw, time = anonymous.serialised(reader, connection, raw), anonymous.time(time)
        yield time, raw
        return
    message = reader.deserialize(raw, kind)
    if anonymous is not None:
        message, time = anonymous.message(message), anonymous.time(time)
    stamp = int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
    offsets, values = _cycles(message) if kind == batches.CONTROL_LOG else _samples(message)
    if not len(offsets):
        return
    values["sec"], values["nanosec"] = (part.astype("<u4") for part in np.divmod(stamp + offsets, 1_000_000_000))
    # The last sample was taken about when the message was recorded; the times between samples follow from the stamps.
    times = np.maximum(time + offsets - offsets[-1], 0).tolist()
    yield from zip(times, _serialised(reader, kind, message, values), strict=True)


def _cycles(message: Any) -> tuple[IntArray, Fields]:
    """Return the time of each cycle since the first one [ns], and the fields that differ between cycles."""
    n = int(message.n_cycles)
    rows = {name: getattr(message, name).reshape(n, -1) for name in ("time", *ARRAYS)}
    numbers = {"first_cycle": message.first_cycle + np.arange(n, dtype="<u8"), "n_cycles": np.ones(n, "<u4")}
    return np.rint((message.time - message.time[:1]) * 1e9).astype(np.int64), {**rows, **numbers}


def _samples(message: Any) -> tuple[IntArray, Fields]:
    """Return the time of each sample since the first one [ns], and the fields that differ between samples."""
    width = max(len(message.channels), 1)
    n = len(message.data) // width
    step = 1e9 / message.rate if message.rate > 0 else 0.0
    numbers = message.first_sample + np.arange(n, dtype="<u8")
    return np.rint(np.arange(n) * step).astype(np.int64), {
        "data": message.data[: n * width].reshape(n, width),
        "first_sample": numbers,
    }


def _serialised(reader: PartsReader, kind: str, message: Any, values: Fields) -> Iterator[bytes]:
    """Yield serialised messages that differ only in some fields.

    One message is serialised with a mark in each of these fields; the marks are then overwritten by the values.

    Args:
        reader: reader of the bag.
        kind: message type.
        message: one of the messages.
        values: values of the fields and of the stamp, one row per message, in ROS's data types.
    """
    marks = _marks(tuple((name, rows.shape[1:], rows.dtype) for name, rows in values.items()))
    fields = {name: mark if mark.ndim else int(mark) for name, mark in marks.items()}
    stamp = replace(message.header.stamp, sec=fields.pop("sec"), nanosec=fields.pop("nanosec"))
    marked = replace(message, header=replace(message.header, stamp=stamp), **fields)
    raw = bytes(reader.typestore.serialize_ros1(marked, kind))
    made = np.tile(np.frombuffer(raw, np.uint8), (len(values["sec"]), 1))
    for name, mark in marks.items():
        begin = raw.index(mark.tobytes())
        made[:, begin : begin + mark.nbytes] = np.ascontiguousarray(values[name]).view(np.uint8).reshape(len(made), -1)
    data, size = made.tobytes(), made.shape[1]
    return (data[at : at + size] for at in range(0, len(data), size))


@cache
def _marks(fields: tuple[tuple[str, tuple[int, ...], np.dtype[Any]], ...]) -> Fields:
    """Return a mark for each field, given its name, shape and type: random numbers, found again by their bytes."""
    random = np.random.default_rng(0)
    return {name: random.integers(1 << 30, 1 << 31, shape).astype(kind) for name, shape, kind in fields}
