"""rosbags' writer of a bag with small compressed chunks, of which damage costs one, that ROS's own tools read, too."""

from functools import partial
from pathlib import Path
from struct import Struct

import lz4.frame
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer
from rosbags.rosbag1.reader import RecordType

CHUNK_SIZE = 64 * 1024
"""Chunks are closed before they are larger, before compression, but for one of a single message [B]; project default,
unconfirmed."""
CHUNK_TIME = 1_000_000_000
"""And before the times of their messages are further apart [ns]; project default, unconfirmed."""
_HEAD = Struct("<II3sBI5sII5sIII")
"""Record of a message in front of its data: length of the header; size, name and value of `op`, `conn` and `time` (two
numbers); length of the data."""
_NAMES = (_HEAD.size - 8, 4, b"op=", RecordType.MSGDATA, 9, b"conn="), (13, b"time=")
"""Values of the header that are the same for all messages."""


class ChunkedWriter(Writer):
    """Writer of a bag; path: must not exist."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.set_compression(Writer.CompressionFormat.LZ4)
        # ROS's own tools want blocks that do not refer to each other; the checksum reveals a flipped bit.
        self.compressor = partial(lz4.frame.compress, block_linked=False, content_checksum=True, store_size=False)
        self.chunk_threshold = CHUNK_SIZE

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Add a message of a connection of this bag, as the base class does, in a third of its time.

        Args:
            connection: as `add_connection` returned it.
            timestamp: time of its recording [ns].
            data: serialised message.
        """
        chunk = self.chunks[-1]
        offset = chunk.data.tell()
        if chunk.connections and (
            offset + len(data) + _HEAD.size > self.chunk_threshold or timestamp - chunk.start > CHUNK_TIME
        ):
            self.write_chunk(chunk)
            chunk, offset = self.chunks[-1], 0
        chunk.connections[connection.id].append((timestamp, offset))
        if timestamp < chunk.start:
            chunk.start = timestamp
        if timestamp > chunk.end:
            chunk.end = timestamp
        seconds, rest = divmod(timestamp, 1_000_000_000)
        chunk.data.write(_HEAD.pack(*_NAMES[0], connection.id, *_NAMES[1], seconds, rest, len(data)))
        chunk.data.write(data)
