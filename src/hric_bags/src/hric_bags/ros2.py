"""Bags of ROS 2 (SQLite or MCAP): reader that yields ROS 1 messages, and writer of the messages of a ROS 1 bag."""

from collections import Counter
from collections.abc import Collection, Generator, Iterator
from copy import copy
from heapq import merge
from pathlib import Path
from types import MappingProxyType
from typing import Any
from zlib import crc32

from rosbags.convert.converter import LATCH
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection, ConnectionExtRosbag1, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.store import Typestore

from hric_bags.indexed import BagError

HEADER = "std_msgs/msg/Header"
FRANKA = "franka_msgs/msg/FrankaState"
_UPPER = (
    *(
        "tau_J",
        "dtau_J",
        "tau_J_d",
        "K_F_ext_hat_K",
        "O_F_ext_hat_K",
        "O_dP_EE_d",
        "O_ddP_O",
        "O_dP_EE_c",
        "O_ddP_EE_c",
    ),
    *("F_x_Cee", "I_ee", "F_x_Cload", "I_load", "F_x_Ctotal", "I_total"),
    *("O_T_EE", "O_T_EE_d", "O_T_EE_c", "F_T_EE", "F_T_NE", "NE_T_EE", "EE_T_K"),
)
NAMES_IN_ROS1 = {name.lower(): name for name in _UPPER}
"""Field of FrankaState in ROS 2 -> in ROS 1; ROS 2 permits lower case only.

The names are those of franka_ros2's message: github.com/frankaemika/franka_ros2, franka_msgs/msg/FrankaState.msg.
"""
_NAMES_IN_ROS2 = {name: lower for lower, name in NAMES_IN_ROS1.items()}
STORAGES = {"mcap": StoragePlugin.MCAP, "ros2": StoragePlugin.SQLITE3}
"""Name of an export format -> storage of the ROS 2 bag."""
CHECKSUM = 1 + 8 + 3 * 8
"""Position of the checksum in the record of a chunk: after kind, length, two times and size (mcap.dev/spec)."""
VERSION = 8
"""Version of the metadata of written bags."""
LAST = 2**32 * 1_000_000_000
"""End of the recording times that ROS 1 can represent [ns]."""


def typestore(types: Typestore, *, ros1: bool) -> Typestore:
    """Return message types with the header and the names in FrankaState of ROS 1 (`ros1`) or ROS 2 (not `ros1`)."""
    names = NAMES_IN_ROS1 if ros1 else _NAMES_IN_ROS2
    standard = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE).fielddefs
    fields = {**standard, **types.fielddefs, HEADER: standard[HEADER]}
    if FRANKA in fields:
        constants, members = fields[FRANKA]
        fields[FRANKA] = constants, [(names.get(name, name), kind) for name, kind in members]
    converted = get_typestore(Stores.EMPTY)
    converted.register(fields)
    return converted


