"""Emulated Delsys Trigno server. No ROS."""

import contextlib
import logging
import os
import socket
import threading
from collections.abc import Callable

from hric_core.errors import FailureError
from hric_perception.chunk import FloatArray
from hric_perception.trigno import protocol

LOG = logging.getLogger("hric.perception.trigno")
IDLE = 0.1
"""Longest time until a thread notices that it is to end [s]."""
MAX_CLIENTS = 16
"""Largest number of connections to a port; further ones are closed (project default, unconfirmed)."""
MAX_COMMAND = 4096
"""Longest command [bytes] (project default, unconfirmed)."""


class TrignoServer:
    """Emulated Trigno server, an outlet for `Emulator`: sends frames to all clients between commands START and STOP.

    It also stops when the connection that sent START is closed.

    Args:
        rate: sample rate [Hz].
        ip: address to listen on.
        command_port: TCP port of commands; 0: any free port.
        data_port: TCP port of EMG data; 0: any free port.
        time_code: True if the last column is a time code [s].

    Raises:
        HricError: a port is in use.
    """

    def __init__(
        self, rate: float, ip: str = "127.0.0.1", command_port: int = 0, data_port: int = 0, time_code: bool = False
    ) -> None:
        self._rate, self._frame, self._encoder = rate, protocol.frame_samples(rate), protocol.Encoder(rate, time_code)
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._listeners: list[socket.socket] = []
        self._clients: list[socket.socket] = []
        self._starter: socket.socket | None = None
        self._sockets: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        for port in (command_port, data_port):
            try:
                sock = socket.create_server((ip, port))
            except OSError as error:
                self.close()
                reason = os.strerror(error.errno) if error.errno else str(error)
                raise FailureError(f"cannot listen on {ip}, TCP port {port}: {reason}") from error
            sock.settimeout(IDLE)
            self._sockets.append(sock)
        self.command_port, self.data_port = (sock.getsockname()[1] for sock in self._sockets)

    def start(self) -> None:
        """Accept clients, in threads."""
        for ends in zip(self._sockets, (self._clients, self._listeners), (self._talk, None), strict=True):
            self._threads.append(threading.Thread(target=self._accept, args=ends, name="trigno server", daemon=True))
            self._threads[-1].start()

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Send EMG samples [V], shape (n, up to CHANNELS); other channels are 0. `times` is not used."""
        with self._lock:
            if self._starter is None:
                self._encoder.clear()
            elif frames := self._encoder.encode(data):
                self._send(frames)

    def close(self) -> None:
        """Stop the server."""
        self._stop.set()
        for thread in self._threads:  # a port stays in use while a thread waits for its socket
            thread.join(1.0)
        with self._lock:
            for sock in [*self._sockets, *self._listeners]:
                with contextlib.suppress(OSError):
                    sock.close()
            self._listeners.clear()

    def _send(self, data: bytes) -> None:
        for listener in self._listeners[:]:
            try:
                listener.sendall(data)
            except OSError as error:
                if isinstance(error, BlockingIOError):
                    LOG.warning("a client of port %d reads its samples too slowly; disconnected", self.data_port)
                self._listeners.remove(listener)
                listener.close()

    def _accept(
        self, listening: socket.socket, present: list[socket.socket], work: Callable[[socket.socket], None] | None
    ) -> None:
        while not self._stop.is_set():
            try:
                connection, _ = listening.accept()
            except TimeoutError:
                continue
            except OSError as error:  # e.g. too many open files
                LOG.warning("no connection accepted: %s", error.strerror or error)
                self._stop.wait(1.0)
                continue
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setblocking(False)
            if len(present) >= MAX_CLIENTS:
                LOG.warning("a connection is refused: %d clients are connected", MAX_CLIENTS)
                connection.close()
                continue
            with self._lock:
                present.append(connection)
            if work is not None:
                work(connection)

    def _talk(self, connection: socket.socket) -> None:
        threading.Thread(target=self._converse, args=(connection,), name="trigno commands", daemon=True).start()

    def _converse(self, connection: socket.socket) -> None:
        connection.settimeout(IDLE)
        received = b""
        with contextlib.suppress(OSError), connection:
            connection.sendall(protocol.GREETING)
            while not self._stop.is_set():
                try:
                    data = connection.recv(4096)
                except TimeoutError:
                    continue
                received += data
                if not data or len(received) > MAX_COMMAND:
                    break
                while protocol.END in received:
                    command, received = received.split(protocol.END, 1)
                    word = command.decode(errors="replace").strip()
                    if word in ("START", "STOP"):
                        LOG.info("received the command %s", word)
                        self._starter = connection if word == "START" else None
                    connection.sendall(self._response(word).encode() + protocol.END)
        with self._lock:
            self._clients.remove(connection)
            if self._starter is connection:
                self._starter = None

    def _response(self, word: str) -> str:
        responses = {
            **dict.fromkeys(("START", "STOP"), "OK"),
            protocol.FRAME_INTERVAL: f"{self._frame / self._rate:.9g}",
            protocol.FRAME_COUNT: str(self._frame),
            "QUIT": "BYE",
        }
        return responses.get(word) or self._sensor_response(word)

    def _sensor_response(self, word: str) -> str:
        """Return the response to a request about a sensor; each has one EMG channel and no other."""
        request = protocol.SENSOR.fullmatch(word)
        if request is None or not 1 <= int(request[1]) <= protocol.CHANNELS or request[2] not in (None, "1"):
            return "INVALID COMMAND"
        responses = {"RATE": f"{self._rate:.9g}"} if request[2] else {"PAIRED": "YES", "TYPE": protocol.AVANTI}
        return responses.get(request[3], "INVALID COMMAND")
