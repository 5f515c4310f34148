"""Reader of a bag into one table per topic, without ROS."""

import contextlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection

from hric_bags import foreign, run_notes
from hric_bags import parts as bag_parts
from hric_bags import reader as bag_reader
from hric_bags.export import batches, units
from hric_bags.export.anonymous import Anonymiser
from hric_bags.export.gather import Gatherer, Timing
from hric_bags.export.table import ExportError, TopicTable
from hric_bags.health import examine
from hric_bags.health.salvage import ACTIVE
from hric_bags.parts import PartsReader
from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_core.errors import UnknownNameError

PICTURES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
"""Message types of pictures."""
RUN_CLOCK, BAG_CLOCK = "the start of the run", "the first recording of the bag"


@dataclass(frozen=True)
class ExportSource:
    """Bag to be exported, with its run folder if there is one.

    Attributes:
        bags: files of the bag: its parts, of which adjacent ones overlap.
        folder: run folder; None: a bag without one.
        run: contents of run.yaml; empty for a bag without a run folder.
        urdf: URDF of the robot; empty: not known.
    """

    bags: tuple[Path, ...]
    folder: RunFolder | None
    run: RunFile
    urdf: str

    @property
    def bag(self) -> Path:
        """Path of the bag, or of its first part."""
        return self.bags[0]

    @property
    def output(self) -> Path:
        """Default folder of an export."""
        return self.bag.with_name(f"{self.bag.stem}_export") if self.folder is None else self.folder.path / "export"


def find(name: str, root: Path | None = None) -> ExportSource:
    """Return the bag of a run, or a bag without a run folder.

    Args:
        name: path of a bag or run folder, or name of a run, such as "latest".
        root: folder of all runs.

    Raises:
        HricError: there is no such bag, or it was not closed.
    """
    bags, folder = examine.find(name, root)
    for bag in bags:
        if bag.name.endswith(ACTIVE):
            raise ExportError(f"{bag.name} was not closed; if its recorder was killed: hric health --salvage {name}")
    urdf = folder.urdf_path.read_text() if folder is not None and folder.urdf_path.is_file() else ""
    paths = bags if foreign.is_ros2(bags[0]) else bag_parts.parts(bags[0])
    return ExportSource(tuple(paths), folder, {} if folder is None else folder.read(), urdf)


@contextlib.contextmanager
def open_reader(source: ExportSource) -> Iterator[PartsReader]:
    """Yield an open reader of the bag to be exported.

    Raises:
        ExportError: the system refuses to read the bag.
    """
    try:
        with PartsReader(source.bag) as reader:
            yield reader
    except OSError as error:
        raise ExportError(f"cannot read {source.bag}: {error.strerror or error}") from error


def read(
    source: ExportSource,
    topics: Collection[str] = (),
    *,
    progress: bool = False,
    types: Collection[str] = (),
    anonymous: Anonymiser | None = None,
) -> dict[str, TopicTable]:
    """Read topics of a bag, and return their tables by topic; notes on the run are a table, too, if all are read.

    Args:
        source: bag to be read.
        topics: topic names; empty: all.
        progress: True to draw a progress bar.
        types: message types to read, e.g. "hric_msgs/msg/MocapData"; empty: all.
        anonymous: anonymiser of the messages; None: they are not anonymised.

    Raises:
        HricError: the bag is damaged, does not have a requested topic, or two types of messages share a topic.
    """
    with open_reader(source) as reader:
        for topic in topics:
            if topic not in reader.topics:
                raise UnknownNameError("topic", topic, reader.topics, "the bag")
        gathering = _Gathering(reader, units.prismatic_joints(source.urdf), topics, types, anonymous)
        kinds: dict[str, str] = {}
        for connection in filter(gathering.takes, reader.connections):
            if kinds.setdefault(connection.topic, connection.msgtype) != connection.msgtype:
                raise ExportError(f"{connection.topic} has messages of two types; valid: one; leave it out by --topics")
        for connection, stamp, raw in reader.chosen(gathering.takes, "reading" if progress else ""):
            gathering.add(connection, stamp, raw)
        begin = reader.start_time if reader.message_count else 0
        tables = gathering.tables(begin if anonymous is None else anonymous.time(begin))
    if anonymous is None and not topics and (added := notes(source)):
        tables[run_notes.TOPIC] = run_notes.table(added)
    return tables


