"""Reads a datagram front to back; every count and length is checked against the bytes that are left before it is
used."""

import struct
from collections.abc import Callable
from typing import Any, TypeVar

from hric_control.errors import HricError
from hric_control.geometry import Vector

T = TypeVar("T")

INT = struct.Struct("<i")
COUNT_AND_SIZE = struct.Struct("<ii")
VECTOR = struct.Struct("<3f")


class Reader:
    """A cursor in a datagram.

    Args:
        data: the bytes.
        offset: where to begin.
        end: where to stop; what lies behind is not looked at.

    Attributes:
        skipped: bytes that were passed over by a size.
    """

    __slots__ = ("data", "end", "offset", "skipped")

    def __init__(self, data: bytes, offset: int, end: int) -> None:
        self.data, self.offset, self.end, self.skipped = data, offset, end, 0

    @property
    def left(self) -> int:
        """Bytes up to the end."""
        return self.end - self.offset

    def unpack(self, layout: struct.Struct) -> tuple[Any, ...]:
        """Fields of a fixed layout."""
        begin = self.offset
        stop = begin + layout.size
        if stop > self.end:
            raise CodecError("short", f"{layout.size} bytes expected at {begin}, {self.end - begin} are left")
        self.offset = stop
        return layout.unpack_from(self.data, begin)

    def integer(self) -> int:
        """An int32."""
        value: int = self.unpack(INT)[0]
        return value

    def count(self, size: int) -> int:
        """A count of elements that take at least `size` bytes each."""
        number = self.integer()
        if number < 0 or number * size > self.end - self.offset:
            raise CodecError(
                "count", f"{number} elements of {size} bytes or more at {self.offset}, {self.left} bytes are left"
            )
        return number

    def name(self) -> str:
        """Text up to and including its NUL."""
        stop = self.data.find(b"\0", self.offset, self.end)
        if stop < 0:
            raise CodecError("name", f"no end of the name at {self.offset}")
        begin, self.offset = self.offset, stop + 1
        try:
            return self.data[begin:stop].decode()
        except UnicodeDecodeError as error:
            raise CodecError("name", f"the name at {begin} is not UTF-8") from error

    def array(self, layout: struct.Struct, number: int) -> list[tuple[Any, ...]]:
        """`number` elements of one layout; the count was checked."""
        begin = self.offset
        self.offset = begin + number * layout.size
        if self.offset > self.end:
            raise CodecError(
                "short",
                f"{number} elements of {layout.size} bytes expected at {begin}, {self.end - begin} bytes are left",
            )
        return list(layout.iter_unpack(self.data[begin : self.offset]))

    def vectors(self) -> tuple[Vector, ...]:
        """A count and as many positions."""
        number = self.count(VECTOR.size)
        return tuple(self.array(VECTOR, number)) if number else ()

    def names(self, number: int) -> tuple[str, ...]:
        """As many names."""
        return tuple(self.name() for _ in range(number))

    def begin_sized(self, size: int) -> int:
        """Read no further than `size` bytes from here. What is returned is for `end_sized`."""
        stop, end = self.offset + size, self.end
        if size < 0 or stop > end:
            raise CodecError("size", f"{size} bytes said at {self.offset}, {end - self.offset} are left")
        self.end = stop
        return end

    def end_sized(self, end: int) -> None:
        """Go behind those bytes, whatever of them was understood."""
        self.skipped += self.end - self.offset
        self.offset, self.end = self.end, end

    def sized(self, size: int, read: "Callable[[Reader], T]") -> T:
        """Read what the next `size` bytes hold."""
        end = self.begin_sized(size)
        value = read(self)
        self.end_sized(end)
        return value


REASONS = ("short", "length", "count", "size", "name", "end tag", "version", "unknown message", "unknown type")
"""Why a datagram is refused: shorter than its layout, another length than its header says, a count or a section size
that the bytes left cannot hold, a name that does not end or is not UTF-8, no end tag where the frame ends, a bitstream
that this codec does not know, a message id that does not exist or does not belong here, a description of a type that
cannot be skipped."""


class CodecError(HricError):
    """A datagram that cannot be read; nothing of it is used.

    Args:
        reason: one of REASONS, to count by.
        text: what was found where.
    """

    def __init__(self, reason: str, text: str) -> None:
        assert reason in REASONS
        self.reason = reason
        super().__init__(f"NatNet datagram refused ({reason}): {text}")
