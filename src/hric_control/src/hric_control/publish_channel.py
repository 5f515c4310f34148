"""What the control process and its publishing process share: two pipes, and a page of counters that both see without a system call.

Frames on the pipes are pickled and preceded by their length (4 bytes, little endian). Both ends are of one program, started by the other: nothing of
this comes from outside.
"""

from __future__ import annotations

import mmap
import os
import pickle
import struct
from typing import Any

_LENGTH = struct.Struct("<I")
_CONSUMED = struct.Struct("<Q")
_COUNT = struct.Struct("<I")
MAX_TOPICS = 1000
"""Topics of one process that can tell their number of listeners."""
PAGE_SIZE = _CONSUMED.size + MAX_TOPICS * _COUNT.size


class Counters:
    """Bytes consumed by the publishing process, and the listeners of each topic; written there, read here.

    Args:
        descriptor: of a file of PAGE_SIZE bytes in memory.
    """

    def __init__(self, descriptor: int) -> None:
        self._page = mmap.mmap(descriptor, PAGE_SIZE)

    @property
    def consumed(self) -> int:
        """Bytes of the pipe that have been dealt with."""
        value: int = _CONSUMED.unpack_from(self._page, 0)[0]
        return value

    @consumed.setter
    def consumed(self, value: int) -> None:
        _CONSUMED.pack_into(self._page, 0, value)

    def listeners(self, topic: int) -> int:
        """Number of listeners of a topic as last counted."""
        value: int = _COUNT.unpack_from(self._page, _CONSUMED.size + topic * _COUNT.size)[0]
        return value

    def set_listeners(self, topic: int, count: int) -> None:
        """Tell the number of listeners of a topic."""
        _COUNT.pack_into(self._page, _CONSUMED.size + topic * _COUNT.size, count)

    def close(self) -> None:
        """Let the page go."""
        self._page.close()


def frame(content: Any) -> bytes:
    """Content as it goes over a pipe."""
    body = pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(body)) + body


def identity(message: Any) -> Any:
    """Builder of a message that was built already."""
    return message


class FrameReader:
    """Reads frames from a pipe.

    Args:
        descriptor: the reading end.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._buffer = bytearray()

    def read(self) -> list[tuple[Any, int]] | None:
        """(content, bytes of its frame) of all frames that one read completes; may be none. None at the end of the pipe."""
        data = os.read(self._descriptor, 1 << 20)
        if not data:
            return None
        buffer = self._buffer
        buffer += data
        frames, at = [], 0
        while len(buffer) - at >= _LENGTH.size:
            end = at + _LENGTH.size + _LENGTH.unpack_from(buffer, at)[0]
            if end > len(buffer):
                break
            frames.append((pickle.loads(memoryview(buffer)[at + _LENGTH.size : end]), end - at))
            at = end
        del buffer[:at]
        return frames
