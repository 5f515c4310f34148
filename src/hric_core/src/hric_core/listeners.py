"""Non-blocking transmission of serialised messages to listeners, the subscribers of this process's topics.

Each write fills the free space of the listener's socket. What does not fit is queued for this listener, and a thread
sends it when the socket has room again. Beyond a limit, the oldest queued messages of the listener are dropped.
"""

import logging
import select
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from socket import socket
from typing import NamedTuple

from hric_core.native.sockets import send_now

LOG = logging.getLogger("hric.control.listeners")
LIMIT = 4 << 20
"""Largest amount of data queued for one listener, in addition to its socket's buffer [bytes].

The newest message is queued whatever its size. Project default, unconfirmed: one second of the largest 1 kHz topic."""
DEAD = 600.0
"""Time after which the connection to a listener that reads nothing is closed [s].

Project default, unconfirmed; long, because a debugger may have suspended the listener."""
PART = 1 << 18
"""Amount of queued data sent to one slow listener before the next one gets its turn [bytes]."""
LOOK = 1.0
"""Period of the check for listeners that lose messages or read nothing [s]."""


class Listener:
    """Subscriber of a topic, at the other end of a socket.

    Args:
        name: name of subscriber and topic, for log lines.
        socket: socket to write to.

    Attributes:
        lost: number of messages dropped because the listener read too slowly.
    """

    def __init__(self, name: str, socket: socket) -> None:
        self.name, self.lost = name, 0
        self.file = socket.fileno()
        self.open = self.file >= 0
        self.waiting: deque[tuple[bytes | memoryview, int]] = deque()  # (data, number of messages)
        self.size = 0
        self.begun = False  # part of the first entry was sent, so its rest must follow
        self.stuck = False  # `flush` does not wait for it to catch up
        self.progress = 0.0
        self.reported = 0

    def let_go(self) -> None:
        """Close the connection; called while the dispatcher's lock is not held."""

    def close(self) -> None:
        """Drop the queued data and close the connection."""
        DISPATCHER.forget(self)
        self.let_go()


class Parcel(NamedTuple):
    """Serialised messages of one topic, in order, with their receivers.

    Attributes:
        listeners: receivers.
        data: the messages as sent on the wire.
        number: number of messages.
    """

    listeners: Sequence[Listener]
    data: bytes
    number: int = 1


NOTHING = Parcel((), b"", 0)


class Status(NamedTuple):
    """Statistics of the listeners of this process that read too slowly.

    Attributes:
        behind: names of the listeners with queued data.
        waiting: data queued for all of them [bytes].
        lost: messages dropped since the start, for all listeners.
        closed: number of listeners closed because they did not read.
    """

    behind: tuple[str, ...]
    waiting: int
    lost: int
    closed: int


