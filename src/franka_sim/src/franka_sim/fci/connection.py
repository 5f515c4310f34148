"""One TCP connection of a service: whole messages in, responses out, never waiting."""

import socket
from collections.abc import Callable
from dataclasses import dataclass

from franka_sim.fci.wire import Framing

RECEIVE = 4096
"""Bytes taken from a connection at a time, so that no client keeps the others and the robot waiting."""
MAX_UNSENT = 1 << 20
"""Bytes of responses that a client may leave unread before it is let go: project default, unconfirmed, thirty times the
largest response."""
KEEP_ALIVE = ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 3))
"""As libfranka sets them on its side: a machine that vanished is noticed after about 4 s."""


class BadMessageError(Exception):
    """What came is no message of this protocol, or the client does not read; the connection is closed, the text says
    why."""


class ConnectionLostError(Exception):
    """The other side has gone."""


@dataclass(frozen=True)
class Message:
    """A request: id of the command, the client's number of it, payload of the right size."""

    command: int
    command_id: int
    payload: bytes


class Connection:
    """Messages over a connected socket.

    Args:
        connected: the socket; made non-blocking.
        framing: header and status.
        size_of: payload size of a command [bytes], None for a command that does not exist.
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
        """Whether responses wait for the socket to take them."""
        return bool(self._out)

    def receive(self) -> list[Message]:
        """The whole messages among what has come.

        Raises:
            BadMessageError: an unknown command or a wrong size.
            ConnectionLostError: closed by the other side.
        """
        try:
            received = self.socket.recv(RECEIVE)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            raise ConnectionLostError(str(error)) from None
        if not received:
            raise ConnectionLostError("closed by the client")
        self._in += received
        messages = []
        while (message := self._next()) is not None:
            messages.append(message)
        return messages

    def _next(self) -> Message | None:
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
        return Message(command, command_id, payload)

    def respond(self, command: int, command_id: int, status: int, tail: bytes = b"") -> None:
        """Queue and send a response; what the socket does not take stays for `flush`.

        Raises:
            BadMessageError: the client leaves too much unread.
            ConnectionLostError: it has gone.
        """
        self._out += self._framing.frame(command, command_id, self._framing.status.pack(status) + tail)
        if len(self._out) > MAX_UNSENT:
            raise BadMessageError(f"{len(self._out)} bytes of responses are unread")
        self.flush()

    def flush(self) -> None:
        """Send what waits. Raises ConnectionLostError."""
        try:
            while self._out:
                del self._out[: self.socket.send(self._out)]
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            raise ConnectionLostError(str(error)) from None

    def close(self) -> None:
        """End the connection; what the client still sends is refused by the system."""
        self.socket.close()
