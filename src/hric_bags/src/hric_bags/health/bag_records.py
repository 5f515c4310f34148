"""Scan of a bag in file order, even of a damaged or unfinished one, by ROS's bag format 2.0."""

import os
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hric_bags import foreign
from hric_bags.health import file_records
from hric_bags.health.compressed import Unpacked, unpack
from hric_bags.health.file_records import (
    BAG_HEADER,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    LENGTH,
    MESSAGE,
    Fields,
    FileView,
    Record,
    fields_of,
)
from hric_core.errors import HricError

MAGIC = b"#ROSBAG V2.0\n"
_TIME, _POSITION, _ENTRY, _COUNT = (struct.Struct(layout) for layout in ("<II", "<Q", "<8sI", "<II"))


class NotABagError(HricError):
    """Error for a file that is not a bag of format version 2.0."""


@dataclass(frozen=True)
class BagConnection:
    """Connection record of a bag: topic, type and publisher of messages.

    Attributes:
        topic, type_name, md5sum, definition: name and type of the topic; type_name as ROS 1 writes it, e.g.
            "std_msgs/String".
        caller: name of the publishing node; may be empty.
        latching: True if new subscribers receive the last message.
    """

    topic: str
    type_name: str
    md5sum: str
    definition: str
    caller: str
    latching: bool


@dataclass
class _Chunk:
    """Chunk of a bag, with the index records after it and its summary in the index at the file's end."""

    record: Record
    index: list[Record]
    summary: tuple[bytes, bytes, dict[int, int]] | None = None


