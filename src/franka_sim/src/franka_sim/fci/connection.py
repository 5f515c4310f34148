"""Non-blocking TCP connection of a service: complete messages in, responses out."""

import socket
from collections.abc import Callable
from dataclasses import dataclass

from franka_sim.fci.wire import Framing

RECEIVE = 4096
"""Bytes read from a connection at a time, so that no client delays the others or the robot."""
MAX_UNSENT = 1 << 20
"""Maximum number of unread response bytes of a client before it is disconnected.

Project default, unconfirmed: thirty times the largest response.
"""
KEEP_ALIVE = ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 3))
"""Keep-alive options as in libfranka: a machine that vanished is noticed after about 4 s."""


class BadMessageError(Exception):
    """Error of a client: not a message of this protocol, or unread responses.

    The connection is closed; the text gives the reason.
    """


class PeerClosedError(Exception):
    """Error of a connection that the other side has closed."""


@dataclass(frozen=True)
class FciMessage:
    """Request: id of the command, the client's sequence number, payload of the correct size."""

    command: int
    command_id: int
    payload: bytes


class FciConnection:
    """Messages over a connected socket.

    Args:
        connected: the socket; made non-blocking.
        framing: header and status.
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
            BadMessageError: an unknown command or a wrong size.
            ConnectionLostError: closed by the other side.
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
            raise BadMessageError(f"there is no command {command}")
        if size != header.size + expected:
            raise BadMessageError(f"command {command} has {size} bytes; expected {header.size + expected}")
        if len(self._in) < size:
            return None
        payload = bytes(self._in[header.size : size])
        del self._in[:size]
        return FciMessage(command, command_id, payload)

    def respond(self, command: int, command_id: int, status: int, tail: bytes = b"") -> None:
        """Queue and send a response; unsent bytes wait for `flush`.

        Raises:
            BadMessageError: the client leaves too much unread.
            ConnectionLostError: the client has closed the connection.
        """
        self._out += self._framing.frame(command, command_id, self._framing.status.pack(status) + tail)
        if len(self._out) > MAX_UNSENT:
            raise BadMessageError(f"{len(self._out)} bytes of responses are unread")
        self.flush()

    def flush(self) -> None:
        """Send the waiting bytes. Raises ConnectionLostError."""
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