class Dispatcher:
    """Non-blocking sender of messages to all listeners of this process."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._behind: dict[int, Listener] = {}
        self._poll = select.epoll()
        self._thread: threading.Thread | None = None
        self._lost = self._closed = 0

    def send(self, parcels: Sequence[Parcel]) -> None:
        """Write as much as the sockets accept, and queue the rest. A listener with a broken connection is closed."""
        posts = [(listener, parcel.data, parcel.number) for parcel in parcels for listener in parcel.listeners]
        broken: list[Listener] = []
        with self._changed:
            while posts:
                posts = self._send(posts, broken)
        for listener in broken:
            listener.close()

    def flush(self, timeout: float) -> bool:
        """Wait until no data is queued for any listener; return False if `timeout` [s] passes first.

        A listener that was too slow is not waited for again until its queue has been empty once."""
        with self._changed:
            done = self._changed.wait_for(
                lambda: all(listener.stuck for listener in self._behind.values()), max(timeout, 0.0)
            )
            for listener in self._behind.values():
                listener.stuck = True
            return done and not self._behind

    def forget(self, listener: Listener) -> None:
        """Drop the data queued for a listener and send nothing more to it."""
        with self._changed:
            listener.open = False
            self._caught_up(listener)

    def status(self) -> Status:
        """Return the statistics of listeners that read too slowly."""
        with self._changed:
            behind = list(self._behind.values())
            return Status(
                tuple(sorted(listener.name for listener in behind)),
                sum(listener.size for listener in behind),
                self._lost,
                self._closed,
            )

    # -- with the lock -------------------------------------------------------------------------------------------------

    def _send(
        self, posts: Sequence[tuple[Listener, bytes, int]], broken: list[Listener]
    ) -> list[tuple[Listener, bytes, int]]:
        """Send the first entry (listener, data, number of messages) of each listener; return the other entries.

        Listeners whose connection is broken are appended to `broken`."""
        first: dict[Listener, tuple[bytes, int]] = {}
        later = []
        for listener, data, count in posts:
            if not listener.open or not data:
                continue
            if listener.waiting:
                self._keep(listener, data, count)
            elif listener in first:
                later.append((listener, data, count))
            else:
                first[listener] = data, count
        taken = send_now([listener.file for listener in first], [data for data, _ in first.values()]) if first else []
        for (listener, (data, count)), sent in zip(first.items(), taken, strict=True):
            if sent < 0:
                broken.append(listener)
                listener.open = False
            elif sent < len(data):
                listener.begun = sent > 0
                self._keep(listener, memoryview(data)[sent:], count)
        return later

    def _keep(self, listener: Listener, data: bytes | memoryview, count: int) -> None:
        """Queue data for a listener; beyond the limit drop its oldest messages, except one that is partly sent."""
        waiting = listener.waiting
        if not waiting:
            listener.progress = time.monotonic()
            self._behind[listener.file] = listener
            self._poll.register(listener.file, select.EPOLLOUT)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="slow listeners", daemon=True)
                self._thread.start()
        waiting.append((data, count))
        listener.size += len(data)
        while listener.size > LIMIT and len(waiting) > 1 + listener.begun:
            dropped, number = waiting[listener.begun]
            del waiting[listener.begun]
            listener.size -= len(dropped)
            listener.lost += number
            self._lost += number

    def _caught_up(self, listener: Listener) -> None:
        listener.waiting.clear()
        listener.size, listener.begun, listener.stuck = 0, False, False
        if self._behind.get(listener.file) is listener:
            del self._behind[listener.file]
            with suppress(OSError):  # closed by its owner, which also unregisters it
                self._poll.unregister(listener.file)
            self._changed.notify_all()

    def _advance(self, listener: Listener) -> bool:
        """Send a part of a listener's queued data; return False if the connection is broken."""
        waiting, part = listener.waiting, list[bytes | memoryview]()
        size = 0
        for data, _ in waiting:
            part.append(data)
            size += len(data)
            if size >= PART:
                break
        (sent,) = send_now([listener.file], [b"".join(part) if len(part) > 1 else part[0]])
        if sent < 0:
            return False
        if sent:
            listener.progress = time.monotonic()
        listener.size -= sent
        while sent:
            data, count = waiting[0]
            if sent < len(data):
                waiting[0] = memoryview(data)[sent:], count
                listener.begun = True
                return True
            sent -= len(data)
            waiting.popleft()
            listener.begun = False
        if not waiting:
            self._caught_up(listener)
        return True

    # -- in the thread -------------------------------------------------------------------------------------------------

    def _work(self) -> None:
        look = time.monotonic() + LOOK
        while True:
            for file, _ in self._poll.poll(LOOK):
                with self._changed:
                    listener = self._behind.get(file)
                    writable = listener is None or self._advance(listener)
                if listener is not None and not writable:
                    listener.close()
            if time.monotonic() >= look:
                look = time.monotonic() + LOOK
                self._report()

    def _report(self) -> None:
        """Log listeners that lose messages, and close the connections of those that read nothing."""
        now = time.monotonic()
        with self._changed:
            behind = list(self._behind.values())
            dead = [listener for listener in behind if now - listener.progress > DEAD]
            self._closed += len(dead)
        for listener in behind:
            if listener.lost and not listener.reported:
                listener.reported = listener.lost
                LOG.warning(
                    "%s reads too slowly: its oldest messages are dropped while more than %d MiB are queued for it "
                    "(reported once)",
                    listener.name,
                    LIMIT >> 20,
                )
        for listener in dead:
            LOG.warning("%s read nothing for %g s; closing the connection to it", listener.name, DEAD)
            listener.close()


DISPATCHER = Dispatcher()
"""Dispatcher of this process."""