class BagScan:
    """Scan of a bag: one pass over the file by `messages`, which fills the attributes.

    Attributes:
        path: path of the bag.
        connections: connections by number.
        chunks: number of closed chunks.
        damage: sentences on damage of the file.
        doubtful: sentences on messages that may have wrong values, because the checksum of their chunk is wrong.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: dict[int, BagConnection] = {}
        self.chunks = 0
        self.damage: list[str] = []
        self.doubtful: list[str] = []
        self._fields: dict[int, Fields] = {}
        self._indexed: set[int] = set()
        self._used: set[int] = set()

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield (number of the connection, recording time [ns], serialised message) in the order of the file.

        Raises:
            NotABagError: the file is empty or of another format.
        """
        with self.path.open("rb") as file:
            view = FileView(file, os.fstat(file.fileno()).st_size)
            for chunk in self._chunks(view):
                yield from self._messages(view, chunk)
        if self._indexed and (missing := sorted(self._used - self._indexed)):
            self.damage.append(f"the index has no record of the connections {missing}: readers miss their messages")

    def _chunks(self, view: FileView) -> list[_Chunk]:
        """Read everything except the data of the chunks, and return these."""
        kinds = (BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION)
        records = list(file_records.walk(view, len(MAGIC), kinds))
        self._check_begin(view, records)
        chunks: dict[int, _Chunk] = {}
        summaries: dict[int, tuple[bytes, bytes, dict[int, int]]] = {}
        last: _Chunk | None = None
        for record in records:
            if record.kind == CHUNK:
                last = chunks[record.offset] = _Chunk(record, [])
            elif record.kind == INDEX and last is not None:
                last.index.append(record)
            elif record.kind == CONNECTION:
                self._indexed.add(LENGTH.unpack(record.fields[b"conn"])[0])
                self._connection(record.fields, view[record.start : record.end], confirmed=False)
            elif record.kind == CHUNK_INFO:
                summaries[_POSITION.unpack(record.fields[b"chunk_pos"])[0]] = (
                    record.fields[b"start_time"],
                    record.fields[b"end_time"],
                    dict(_unpacked(_COUNT, view, record)),
                )
        self._check_index(view, records, set(chunks) == set(summaries))
        for offset, chunk in chunks.items():
            chunk.summary = summaries.get(offset)
        return list(chunks.values())

    def _check_begin(self, view: FileView, records: list[Record]) -> None:
        begins = view[: len(MAGIC)] == MAGIC
        if (kind := foreign.describe(self.path)) or not (begins or any(record.kind == CHUNK for record in records)):
            raise NotABagError(kind or f"{self.path} is not a bag of version 2.0 ({len(view)} bytes)")
        if not begins:
            self.damage.append("the first bytes are not those of a bag: readers refuse the file")
        if records and (name := records[0].fields.get(b"encryptor")):
            raise NotABagError(f"{self.path} is encrypted ({name.decode(errors='replace')}); decrypt it first")

    def _check_index(self, view: FileView, records: list[Record], complete: bool) -> None:
        """Compare the index at the file's end with the counts in its head, and note bytes that are not records."""
        head = next((record.fields for record in records if record.kind == BAG_HEADER), {})
        begin = _POSITION.unpack(head.get(b"index_pos", bytes(8)))[0]
        counts = Counter(record.kind for record in records if record.offset >= begin)
        expected = [LENGTH.unpack(head.get(name, bytes(4)))[0] for name in (b"conn_count", b"chunk_count")]
        offsets = {record.offset for record in records} | {len(view)}
        for record in records:
            # Old recorders leave zeros before the index, which readers skip.
            if record.kind == 0 and (record.end not in (begin, len(view)) or any(view[record.start : record.end])):
                self.damage.append(f"bytes {record.start} to {record.end} are damaged")
            if record.open:
                self.damage.append(
                    f"the last chunk was not closed ({record.end - record.start} bytes of it exist): the recorder was "
                    "killed"
                )
            elif not record.exact and record.end == len(view):
                self.damage.append("the file ends within a record: it was cut off")
            elif not record.exact and record.kind != CHUNK:
                self.damage.append(f"the record at byte {record.offset} has a wrong length")
        if begin == 0 or begin not in offsets or [counts[CONNECTION], counts[CHUNK_INFO]] != expected or not complete:
            self.damage.append("the index is missing or damaged: readers cannot open the bag, or miss messages")

    def _messages(self, view: FileView, chunk: _Chunk) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of a chunk as `messages` does, and note damage of the chunk."""
        record = chunk.record
        stated = record.fields[b"compression"].decode(errors="replace")
        unpacked = unpack(view[record.start : record.end], stated)
        self.chunks += not record.open
        entries = _entries(view, chunk.index)
        indexed, times, counts, lost = bool(entries), list[int](), Counter[int](), not unpacked.complete
        begin = None  # offset of a connection record before a message, to which the index of some programs points
        for inner in file_records.walk(unpacked.data, 0, (MESSAGE, CONNECTION)):
            data = unpacked.data[inner.start : inner.end]
            if inner.kind == CONNECTION:
                self._connection(inner.fields, data, confirmed=unpacked.verified)
                begin = inner.offset if begin is None else begin
                continue
            if inner.kind == 0 or not inner.certain:
                lost = True
                continue
            lost |= not inner.exact
            number, time = LENGTH.unpack(inner.fields[b"conn"])[0], inner.fields[b"time"]
            entry = entries.pop(inner.offset, None) or entries.pop(begin, None)
            begin = None
            if not unpacked.verified and not (entry in (None, (number, time)) and self._is_readable(number, data)):
                lost = True
                continue
            lost |= indexed and entry != (number, time)
            times.append(_nanoseconds(time))
            counts[number] += 1
            self._used.add(number)
            yield number, times[-1], data
        if not record.open:
            self._judge(chunk, unpacked, times, counts, lost or bool(entries) or (bool(times) and not indexed))

    def _judge(self, chunk: _Chunk, unpacked: Unpacked, times: list[int], counts: Counter[int], differs: bool) -> None:
        """Note damage of a chunk, given recording times [ns] and counts by connection of the messages read from it."""
        offset, fields = chunk.record.offset, chunk.record.fields
        stated = fields[b"compression"].decode(errors="replace"), LENGTH.unpack(fields[b"size"])[0]
        differs |= stated != (unpacked.compression, len(unpacked.data)) or not chunk.record.exact
        if chunk.summary is not None and times:
            first, last, expected = chunk.summary
            differs |= (_nanoseconds(first), _nanoseconds(last), expected) != (min(times), max(times), dict(counts))
        if differs:
            self.damage.append(
                f"the chunk at byte {offset}, or its index, is damaged: {len(times)} messages are readable"
            )
        if not unpacked.complete and times:
            begin, end = min(times) * 1e-9, max(times) * 1e-9
            self.doubtful.append(
                f"{len(times)} messages, recorded from {begin:.3f} s to {end:.3f} s, may have wrong values: the "
                f"checksum of the chunk at byte {offset} is wrong"
            )

    def _is_readable(self, number: int, data: bytes) -> bool:
        """Return False if a message cannot be deserialised as its type; True also if the type is not known."""
        known = self.connections.get(number)
        store = None if known is None else _store(known)
        if known is None or store is None:
            return True
        try:
            store.deserialize_ros1(data, known.type_name.replace("/", "/msg/"))
        except Exception:  # damaged bytes may raise any error
            return False
        return True

    def _connection(self, fields: Fields, data: bytes, *, confirmed: bool) -> None:
        """Store a connection record, unless a better copy is known; confirmed: True if a checksum confirms it."""
        number, inner = LENGTH.unpack(fields[b"conn"])[0], fields_of(data)
        if inner is None:
            self.damage.append(f"a record of the connection {number} is damaged: readers refuse the bag")
            return
        text = {key: value.decode("utf-8", "replace") for key, value in inner.items()}
        # The topic is taken from the record's header, since the data have its name before remapping.
        connection = BagConnection(
            fields[b"topic"].decode("utf-8", "replace"),
            text.get(b"type", ""),
            text.get(b"md5sum", ""),
            text.get(b"message_definition", ""),
            text.get(b"callerid", ""),
            text.get(b"latching", "0") == "1",
        )
        known = self.connections.setdefault(number, connection)
        if known == connection and self._fields.setdefault(number, inner) == inner:
            return
        self.damage.append(f"two records of the connection {number} ({known.topic}) differ")
        if confirmed or _is_sound(connection, text.get(b"topic", "")) > _is_sound(known, text.get(b"topic", "")):
            self.connections[number] = connection


def _is_sound(connection: BagConnection, topic: str) -> bool:
    """Return True if a connection's MD5 sum matches its message definition, and its topic is `topic`."""
    return _store(connection) is not None and connection.topic == topic


