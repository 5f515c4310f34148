"""rosbags' writer of a bag with small compressed chunks, of which damage costs one, that ROS's own tools read, too."""

from functools import partial
from pathlib import Path

import lz4.frame
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer

CHUNK_SIZE = 64 * 1024
"""Chunks are closed before they are larger, before compression, but for one of a single message [B]; project default,
unconfirmed."""
CHUNK_TIME = 1_000_000_000
"""And before the times of their messages are further apart [ns]; project default, unconfirmed."""
_HEADER = 64
"""At least what a message takes in a chunk beside its data [B]."""


class ChunkedWriter(Writer):
    """Writer of a bag; path: must not exist."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.set_compression(Writer.CompressionFormat.LZ4)
        # ROS's own tools want blocks that do not refer to each other; the checksum reveals a flipped bit.
        self.compressor = partial(lz4.frame.compress, block_linked=False, content_checksum=True, store_size=False)
        self.chunk_threshold = CHUNK_SIZE

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Add a message; timestamp: time of its recording [ns]."""
        chunk = self.chunks[-1]
        full = chunk.data.tell() + len(data) + _HEADER > CHUNK_SIZE
        if chunk.connections and (full or timestamp - chunk.start > CHUNK_TIME):
            self.write_chunk(chunk)
        super().write(connection, timestamp, data)
