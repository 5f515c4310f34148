"""NatNet's message ids, header of a datagram, and small messages: connection, server information, echo."""

import socket
import struct
from enum import IntEnum
from typing import NamedTuple

from mocap_natnet.codec.layout import Version, text
from mocap_natnet.codec.reader import CodecError

COMMAND_PORT = 1510
DATA_PORT = 1511
MULTICAST_GROUP = "239.255.42.99"
MAX_PAYLOAD = 65503
"""Largest payload of one datagram [bytes]."""
HEADER = struct.Struct("<HH")
"""Header of a datagram: message id, and number of payload bytes."""
NAME_SIZE = 256
_SERVER_OLD = struct.Struct("<256s4B4B")
_SERVER_NEW = struct.Struct("<256s4B4BQHB4s")
_SENDER_SIZE = 264
_ECHO_REQUEST = struct.Struct("<Q")
_ECHO_RESPONSE = struct.Struct("<QQ")


class NatNetMessage(IntEnum):
    """Ids of NatNet's messages."""

    CONNECT = 0
    SERVERINFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODELDEF = 4
    MODELDEF = 5
    REQUEST_FRAMEOFDATA = 6
    FRAMEOFDATA = 7
    MESSAGESTRING = 8
    DISCONNECT = 9
    KEEPALIVE = 10
    DISCONNECT_BY_TIMEOUT = 11
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    DISCOVERY = 14
    UNRECOGNIZED_REQUEST = 100


_KNOWN = frozenset(int(message) for message in NatNetMessage)


def packet(message: NatNetMessage, payload: bytes = b"") -> bytes:
    """Return a message as a datagram. Raises CodecError if the payload is too long for one."""
    if len(payload) > MAX_PAYLOAD:
        raise CodecError("length", f"{len(payload)} bytes of payload; the maximum is {MAX_PAYLOAD}")
    return HEADER.pack(message, len(payload)) + payload


def split(datagram: bytes) -> tuple[int, int]:
    """Return (message id, end of the payload); the payload begins after the header.

    A datagram may be longer than its header says (vendor samples append a NUL), not shorter; the lengths of
    UNRECOGNIZED_REQUEST are meaningless.

    Raises:
        CodecError: the header is incomplete, the message unknown, or there are fewer bytes than the header states.
    """
    if len(datagram) < HEADER.size:
        raise CodecError("short", f"{len(datagram)} bytes, less than a header")
    message, size = HEADER.unpack_from(datagram)
    if message not in _KNOWN:
        raise CodecError("unknown message", f"message id {message}")
    end = HEADER.size + size
    if end > len(datagram):
        if message == NatNetMessage.UNRECOGNIZED_REQUEST:
            return message, len(datagram)
        raise CodecError("length", f"the header states {size} bytes, but {len(datagram) - HEADER.size} arrived")
    return message, end


class ServerInfo(NamedTuple):
    """Information of a server about itself.

    Attributes:
        name: name of the application.
        application: version of the application.
        version: bitstream of the server; revision and build were 0 in all observed servers.
        clock_frequency: ticks per second of the server's clock [Hz]; 0 in bitstreams below 3.0.
        data_port: UDP port of frames; 0 below 3.0.
        multicast: True if it streams to a multicast group; None below 3.0, where it is not stated.
        group: address of the group; "" below 3.0.
    """

    name: str
    application: tuple[int, int, int, int]
    version: Version
    clock_frequency: int = 0
    data_port: int = 0
    multicast: bool | None = None
    group: str = ""