class Ros2Reader(AnyReader):
    """Reader of a bag of ROS 2, whose connections and messages are converted to ROS 1.

    Args:
        path: folder with metadata.yaml, or a file of SQLite (.db3) or MCAP.
    """

    def __init__(self, path: Path) -> None:
        super().__init__([path])
        self._path = path
        self.connections: list[Connection] = []
        self._stored: dict[int, Connection] = {}

    def _open(self) -> None:
        try:
            super()._open()
            self._stored = {connection.id: connection for connection in self.connections}
            types = typestore(self.typestore, ros1=True)
            self.connections = [self._converted(connection, types) for connection in self.connections]
        except Exception as error:  # a damaged file may raise any error
            raise self._unreadable(self._reason(error)) from error
        self._check()

    def _reason(self, error: Exception) -> str:
        """Return why the bag could not be opened, and what to do."""
        if isinstance(error, AnyReaderError) and {c.msgdef.format for c in self.readers[0].connections} == {
            MessageDefinitionFormat.NONE
        }:  # the file was opened
            return (
                "it has no definitions of its message types, as SQLite files of ROS 2 Humble; `ros2 bag convert` "
                "adds them when it writes .mcap"
            )
        reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        if isinstance(error, KeyError):
            reason += " is missing or not known"
        if isinstance(error, (KeyError, UnicodeDecodeError, TypesysError)):
            return (
                f"{reason}; valid: messages of ROS 2 (ros2msg, ros2idl) on all topics; `mcap filter` leaves topics out"
            )
        return reason + "; `mcap recover` repairs a file that was not closed" * (self._path.suffix == ".mcap")

    @property
    def _storage(self) -> Any:
        return self.readers[0].storage  # a bag of ROS 2 has one reader

    @property
    def _files(self) -> list[Any]:
        """Readers of the files of the bag."""
        return getattr(self._storage, "storages", [self._storage])

    def _check(self) -> None:
        """Raise BagError if messages of the bag would not be read."""
        for path in (file.path.with_name(f"{file.path.name}-wal") for file in self._files):
            if path.is_file() and path.stat().st_size:
                bag = path.name.removesuffix("-wal")
                raise self._unreadable(f"{path.name} has messages that {bag} lacks; `sqlite3 {bag} .tables` adds them")
        for file in self._files:
            if any(c.message_end_time and not c.channel_count for c in getattr(file, "chunks", ())):
                raise self._unreadable(
                    f"it has 0 of the messages of a chunk in {file.path.name}, which its index does not list; `mcap "
                    "recover` repairs it"
                )
        for time in (self.start_time, self.end_time - 1) if self.message_count else ():
            self._check_time(time, "a message")
        self._check_count(sum(c.msgcount for c in self.connections), self.message_count, "all topics")

    def _check_count(self, count: int, expected: int, what: str) -> None:
        if count < expected:
            raise self._unreadable(
                f"it has {count} of {expected} messages of {what}, so a file or its index is not complete; `ros2 bag "
                "reindex` or `mcap recover` repairs it"
            )

    def _check_time(self, time: int, what: str) -> None:
        if not 0 <= time < LAST:
            raise self._unreadable(f"{what} was recorded at {time} ns; valid: 0 to {LAST}")

    def _unreadable(self, error: Exception | str) -> BagError:
        reason = " ".join(str(error).split()) or type(error).__name__
        return BagError(f"cannot read {self._path.name}, a bag of ROS 2: {reason}")

    def _converted(self, connection: Connection, types: Typestore) -> Connection:
        text, checksum = types.generate_msgdef(connection.msgtype)
        latching = any(qos.durability.value == 1 for qos in connection.ext.offered_qos_profiles)
        return connection._replace(
            msgdef=MessageDefinition(MessageDefinitionFormat.MSG, text),
            digest=checksum,
            ext=ConnectionExtRosbag1(None, int(latching)),
            owner=self,
        )

    def messages(
        self, connections: Collection[Connection] = (), start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        """Yield (connection, recording time [ns], message serialised as in ROS 1) in the order of time.

        Raises:
            BagError: the bag is damaged.
        """
        by_id = {connection.id: connection for connection in connections or self.connections}
        items, counts = self._merged([self._stored[number] for number in by_id], start, stop), Counter[int]()
        while True:
            try:
                stored, time, raw = next(items)
            except StopIteration:
                break
            except Exception as error:  # a damaged file may raise any error
                raise self._unreadable(error) from error
            self._check_time(time, f"a message of {stored.topic}")
            try:
                message = bytes(self.typestore.cdr_to_ros1(raw, stored.msgtype))
            except Exception as error:  # a damaged message may raise any error
                raise self._unreadable(f"a message of {stored.topic}: {error}") from error
            counts[stored.id] += 1
            yield by_id[stored.id], time, message
        if start is None and stop is None:
            for number, connection in by_id.items():
                self._check_count(counts[number], connection.msgcount, connection.topic)

    def _merged(
        self, connections: Collection[Connection], start: int | None, stop: int | None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield messages as stored, in the order of time; rosbags reads one file of a folder after the other."""
        parts = [copy(self._storage) for _ in self._files]
        for part, file in zip(parts, self._files, strict=True):
            part.storages = [file]
        return merge(*(part.messages(connections, start, stop) for part in parts), key=lambda item: item[1])


class _CheckedMcapWriter(McapWriter):
    """Writer of MCAP files with a checksum of each chunk, which that of rosbags leaves out."""

    def close_chunk(self) -> None:
        crc, begin = crc32(self.chunk.bio.getvalue()), self.bio.tell()
        super().close_chunk()
        end = self.bio.tell()
        self.bio.seek(begin + CHECKSUM)
        self.bio.write(crc.to_bytes(4, "little"))
        self.bio.seek(end)


class Ros2Writer(Writer):
    """Writer of a ROS 2 bag from messages that are serialised as in ROS 1; MCAP is compressed by zstd.

    Args:
        folder: folder of the bag, which must not exist.
        kind: one of STORAGES.
        types: message types as in ROS 1.
    """

    STORAGE_PLUGINS = MappingProxyType({**Writer.STORAGE_PLUGINS, StoragePlugin.MCAP: _CheckedMcapWriter})

    def __init__(self, folder: Path, kind: str, types: Typestore) -> None:
        super().__init__(folder, version=VERSION, storage_plugin=STORAGES[kind])
        if kind == "mcap":
            self.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._types = typestore(types, ros1=False)

    def add_topic(self, topic: str, kind: str, *, latching: bool) -> Connection:
        """Add a topic; kind: message type; latching: True if new subscribers receive the last message."""
        qos = LATCH if latching else []
        return self.add_connection(topic, kind, typestore=self._types, offered_qos_profiles=qos)

    def write_ros1(self, connection: Connection, time: int, raw: bytes) -> None:
        """Write a message that is serialised as in ROS 1; time: recording time [ns]."""
        self.write(connection, time, self._types.ros1_to_cdr(raw, connection.msgtype))
