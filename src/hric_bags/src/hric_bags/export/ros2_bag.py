"""Export of a bag as a bag of ROS 2."""

from pathlib import Path

from hric_bags.export.anonymous import Anonymiser
from hric_bags.export.recording import ExportSource, open_reader
from hric_bags.export.table import ExportError
from hric_bags.ros2 import Ros2Writer


def write(
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