def notes(source: ExportSource) -> list[run_notes.AddedNote]:
    """Return the notes that were added to the run afterwards; empty: there are none, or no run folder."""
    return [] if source.folder is None else run_notes.read(source.folder.path)


def pictures(source: ExportSource) -> list[str]:
    """Return the topics of a bag with pictures of cameras."""
    with open_reader(source) as reader:
        return [c.topic for c in reader.connections if c.msgtype in PICTURES]


class _Gathering:
    """Collector of the messages of one pass; control logs are always read, since they define the clock."""

    def __init__(
        self,
        reader: PartsReader,
        prismatic: frozenset[str],
        topics: Collection[str],
        types: Collection[str],
        anonymous: Anonymiser | None,
    ) -> None:
        self._reader = reader
        self._fields = {
            kind: [name for name, _ in definition[1]] for kind, definition in reader.typestore.fielddefs.items()
        }
        self._prismatic, self._topics, self._types, self._anonymous = prismatic, topics, types, anonymous
        self._gatherers: dict[str, Gatherer] = {}
        self._batches: dict[str, tuple[str, list[Any]]] = {}
        self._clocks: dict[str, list[tuple[float, float]]] = {}
        self._layout: Any = None

    def takes(self, connection: Connection) -> bool:
        """Return True if the messages of a connection have to be read."""
        if self._anonymous is not None and self._anonymous.hides(connection.msgtype):
            return False
        return connection.msgtype == batches.CONTROL_LOG or self._is_requested(connection)

    def _is_requested(self, connection: Connection) -> bool:
        return (not self._topics or connection.topic in self._topics) and (
            not self._types or connection.msgtype in self._types
        )

    def add(self, connection: Connection, stamp: int, raw: bytes) -> None:
        """Add a serialised message; stamp: recording time [ns]."""
        topic, kind, anonymous = connection.topic, connection.msgtype, self._anonymous
        if anonymous is not None:
            topic, stamp = anonymous.name(topic), anonymous.time(stamp)
            if kind not in batches.BATCHED:
                raw, anonymous = anonymous.serialised(self._reader, connection, raw), None
        message = self._reader.deserialize(raw, kind)
        if anonymous is not None:
            message = anonymous.message(message)
        if kind == batches.CONTROL_LOG:
            pair = bag_reader.seconds(message.header.stamp), float(message.time[0])
            self._clocks.setdefault(topic, []).append(pair)
        if not self._is_requested(connection):
            return
        if kind in batches.BATCHED:
            self._batches.setdefault(topic, (kind, []))[1].append(message)
            return
        if kind == batches.LAYOUT:
            self._layout = message
        if topic not in self._gatherers:
            self._gatherers[topic] = Gatherer(topic, kind, self._fields, self._prismatic)
        self._gatherers[topic].add(stamp, message)

    def tables(self, begin: int) -> dict[str, TopicTable]:
        """Return the tables by topic; begin: recording time of the bag's first message [ns]."""
        timing, clock = self._timing(begin)
        tables = [gatherer.table(timing, clock) for gatherer in self._gatherers.values()]
        tables += [
            batches.table_of(topic, kind, messages, timing, clock, self._prismatic)
            for topic, (kind, messages) in self._batches.items()
        ]
        if self._layout is not None:
            tables = [
                batches.named(table, self._layout) if table.type_name == batches.SYNCED else table for table in tables
            ]
        return {table.topic: table for table in sorted(tables, key=lambda table: table.topic)}

    def _timing(self, begin: int) -> tuple[Timing, str]:
        if not self._clocks:
            return (lambda stamp: (stamp - begin) * 1e-9), BAG_CLOCK
        robot_time = bag_reader.robot_time_of(next(iter(self._clocks.values())))
        return (lambda stamp: robot_time(stamp * 1e-9)), RUN_CLOCK
