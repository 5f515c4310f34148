"""Emulated Motive as a server on UDP."""

import contextlib
import heapq
import logging
import select
import socket
import threading
from collections.abc import Callable

from hric_core.errors import FailureError
from hric_core.robot_time.stream_time import Clock, StreamTime, WallClock
from mocap_natnet.client.client import datagram_socket
from mocap_natnet.server.motive import Motive, Outgoing

LOG = logging.getLogger("hric.mocap_natnet")
MAX_DATAGRAM = 65536
LATE = 1.0
"""Delay beyond which a stream skips frames instead of catching up [s] (project default, unconfirmed)."""
IDLE = 0.1
"""Longest sleep of the server's thread, after which it notices that it is to end [s]."""
REQUESTS = 100
"""Largest number of requests processed between two frames, so that a flood of them stops no stream (project default,
unconfirmed)."""
STANDING = 0.005
"""Sleep of the server's thread while the stream pauses, as it does in a paused run [s]."""


class MotiveServer:
    """Server of an emulated Motive. Use as a context, or `start()` and `close()`.

    The scene is evaluated when a frame is sent, its latency after the exposure, so that a source may receive data of
    the exposure until then.

    Args:
        motive: emulated Motive.
        clock: clock of the stream: the wall clock, or a `RobotTime`, so that the cameras pause with the run. The
            stream's time begins at 0 when the server starts and the clock is known. The server's ticks never pause.
        on_reached: callback, in the stream's thread, with the clock time up to which all frames are sent [s]; None: not
            known.

    Attributes:
        sent: number of frames sent, whether a client received them or not.
        progress: (number of the latest frame sent, how many frames were sent), both of the same moment.

    Raises:
        HricError: the address or the port is in use.
    """

    def __init__(
        self,
        motive: Motive,
        clock: Clock | None = None,
        on_reached: Callable[[float | None], None] = lambda reached: None,
    ) -> None:
        self.motive, self.sent, self._on_reached = motive, 0, on_reached
        self.progress = (-1, 0)
        self._clock, self._stop = clock or WallClock(), threading.Event()
        self._latest = 0
        self._thread: threading.Thread | None = None
        settings = motive.settings
        self._command = datagram_socket()
        # The data socket has any free port: bound to the data port, it would take unicast frames away from clients on
        # this machine.
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
            raise FailureError(
                f"cannot listen on {settings.ip}, UDP port {settings.command_port}: {error.strerror or error}"
            ) from error
        self._time = StreamTime(self._clock)

    @property
    def command_port(self) -> int:
        """UDP port on which requests arrive."""
        return int(self._command.getsockname()[1])

    @property
    def time(self) -> float:
        """Current time of the stream [s]."""
        return self._time.now()

    def robot_time(self, stream: float) -> float | None:
        """Return the clock time [s] at a time of the stream [s]; None while it is not known."""
        return self._time.clock_time(stream)

    def start(self) -> None:
        """Start streaming, in a thread."""
        self._thread = threading.Thread(target=self.run, name="emulated motive", daemon=True)
        self._thread.start()

    def __enter__(self) -> "MotiveServer":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def running(self) -> bool:
        """True while the thread streams."""
        return self._thread is not None and self._thread.is_alive()

    def close(self) -> None:
        """Stop streaming, and release the ports."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._close_sockets()

    def run(self) -> None:
        """Stream until `close()`."""
        self._time = StreamTime(self._clock)
        self.motive.hardware = self._time.hardware
        pending = _Pending(self.motive)
        while not self._stop.is_set():
            now = self.time
            pending.look_ahead(now)
            while (due := pending.pop(now)) is not None:
                self._latest = due
                self._send(self._data, self.motive.stream(self.motive.frame(due), self._time.hardware_now()))
                self.sent += 1
                self.progress = (due, self.sent)
                pending.look_ahead(now)
            self._on_reached(self.robot_time(now))
            self._respond(self.wait(min(now + IDLE, pending.next)))

    def wait(self, until: float) -> float:
        """Return how long to sleep until a time of the stream [s of wall time], at most `IDLE`; 0: it is reached."""
        wait = self._time.hardware(until) - self._time.hardware_now()
        if wait > 0:
            return min(IDLE, wait)
        return 0.0 if until <= self.time else STANDING

    def _respond(self, wait: float) -> None:
        """Wait for a datagram for at most `wait` [s], and respond to those that have arrived."""
        ready, _, _ = select.select([self._command], [], [], wait)
        for _ in range(REQUESTS if ready else 0):
            try:
                datagram, sender = self._command.recvfrom(MAX_DATAGRAM, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:  # a client has ended: nobody listens on its port
                continue
            self._send(self._command, self.motive.respond(datagram, sender, self._time.hardware_now(), self._latest))

    def _send(self, out: socket.socket, datagrams: Outgoing) -> None:
        for datagram, address in datagrams:
            with contextlib.suppress(OSError):  # a network that is down or full loses datagrams, as networks do
                out.sendto(datagram, address)

    def _close_sockets(self) -> None:
        self._command.close()
        self._data.close()


class _Pending:
    """Queue of the numbers of frames that were or will soon be exposed, but are not sent yet."""

    def __init__(self, motive: Motive) -> None:
        self._motive, self._number = motive, 0
        self._heap: list[tuple[float, int]] = []

    @property
    def next(self) -> float:
        """Stream time at which the next frame is to be sent [s]; infinity: none is queued."""
        return self._heap[0][0] if self._heap else float("inf")

    def look_ahead(self, now: float) -> None:
        """Queue the frames that may be due within `IDLE`, so that the thread need not wake up at each exposure."""
        settings = self._motive.settings
        period, latency = settings.period, settings.latency
        late = now - latency - self._number * period
        if late > LATE:
            LOG.warning("the stream is %.1f s late: its frames of this time are skipped", late)
            self._number = int(now / period)
        while self._number * period + latency <= min(self.next, now + IDLE):
            delay = self._motive.delay(self._number)
            if delay is not None:
                heapq.heappush(self._heap, (self._number * period + delay, self._number))
            self._number += 1

    def pop(self, now: float) -> int | None:
        """Remove and return the number of a frame that is due at a stream time [s]; None: none is due."""
        return heapq.heappop(self._heap)[1] if self._heap and self._heap[0][0] <= now else None
