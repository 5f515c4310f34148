"""Mutated and random datagrams, seeded, as a client may receive them by a fault or an attack."""

import random
import struct

from natnet_samples import Sample, one_body_frame

from mocap_natnet.codec import Codec, Version
from mocap_natnet.codec.packets import (
    HEADER,
    NatNetMessage,
    ServerInfo,
    encode_echo_response,
    encode_server_info,
    packet,
)

DATAGRAM = 300
"""Longest random datagram [bytes]."""


class Rubbish:
    """Generator that mutates datagrams of a server with one bitstream.

    Args:
        version: the bitstream.
        seed: of everything random.
    """

    def __init__(self, version: Version, seed: int) -> None:
        codec, self._random = Codec(version), random.Random(seed)
        info = ServerInfo("Motive", (3, 1, 0, 0), version, 10_000_000, 1511, True, "239.255.42.99")
        self._whole = [
            codec.encode_frame(one_body_frame()),
            codec.encode_frame(Sample(seed).frame()),
            codec.encode_model(Sample(seed + 1).model()),
            packet(NatNetMessage.SERVERINFO, encode_server_info(info)),
            packet(NatNetMessage.ECHO_RESPONSE, encode_echo_response(1, 2)),
            packet(NatNetMessage.RESPONSE, b"\1\0\0\0"),
            packet(NatNetMessage.MESSAGESTRING, b"hello\0"),
        ]

    def datagram(self, genuine: bytes) -> bytes:
        """Return a random datagram, a mutated one of any kind, or, in half of the cases, the given one mutated."""
        draw = self._random.random
        if draw() < 0.1:
            return self._random.randbytes(int(draw() * DATAGRAM))
        if draw() < 0.02:
            return HEADER.pack(int(draw() * 16), int(draw() * 65536)) + self._random.randbytes(int(draw() * DATAGRAM))
        whole = self._next(genuine) if draw() < 0.55 else self._whole[int(draw() * len(self._whole))]
        return self.spoilt(whole)

    def _next(self, genuine: bytes) -> bytes:
        if genuine[:1] != b"\7" or self._random.random() < 0.5:
            return genuine
        (number,) = struct.unpack_from("<i", genuine, HEADER.size)
        return (
            genuine[: HEADER.size]
            + struct.pack("<i", number + 1 + int(self._random.random() * 2))
            + genuine[HEADER.size + 4 :]
        )

    def spoilt(self, datagram: bytes) -> bytes:
        """Return data with one to four changes: a byte, a large number, a cut, a repeated piece."""
        changed, draw = bytearray(datagram), self._random.random
        for _ in range(1 + int(draw() * 4)):
            where, kind = int(draw() * max(1, len(changed))), int(draw() * 10)
            if kind < 7 and changed:
                changed[where] = int(draw() * 256)
            elif kind == 7:
                changed[where : where + 4] = b"\xff\xff\xff\x7f"
            elif kind == 8:
                del changed[where:]
            else:
                changed[where:where] = changed[where : where + 16]
        return bytes(changed)
