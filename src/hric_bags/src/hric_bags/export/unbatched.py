"""A bag with one message per sample, for viewers that draw a value per message: control logs and chunks of samples
taken apart, the rest copied."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer

from hric_bags.export import batches
from hric_bags.export.anonymous import Anonymiser
from hric_bags.export.recording import Source, open_reader
from hric_bags.reader import ARRAYS


def write(
    source: Source,
    target: Path,
    topics: tuple[str, ...] = (),
    *,
    progress: bool = False,
    anonymous: Anonymiser | None = None,
) -> int:
    """Copy a bag; every message keeps its topic and type, and a sample is at its own time.

    Args:
        source: to be read.
        target: must not exist.
        topics: to which to keep; empty: all.
        progress: whether to draw a bar.
        anonymous: takes the person out; None: nothing is.

    Returns:
        Number of messages written.

    Raises:
        ExportError: the bag is damaged.
    """
    count = 0
    with open_reader(source) as reader, Writer(target) as writer:
        connections = [c for c in reader.connections if not topics or c.topic in topics]
        if anonymous is not None:
            connections = [c for c in connections if not anonymous.hides(c.topic)]
        by_key = {_key(c): c for c in connections}
        text = str if anonymous is None else anonymous.text
        target_of = {key: _add(writer, c, text) for key, c in by_key.items()}
        for connection, time, raw in reader.chosen(connections.__contains__, "bag" if progress else ""):
            for at, data in _parts(reader, connection.msgtype, time, raw):
                if anonymous is not None:
                    at, data = anonymous.time(at), _without_person(reader, connection.msgtype, data, anonymous)
                writer.write(target_of[_key(connection)], at, data)
                count += 1
    return count


def _key(connection: Any) -> tuple[Any, ...]:
    """Equal for the connections of one publisher in the parts of a bag."""
    return connection.topic, connection.msgtype, connection.digest, connection.ext.callerid, connection.ext.latching


def _without_person(reader: AnyReader, kind: str, data: Any, anonymous: Anonymiser) -> Any:
    return reader.typestore.serialize_ros1(anonymous.message(reader.deserialize(data, kind)), kind)


def _add(writer: Writer, connection: Any, text: Callable[[str], str]) -> Any:
    return writer.add_connection(
        text(connection.topic),
        connection.msgtype,
        msgdef=connection.msgdef.data,
        md5sum=connection.digest,
        callerid=None if connection.ext.callerid is None else text(connection.ext.callerid),
        latching=connection.ext.latching,
    )


def _parts(reader: AnyReader, kind: str, time: int, raw: bytes) -> Iterator[tuple[int, Any]]:
    """(time [ns], serialised message) of each sample in a message."""
    if kind not in batches.BATCHED:
        yield time, raw
        return
    message: Any = reader.deserialize(raw, kind)
    samples = list(_cycles(message) if kind == batches.CONTROL_LOG else _samples(message))
    # The last sample of a batch was taken about when the batch was recorded; the others as much before it as their
    # stamps are.
    for offset, sample in samples:
        yield max(time + offset - samples[-1][0], 0), reader.typestore.serialize_ros1(sample, kind)


def _cycles(message: Any) -> Iterator[tuple[int, Any]]:
    joints = len(message.joint_names)
    for k in range(int(message.n_cycles)):
        offset = round((float(message.time[k]) - float(message.time[0])) * 1e9)
        rows = {name: getattr(message, name)[k * joints : (k + 1) * joints] for name in ARRAYS}
        head = {"header": _header(message, offset), "first_cycle": int(message.first_cycle) + k, "n_cycles": 1}
        yield offset, replace(message, **head, time=np.array(message.time[k : k + 1]), **rows)


def _samples(message: Any) -> Iterator[tuple[int, Any]]:
    width = max(len(message.channels), 1)
    for k in range(len(message.data) // width):
        offset = round(k * 1e9 / message.rate) if message.rate > 0 else 0
        head = {"header": _header(message, offset), "first_sample": int(message.first_sample) + k}
        yield offset, replace(message, **head, data=message.data[k * width : (k + 1) * width])


def _header(message: Any, offset: int) -> Any:
    """The header with its stamp `offset` later [ns]."""
    stamp = message.header.stamp
    seconds, nanoseconds = divmod(int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) + offset, 1_000_000_000)
    return replace(message.header, stamp=replace(stamp, sec=seconds, nanosec=nanoseconds))
