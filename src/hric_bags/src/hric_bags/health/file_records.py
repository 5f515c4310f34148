"""Search for the records of a bag, or of one of its chunks, one after the other and across damaged bytes.

A record ends where its stated length says; if no other record follows there, the next one is found by its structure.
Format: ROS bag, version 2.0.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO, Protocol

LENGTH = struct.Struct("<I")
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
"""Kinds of records in a bag; INDEX locates messages of one connection in a chunk, CHUNK_INFO locates a chunk."""
_REQUIRED: dict[int, dict[bytes, int]] = {
    MESSAGE: {b"conn": 4, b"time": 8},
    BAG_HEADER: {b"index_pos": 8, b"conn_count": 4, b"chunk_count": 4},
    INDEX: {b"ver": 4, b"conn": 4, b"count": 4},
    CHUNK: {b"compression": 0, b"size": 4},
    CHUNK_INFO: {b"ver": 4, b"chunk_pos": 8, b"start_time": 8, b"end_time": 8, b"count": 4},
    CONNECTION: {b"conn": 4, b"topic": 0},
}
"""Kind of record -> its required fields and their sizes [B]; 0: any size."""
_ENTRY = {INDEX: 12, CHUNK_INFO: 8}
"""Kind of record with counted entries -> size of one entry [B]."""
_LARGEST_HEADER = 1 << 20
"""Largest header of a record that is accepted [B]; real headers have some hundred bytes."""
_LOOK_BACK = 512
"""Longest distance from the field `op` back to the begin of its header [B]; project default, beyond any topic name."""
_BLOCK = 1 << 20
"""Number of bytes read at a time while the next record is searched for."""
Fields = dict[bytes, bytes]


class View(Protocol):
    """Bytes that can be read by slices: a chunk in memory, or a file."""

    def __len__(self) -> int:
        """Return the number of bytes."""

    def __getitem__(self, part: slice, /) -> bytes:
        """Return the bytes of a slice; fewer if it exceeds the end."""


class FileView:
    """Bytes of an open file of a known size."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._size = file, size

    def __len__(self) -> int:
        """Return the size of the file [B]."""
        return self._size

    def __getitem__(self, part: slice) -> bytes:
        """Return the bytes of a slice; fewer if it exceeds the end."""
        start, stop, _ = part.indices(self._size)
        self._file.seek(start)
        return self._file.read(max(stop - start, 0))


@dataclass(slots=True)
class Record:
    """Record of a bag, or bytes that are not a record.

    Attributes:
        kind: kind of the record; 0: not a record.
        fields: fields of the record's header.
        offset, start, end: offsets of the record, of its data, and of the byte after it [B].
        certain: True if the end is certain, because another record or nothing follows it.
        exact: True if the end is where the stated length says.
        open: True for a chunk that was not closed: its length is missing, or exceeds the file.
    """

    kind: int
    fields: Fields
    offset: int
    start: int
    end: int
    certain: bool = True
    exact: bool = True
    open: bool = False


def walk(view: View, begin: int, kinds: tuple[int, ...]) -> Iterator[Record]:
    """Yield the records from an offset to the end, and the bytes between them that are not records.

    If no record follows at the stated end of a chunk, it ends at the next record found; other records end there or at
    their stated end, whichever comes first.

    Args:
        view: bytes of the file or of a chunk.
        begin: offset of the first record [B].
        kinds: kinds of records that may occur.
    """
    size, record = len(view), _record(view, begin, kinds)
    while begin < size:
        if record is None:
            following_offset = _search(view, begin + 1, kinds)
            yield Record(0, {}, begin, begin, following_offset)
            begin, record = following_offset, _record(view, following_offset, kinds)
            continue
        following = _record(view, record.end, kinds) if record.end < size else None
        if (record.kind == CHUNK and record.end == record.start) or (record.end != size and following is None):
            _find_end(view, record, kinds)
            following = _record(view, record.end, kinds)
        yield record
        begin, record = record.end, following


def _find_end(view: View, record: Record, kinds: tuple[int, ...]) -> None:
    """Set the end of a record that is not followed by another record at its stated end."""
    chunk, stated = record.kind == CHUNK, record.end
    following_offset = _search(view, record.start, tuple(kind for kind in kinds if not chunk or kind != CONNECTION))
    padded = record.start < stated <= following_offset and not any(view[stated:following_offset])
    record.end = following_offset if chunk and not padded else min(stated, following_offset)
    record.certain = (chunk and padded) or stated > following_offset < len(view)
    record.exact = record.end == stated
    record.open = chunk and following_offset == len(view) and not record.start < stated <= following_offset


def _search(view: View, start: int, kinds: tuple[int, ...]) -> int:
    """Return the offset of the next record that is followed by another one or the end; else the size of the view."""
    pattern = re.compile(b"\x04\x00\x00\x00op=[" + re.escape(bytes(kinds)) + b"]")
    for block in range(start, len(view), _BLOCK):
        for match in pattern.finditer(view[block : block + _BLOCK + 8]):
            field = block + match.start()
            first = max(field - _LOOK_BACK, start)
            near = view[first : field + 8]
            for offset in range(field - 4, first - 1, -1):
                length = LENGTH.unpack_from(near, offset - first)[0]
                if field + 4 - offset <= length <= _LARGEST_HEADER:
                    record = _record(view, offset, kinds)
                    if record is not None and _is_followed(view, record.end, kinds):
                        return offset
    return len(view)


def _is_followed(view: View, end: int, kinds: tuple[int, ...]) -> bool:
    return end == len(view) or view[end : end + 4] == bytes(4) or _record(view, end, kinds) is not None


def _record(view: View, offset: int, kinds: tuple[int, ...]) -> Record | None:
    """Return the record at an offset, whose data may exceed the view; None: there is no record."""
    head = view[offset : offset + 4]
    length = LENGTH.unpack(head)[0] if len(head) == 4 else 0
    if not 0 < length <= _LARGEST_HEADER:
        return None
    header = view[offset + 4 : offset + 8 + length]
    fields = fields_of(header[:length])
    if len(header) < length + 4 or fields is None or len(fields.get(b"op", b"")) != 1:
        return None
    kind, size = fields[b"op"][0], LENGTH.unpack_from(header, length)[0]
    if kind not in kinds:
        return None
    for name, expected in _REQUIRED[kind].items():
        if len(fields.get(name, b"")) != (expected or len(fields.get(name, b"?"))):
            return None
    if kind in _ENTRY and (
        LENGTH.unpack(fields[b"ver"])[0] != 1 or size != _ENTRY[kind] * LENGTH.unpack(fields[b"count"])[0]
    ):
        return None
    start = offset + 8 + length
    return Record(kind, fields, offset, start, start + size)


def fields_of(header: bytes) -> Fields | None:
    """Return the name=value pairs of a record's header; None: the bytes are not a header."""
    fields: Fields = {}
    position, end = 0, len(header)
    while position + 4 <= end:
        start = position + 4
        position = start + LENGTH.unpack_from(header, position)[0]
        name, equals, value = header[start:position].partition(b"=")
        if not equals or position > end:
            return None
        fields[name] = value
    return fields if position == end else None
