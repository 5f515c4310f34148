"""Non-blocking TCP connection of a network service: receives complete requests and sends responses."""

import socket
from collections.abc import Callable
from dataclasses import dataclass

from franka_sim.fci.wire import Framing

RECEIVE = 4096
"""Bytes read from a connection at a time, so that no client delays the others or the robot."""
MAX_UNSENT = 1 << 20
"""Maximum number of response bytes that a client leaves unread before it is disconnected.

Project default, unconfirmed: thirty times the largest response.
"""
KEEP_ALIVE = ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 3))
"""Keep-alive options as in libfranka: a machine that vanished is noticed after about 4 s."""


class BadMessageError(Exception):
    """Error of a client: data that is no message of this protocol, or too many unread responses.

    The connection is closed; the text gives the reason.
    """


class PeerClosedError(Exception):
    """Error of a connection that the other side has closed."""


@dataclass(frozen=True)
class FciMessage:
    """Request of a client: id of the command, the client's sequence number, and the payload."""

    command: int
    command_id: int
    payload: bytes


class FciConnection:
    """Connection of one client: requests and responses over a connected TCP socket.

    Args:
        connected: the socket; made non-blocking.
        framing: layout of header and status.
        size_of: function that returns the payload size of a command [bytes], None if it does not exist.
    """

    def __init__(self, connected: socket.socket, framing: Framing, size_of: Callable[[int], int | None]) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEP_ALIVE:
            connected.setsockopt(socket.IPPROTO_TCP, option, value)
        self.socket, self._framing, self._size_of = connected, framing, size_of
        self._in, self._out = bytearray(), bytearray()

    @property
    def unsent(self) -> bool:
        """True if responses wait to be sent."""
        return bool(self._out)

    def receive(self) -> list[FciMessage]:
        """Return the complete messages that have been received.

        Raises:
            BadMessageError: a request has an unknown id or a wrong size.
            PeerClosedError: the client has closed the connection.
        """
        try:
            received = self.socket.recv(RECEIVE)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            raise PeerClosedError(str(error)) from None
        if not received:
            raise PeerClosedError("closed by the client")
        self._in += received
        messages = []
        while (message := self._next()) is not None:
            messages.append(message)
        return messages

    def _next(self) -> FciMessage | None:
        header = self._framing.header
        if len(self._in) < header.size:
            return None
        command, command_id, size = header.unpack_from(self._in)
        expected = self._size_of(command)
        if expected is None:
            raise BadMessageError(f"unknown request id {command}")
        if size != header.size + expected:
            raise BadMessageError(f"request {command} has {size} bytes; expected {header.size + expected}")
        if len(self._in) < size:
            return None
        payload = bytes(self._in[header.size : size])
        del self._in[:size]
        return FciMessage(command, command_id, payload)

    def respond(self, command: int, command_id: int, status: int, tail: bytes = b"") -> None:
        """Queue and send a response; unsent bytes wait for `flush`.

        Raises:
            BadMessageError: the client has left more than MAX_UNSENT bytes unread.
            PeerClosedError: the client has closed the connection.
        """
        self._out += self._framing.frame(command, command_id, self._framing.status.pack(status) + tail)
        if len(self._out) > MAX_UNSENT:
            raise BadMessageError(f"the client has not read {len(self._out)} bytes of responses")
        self.flush()

    def flush(self) -> None:
        """Send the bytes that wait. Raises PeerClosedError."""
        try:
            while self._out:
                del self._out[: self.socket.send(self._out)]
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            raise PeerClosedError(str(error)) from None

    def close(self) -> None:
        """Close the connection; the system rejects further data of the client."""
        self.socket.close()
