"""Decompression of a bag's chunk, as far as it is readable."""

import bz2
from dataclasses import dataclass

import lz4.block
import lz4.frame

from hric_bags.health.file_records import LENGTH

LARGEST_CHUNK = 1 << 30
"""Largest chunk that is decompressed [B]; project default, unconfirmed."""
_LZ4, _BZ2 = b"\x04\x22\x4d\x18", b"BZh"
"""First bytes of data in each compression format."""
_LARGEST_BLOCK = 4 << 20
"""Largest block of the LZ4 frame format [B]."""
_WINDOW = 1 << 16
"""Distance over which a block of an LZ4 frame may refer to the blocks before it [B]."""
_ENDS = (RuntimeError, OSError, ValueError, EOFError)
"""Errors that the decompression libraries raise for damaged data."""


@dataclass(frozen=True)
class Unpacked:
    """Decompressed data of a chunk.

    Attributes:
        data: readable bytes.
        compression: "none", "lz4" or "bz2", by the first bytes of the data.
        complete: True if the data are complete and no checksum is wrong.
        verified: True if a checksum confirms the data.
    """

    data: bytes
    compression: str
    complete: bool = True
    verified: bool = False


def unpack(packed: bytes, stated: str) -> Unpacked:
    """Decompress a chunk; stated: compression in its header, used if the first bytes do not show it."""
    if packed.startswith(_LZ4) or (stated == "lz4" and not packed.startswith(_BZ2)):
        data, complete = _expand(lz4.frame.LZ4FrameDecompressor(), packed)
        if complete:
            return Unpacked(data, "lz4", True, bool(packed[4] & 0x04))
        return Unpacked(max(data, _blocks(packed), key=len), "lz4", False)
    if packed.startswith(_BZ2) or stated == "bz2":
        data, complete = _expand(bz2.BZ2Decompressor(), packed)
        return Unpacked(data, "bz2", complete, complete)
    return Unpacked(packed, "none")


def _expand(expander: lz4.frame.LZ4FrameDecompressor | bz2.BZ2Decompressor, packed: bytes) -> tuple[bytes, bool]:
    try:
        data = expander.decompress(packed, LARGEST_CHUNK) if packed else b""
    except _ENDS:
        return b"", False
    return data, bool(expander.eof)


def _blocks(packed: bytes) -> bytes:
    """Decompress an LZ4 frame block by block up to the first unreadable block, ignoring checksums."""
    flags = packed[4] if len(packed) > 4 else 0
    position, data = 7 + 8 * bool(flags & 0x08) + 4 * bool(flags & 0x01), bytearray()
    while len(head := packed[position : position + 4]) == 4 and (size := LENGTH.unpack(head)[0]):
        block = packed[position + 4 : position + 4 + (size & 0x7FFFFFFF)]
        position += 4 + (size & 0x7FFFFFFF) + 4 * bool(flags & 0x10)
        try:
            data += block if size >> 31 else lz4.block.decompress(block, _LARGEST_BLOCK, dict=bytes(data[-_WINDOW:]))
        except lz4.block.LZ4BlockError:
            break
    return bytes(data)
