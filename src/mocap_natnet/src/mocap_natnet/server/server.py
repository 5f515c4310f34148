"""The emulated Motive on UDP."""

from __future__ import annotations

import contextlib
import heapq
import logging
import select
import socket
import threading
import time
from collections.abc import Callable

from hric_control.errors import HricError
from mocap_natnet.codec.types import Frame
from mocap_natnet.server.motive import Motive, Outgoing
from mocap_natnet.sockets import datagram_socket

LOG = logging.getLogger("hric.mocap_natnet")
MAX_DATAGRAM = 65536
LATE = 1.0
"""A stream that is this far behind goes on from now instead of catching up [s] (our choice)."""
IDLE = 0.1
"""Longest sleep, after which a request to stop is noticed [s]."""


class MotiveServer:
    """Streams in real time. Use as a context, or `start()` and `close()`, or `run()` in the calling thread.

    Args:
        motive: what it says.
        clock: time that paces the stream [s]; the stream's time begins at 0 when the server starts.

    Attributes:
        sent: frames that were sent, whether anybody wanted them or not.

    Raises:
        HricError: the address or the port cannot be taken.
    """

    def __init__(self, motive: Motive, clock: Callable[[], float] = time.monotonic) -> None:
        self.motive, self.sent = motive, 0
        self._clock, self._stop = clock, threading.Event()
        self._thread: threading.Thread | None = None
        settings = motive.settings
        self._command = datagram_socket()
        # The port of the data socket is any that is free: bound to the data port it would take this machine's unicast frames away from the clients.
        self._data = datagram_socket()
        try:
            self._command.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            self._command.bind((settings.ip, settings.command_port))
            self._data.bind((settings.ip, 0))
            interface = "0.0.0.0" if settings.ip == "0.0.0.0" else settings.ip
            self._data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(interface))
            self._data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 2)
        except OSError as error:
            self._close_sockets()
            raise HricError(f"cannot listen on {settings.ip}, UDP port {settings.command_port}: {error.strerror or error}") from error
        self._began = self._clock()

    @property
    def command_port(self) -> int:
        """Where requests arrive."""
        port: int = self._command.getsockname()[1]
        return port

    @property
    def time(self) -> float:
        """Of the stream [s]."""
        return self._clock() - self._began

    def start(self) -> None:
        """Run in a thread."""
        self._thread = threading.Thread(target=self.run, name="emulated motive", daemon=True)
        self._thread.start()

    def __enter__(self) -> MotiveServer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def stop(self) -> None:
        """End `run()` soon; may be called in a signal handler."""
        self._stop.set()

    def close(self) -> None:
        """End and release the ports."""
        self.stop()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._close_sockets()

    def run(self) -> None:
        """Stream until `stop()`."""
        self._began = self._clock()
        number, pending = 0, _Pending()
        period = self.motive.settings.period
        while not self._stop.is_set():
            now = self.time
            if now - number * period > LATE:
                LOG.warning("the stream is %.1f s late; it goes on from now", now - number * period)
                number = int(now / period)
            while number * period <= now:
                pending.expose(self.motive, number)
                number += 1
            while (due := pending.pop(now)) is not None:
                self._send(self._data, self.motive.stream(due, now))
                self.sent += 1
            wait = min(IDLE, number * period - self.time, pending.next - self.time)
            self._answer(max(0.0, wait))

    def _answer(self, wait: float) -> None:
        """Answer what comes within `wait` [s]."""
        ready, _, _ = select.select([self._command], [], [], wait)
        while ready:
            try:
                datagram, sender = self._command.recvfrom(MAX_DATAGRAM, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:  # a client that is gone answers with a port that nobody listens on
                continue
            self._send(self._command, self.motive.answer(datagram, sender, self.time))

    def _send(self, out: socket.socket, datagrams: Outgoing) -> None:
        for datagram, address in datagrams:
            with contextlib.suppress(OSError):  # a network that is down or full loses datagrams, as networks do
                out.sendto(datagram, address)

    def _close_sockets(self) -> None:
        self._command.close()
        self._data.close()


class _Pending:
    """Frames on their way from the cameras to the network."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Frame]] = []

    @property
    def next(self) -> float:
        """When the next one is due [s]."""
        return self._heap[0][0] if self._heap else float("inf")

    def expose(self, motive: Motive, number: int) -> None:
        """Look at the scene now; the frame is due after its latency."""
        frame, delay = motive.frame(number), motive.delay(number)
        if delay is not None:
            heapq.heappush(self._heap, (number * motive.settings.period + delay, number, frame))

    def pop(self, now: float) -> Frame | None:
        """A frame that is due."""
        return heapq.heappop(self._heap)[2] if self._heap and self._heap[0][0] <= now else None