@lru_cache
def _store(connection: BagConnection) -> Typestore | None:
    """Return the typestore that reads messages of a connection; None: its message definition is damaged."""
    store, name = get_typestore(Stores.EMPTY), connection.type_name.replace("/", "/msg/")
    try:
        store.register(get_types_from_msg(connection.definition, name))
        return store if store.generate_msgdef(name)[1] == connection.md5sum else None
    except Exception:  # a damaged definition may raise any error
        return None


def _entries(view: FileView, index: list[Record]) -> dict[int | None, tuple[int, bytes]]:
    """Return the index of a chunk: offset of a message in the chunk -> (number of its connection, time)."""
    entries: dict[int | None, tuple[int, bytes]] = {}
    for record in index:
        number = LENGTH.unpack(record.fields[b"conn"])[0]
        entries.update((offset, (number, time)) for time, offset in _unpacked(_ENTRY, view, record))
    return entries


def _unpacked(layout: struct.Struct, view: FileView, record: Record) -> Iterator[tuple[Any, ...]]:
    """Yield the complete entries of a record with a layout; the record may be cut off."""
    return layout.iter_unpack(view[record.start : record.end - (record.end - record.start) % layout.size])


def _nanoseconds(time: bytes) -> int:
    seconds, rest = _TIME.unpack(time)
    return int(seconds) * 1_000_000_000 + int(rest)
