"""Sequential reader of a datagram; counts and lengths are checked against the remaining bytes before use."""

import struct
from collections.abc import Callable
from typing import Any, TypeVar

from hric_core.errors import HricError
from hric_core.geometry import Vector

T = TypeVar("T")

INT = struct.Struct("<i")
COUNT_AND_SIZE = struct.Struct("<ii")
VECTOR = struct.Struct("<3f")


class Reader:
    """Reader of a datagram from front to back.

    Args:
        data: bytes of the datagram.
        offset: start position.
        end: end position; bytes after it are ignored.

    Attributes:
        skipped: number of bytes at the ends of sized sections that were skipped.
    """

    __slots__ = ("data", "end", "offset", "skipped")

    def __init__(self, data: bytes, offset: int, end: int) -> None:
        self.data, self.offset, self.end, self.skipped = data, offset, end, 0

    @property
    def left(self) -> int:
        """Number of bytes from the current position to the end."""
        return self.end - self.offset

    def unpack(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Read the fields of a fixed layout."""
        begin = self.offset
        stop = begin + layout.size
        if stop > self.end:
            raise CodecError("short", f"{layout.size} bytes expected at byte {begin}, only {self.end - begin} are left")
        self.offset = stop
        return layout.unpack_from(self.data, begin)

    def integer(self) -> int:
        """Read an int32."""
        return int(self.unpack(INT)[0])

    def count(self, size: int) -> int:
        """Read a count of elements that take at least `size` bytes each."""
        number = self.integer()
        if number < 0 or number * size > self.end - self.offset:
            raise CodecError(
                "count", f"{number} elements of at least {size} bytes at byte {self.offset}, only {self.left} are left"
            )
        return number

    def name(self) -> str:
        """Read a text and the NUL that ends it; return the text."""
        stop = self.data.find(b"\0", self.offset, self.end)
        if stop < 0:
            raise CodecError("name", f"the name at byte {self.offset} has no terminating NUL")
        begin, self.offset = self.offset, stop + 1
        try:
            return self.data[begin:stop].decode()
        except UnicodeDecodeError as error:
            raise CodecError("name", f"the name at byte {begin} is not UTF-8") from error

    def array(self, layout: struct.Struct, number: int) -> list[tuple[Any, ...]]:
        """Read `number` elements of one layout."""
        begin = self.offset
        self.offset = begin + number * layout.size
        if self.offset > self.end:
            raise CodecError(
                "short",
                f"{number} elements of {layout.size} bytes expected at byte {begin}, only {self.end - begin} are left",
            )
        return list(layout.iter_unpack(self.data[begin : self.offset]))

    def vectors(self) -> tuple[Vector, ...]:
        """Read a count and as many positions."""
        number = self.count(VECTOR.size)
        return tuple(self.array(VECTOR, number)) if number else ()

    def names(self, number: int) -> tuple[str, ...]:
        """Read `number` texts, each ended by a NUL."""
        return tuple(self.name() for _ in range(number))

    def begin_sized(self, size: int) -> int:
        """Limit reading to the next `size` bytes; return the former end, the argument for `end_sized`."""
        stop, end = self.offset + size, self.end
        if size < 0 or stop > end:
            raise CodecError("size", f"{size} bytes stated at byte {self.offset}, only {end - self.offset} are left")
        self.end = stop
        return end

    def end_sized(self, end: int) -> None:
        """Skip the unread bytes up to the limit of `begin_sized`, and restore the former end."""
        self.skipped += self.end - self.offset
        self.offset, self.end = self.end, end

    def sized(self, size: int, read: "Callable[[Reader], T]") -> T:
        """Read the next `size` bytes by a function, skip what it leaves unread, and return its result."""
        end = self.begin_sized(size)
        value = read(self)
        self.end_sized(end)
        return value


REASONS = ("short", "length", "count", "size", "name", "end tag", "version", "unknown message", "unknown type")
"""Reasons to refuse a datagram.

They are, in this order: shorter than its layout; shorter than its header states; a count, or a section's size, beyond
the remaining bytes; a name that does not end or is not UTF-8; no end tag at the end of a frame; an unknown bitstream; a
message id that does not exist or is not a server's; a description of an unknown type that cannot be skipped.
"""


class CodecError(HricError):
    """Error of a datagram that cannot be read; no part of it is used.

    Args:
        reason: one of REASONS, by which refused datagrams are counted.
        text: description of the error, with its position.
    """

    def __init__(self, reason: str, text: str) -> None:
        assert reason in REASONS
        self.reason = reason
        super().__init__(f"NatNet datagram refused ({reason}): {text}")
