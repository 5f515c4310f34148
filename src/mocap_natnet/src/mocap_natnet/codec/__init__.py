"""NatNet protocol: conversion of bytes to values and back, without sockets. Fields are little endian and packed.

`Codec` reads and writes one bitstream (version of the protocol). Any datagram that cannot be read raises `CodecError`,
which gives the reason, whatever its bytes are.
"""

from mocap_natnet.codec.descriptions import ForcePlateDescription, ServerModel
from mocap_natnet.codec.frame import FrameDecoder, FrameEncoder
from mocap_natnet.codec.layout import FIRST, LAST, Version, layout, parse, text
from mocap_natnet.codec.model import decode_model, encode_model
from mocap_natnet.codec.packets import COMMAND_PORT, DATA_PORT, HEADER, NatNetMessage, packet
from mocap_natnet.codec.reader import REASONS, CodecError
from mocap_natnet.codec.types import Frame

__all__ = [
    "COMMAND_PORT",
    "DATA_PORT",
    "FIRST",
    "LAST",
    "REASONS",
    "Codec",
    "CodecError",
    "ForcePlateDescription",
    "ServerModel",
    "Version",
    "parse",
    "text",
]


class Codec:
    """Encoder and decoder of frames and descriptions in one bitstream, as whole datagrams.

    Args:
        version: version of the bitstream.

    Raises:
        CodecError: the bitstream is not known.
    """

    def __init__(self, version: Version) -> None:
        self.layout = layout(version)
        self._decoder, self._encoder = FrameDecoder(self.layout), FrameEncoder(self.layout)

    def decode_frame(self, datagram: bytes, end: int | None = None) -> Frame:
        """Return the frame of a FRAMEOFDATA datagram with a checked header (`packets.split`). Raises CodecError."""
        return self._decoder.decode(datagram, HEADER.size, end)

    def encode_frame(self, frame: Frame) -> bytes:
        """Return a frame as a FRAMEOFDATA datagram. Raises CodecError if it is too long."""
        return packet(NatNetMessage.FRAMEOFDATA, self._encoder.encode(frame))

    def decode_model(self, datagram: bytes, end: int | None = None) -> ServerModel:
        """Return the description of the server's assets in a MODELDEF datagram. Raises CodecError."""
        return decode_model(self.layout, datagram, HEADER.size, end)

    def encode_model(self, model: ServerModel) -> bytes:
        """Return a description as a MODELDEF datagram. Raises CodecError if it is too long."""
        return packet(NatNetMessage.MODELDEF, encode_model(self.layout, model))