def encode_server_info(info: ServerInfo, rubbish: bytes = b"") -> bytes:
    """Return the payload of SERVERINFO.

    Args:
        info: server information.
        rubbish: bytes after the name's NUL, as in real packets.
    """
    name = (info.name.encode()[: NAME_SIZE - 1] + b"\0" + rubbish)[:NAME_SIZE].ljust(NAME_SIZE, b"\0")
    head = (name, *info.application, *info.version, 0, 0)
    if info.version < (3, 0):
        return _SERVER_OLD.pack(*head)
    return _SERVER_NEW.pack(
        *head,
        info.clock_frequency,
        info.data_port,
        bool(info.multicast),
        socket.inet_aton(info.group or MULTICAST_GROUP),
    )


def decode_server_info(payload: bytes) -> ServerInfo:
    """Return the information of a SERVERINFO payload, even with an unknown bitstream. Raises CodecError."""
    if len(payload) < _SERVER_OLD.size:
        raise CodecError(
            "short", f"server information of {len(payload)} bytes; valid: {_SERVER_OLD.size} or {_SERVER_NEW.size}"
        )
    raw, *numbers = _SERVER_OLD.unpack_from(payload)
    name = raw.split(b"\0", 1)[0].decode(errors="replace")
    application, version = (numbers[0], numbers[1], numbers[2], numbers[3]), (numbers[4], numbers[5])
    if version < (3, 0):
        return ServerInfo(name, application, version)
    if len(payload) < _SERVER_NEW.size:
        raise CodecError(
            "short",
            f"server information of {len(payload)} bytes for bitstream {text(version)}; valid: {_SERVER_NEW.size}",
        )
    frequency, port, multicast, group = _SERVER_NEW.unpack_from(payload)[-4:]
    return ServerInfo(name, application, version, frequency, port, multicast != 0, socket.inet_ntoa(group))


class Connect(NamedTuple):
    """Connection request of a client.

    Attributes:
        name: name of the application, "" if unknown.
        version: requested bitstream; None: the server's newest.
        subscribed_only: True if the client receives only subscribed data.
    """

    name: str = ""
    version: Version | None = None
    subscribed_only: bool = False


def encode_connect(connect: Connect) -> bytes:
    """Return the longest form of the payload of CONNECT: sender and options."""
    name = connect.name.encode()[: NAME_SIZE - 1].ljust(NAME_SIZE, b"\0")
    return name + bytes(8) + bytes([connect.subscribed_only, *(connect.version or (0, 0)), 0, 0])


def decode_connect(payload: bytes) -> Connect:
    """Return the request of any form of CONNECT: empty, "Ping", a sender, a sender with options and extensions."""
    if len(payload) < _SENDER_SIZE:
        return Connect()
    name = payload[:NAME_SIZE].split(b"\0", 1)[0].decode(errors="replace")
    options = payload[_SENDER_SIZE:]
    if len(options) < 5:
        return Connect(name)
    version = (options[1], options[2])
    return Connect(name, version if any(version) else None, options[0] != 0)


def encode_echo_request(stamp: int) -> bytes:
    """Return the payload of ECHO_REQUEST: a stamp of the client's clock in any unit."""
    return _ECHO_REQUEST.pack(stamp)


def decode_echo_request(payload: bytes) -> int:
    """Return the client's stamp in the payload of ECHO_REQUEST. Raises CodecError."""
    if len(payload) < _ECHO_REQUEST.size:
        raise CodecError("short", f"echo request of {len(payload)} bytes")
    return int(_ECHO_REQUEST.unpack_from(payload)[0])


def encode_echo_response(stamp: int, ticks: int) -> bytes:
    """Return the payload of ECHO_RESPONSE: the client's stamp, and the server's ticks when the request arrived."""
    return _ECHO_RESPONSE.pack(stamp, ticks)


def decode_echo_response(payload: bytes) -> tuple[int, int]:
    """Return (client's stamp, server's ticks) in the payload of ECHO_RESPONSE. Raises CodecError."""
    if len(payload) < _ECHO_RESPONSE.size:
        raise CodecError("short", f"echo response of {len(payload)} bytes")
    stamp, ticks = _ECHO_RESPONSE.unpack_from(payload)
    return stamp, ticks
