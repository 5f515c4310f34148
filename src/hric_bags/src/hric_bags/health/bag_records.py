"""Reads the records of a bag in the order of the file, also of one whose recorder was killed; by the format's public
description, version 2.0."""

import bz2
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame

from hric_control.errors import HricError

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, CHUNK, CONNECTION = 2, 3, 5, 7
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")
_LARGEST_HEADER = 1 << 20
"""Headers are some hundred bytes; one beyond this is no header [B]."""
Fields = dict[bytes, bytes]


class NotABagError(HricError):
    """A file that is no bag of version 2.0."""


class _TruncatedError(Exception):
    """The data ends within a record."""


@dataclass(frozen=True)
class Connection:
    """Who published what: the fields of a connection record.

    Attributes:
        topic, type_name, md5sum, definition: of the topic; type_name as ROS 1 writes it, e.g. "std_msgs/String".
        caller: name of the publishing node, may be empty.
        latching: whether late subscribers receive the last message again.
    """

    topic: str
    type_name: str
    md5sum: str
    definition: str
    caller: str
    latching: bool


class BagScan:
    """One pass over the file; `messages` does it, the attributes are filled afterwards.

    Attributes:
        connections: by their number.
        chunks: whole chunks read.
        open_chunk: bytes of a last chunk that was not closed; None: there is none.
        truncated: the file ends within a record, outside of an open chunk.
        unreadable: offsets of chunks that do not decompress or hold rubbish [B].
        indexed: the index at the end, which readers need, is there.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: dict[int, Connection] = {}
        self.chunks = 0
        self.open_chunk: int | None = None
        self.truncated = False
        self.unreadable: list[int] = []
        self.indexed = False
        self._index_position = 0
        self._after_index = 0
        self._expected = (0, 0)

    @property
    def whole(self) -> bool:
        """Whether any reader opens this bag and finds all of it."""
        return self.indexed and self.open_chunk is None and not self.truncated and not self.unreadable

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """(number of the connection, time of recording [ns], serialised message) in the order of the file.

        Raises:
            NotABagError: the file is empty or something else.
        """
        with self.path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            if file.read(len(MAGIC)) != MAGIC:
                raise NotABagError(f"{self.path} is no bag of version 2.0 ({size} bytes)")
            while (offset := file.tell()) < size:
                try:
                    fields, length = _head(file)
                except _TruncatedError:
                    self.truncated = True
                    break
                yield from self._record(file, fields, length, offset, size)
        self.indexed = 0 < self._index_position <= size and self._after_index == sum(self._expected)

    def _record(
        self, file: BinaryIO, fields: Fields, length: int, offset: int, size: int
    ) -> Iterator[tuple[int, int, bytes]]:
        kind = fields[b"op"][0]
        left = size - file.tell()
        if kind == CHUNK:
            # The recorder fills the length in when it closes a chunk.
            whole = 0 < length <= left
            if not whole:
                self.open_chunk = left
            yield from self._chunk(
                file.read(length if whole else left), fields.get(b"compression", b"none"), offset, whole
            )
            self.chunks += whole
            return
        if length > left:
            self.truncated = True
            file.seek(0, os.SEEK_END)
            return
        if kind == BAG_HEADER:
            self._index_position = struct.unpack("<Q", fields[b"index_pos"])[0]
            self._expected = tuple(_LENGTH.unpack(fields[name])[0] for name in (b"conn_count", b"chunk_count"))
        elif self._index_position and offset >= self._index_position:
            self._after_index += 1
        if kind == CONNECTION:
            self._connection(fields, file.read(length))
        else:
            file.seek(length, os.SEEK_CUR)

    def _chunk(self, packed: bytes, compression: bytes, offset: int, whole: bool) -> Iterator[tuple[int, int, bytes]]:
        data, complete = _unpack(packed, compression)
        position = 0
        try:
            while position < len(data):
                fields, start, length = _inner(data, position)
                position = start + length
                if fields[b"op"][0] == CONNECTION:
                    self._connection(fields, data[start:position])
                elif fields[b"op"][0] == MESSAGE:
                    seconds, nanoseconds = _TIME.unpack(fields[b"time"])
                    yield (
                        _LENGTH.unpack(fields[b"conn"])[0],
                        seconds * 1_000_000_000 + nanoseconds,
                        data[start:position],
                    )
        except (_TruncatedError, KeyError, struct.error):
            complete = False
        if whole and not complete:
            self.unreadable.append(offset)

    def _connection(self, fields: Fields, data: bytes) -> None:
        # The topic is in the record's header: the one in the data is that before remapping.
        inner = _fields(data)
        text = {key: value.decode("utf-8", "replace") for key, value in inner.items()}
        number = _LENGTH.unpack(fields[b"conn"])[0]
        self.connections[number] = Connection(
            fields[b"topic"].decode(),
            text.get(b"type", ""),
            text.get(b"md5sum", ""),
            text.get(b"message_definition", ""),
            text.get(b"callerid", ""),
            text.get(b"latching", "0") == "1",
        )


def _head(file: BinaryIO) -> tuple[Fields, int]:
    """Header of the next record and the length of its data [B]."""
    length = _read_length(file)
    if length > _LARGEST_HEADER:
        raise _TruncatedError
    fields = _checked(_read(file, length))
    return fields, _read_length(file)


def _inner(data: bytes, position: int) -> tuple[Fields, int, int]:
    """Header of the record at `position` of a chunk, where its data starts, and their length."""
    try:
        length = _LENGTH.unpack_from(data, position)[0]
        start = position + 4 + length + 4
        size = _LENGTH.unpack_from(data, start - 4)[0]
    except struct.error as error:
        raise _TruncatedError from error
    if start + size > len(data):
        raise _TruncatedError
    return _checked(data[position + 4 : start - 4]), start, size


def _checked(header: bytes) -> Fields:
    fields = _fields(header)
    if len(fields.get(b"op", b"")) != 1:
        raise _TruncatedError
    return fields


def _fields(header: bytes) -> Fields:
    """The name=value pairs of a header."""
    fields: Fields = {}
    position = 0
    while position + 4 <= len(header):
        length = _LENGTH.unpack_from(header, position)[0]
        name, _, value = header[position + 4 : position + 4 + length].partition(b"=")
        fields[name] = value
        position += 4 + length
    return fields


def _read(file: BinaryIO, length: int) -> bytes:
    data = file.read(length)
    if len(data) < length:
        raise _TruncatedError
    return data


def _read_length(file: BinaryIO) -> int:
    return int(_LENGTH.unpack(_read(file, 4))[0])


def _unpack(packed: bytes, compression: bytes) -> tuple[bytes, bool]:
    """What can be decompressed, and whether that is all."""
    if compression == b"none":
        return packed, True
    expander = lz4.frame.LZ4FrameDecompressor() if compression == b"lz4" else bz2.BZ2Decompressor()
    try:
        data = expander.decompress(packed) if packed else b""
    except (RuntimeError, OSError, ValueError, EOFError):
        return b"", False
    return data, bool(expander.eof)
