"""Messages on their way to listeners. A socket that takes no more keeps nobody waiting: what is left waits for that
listener alone, and beyond a limit it loses its own oldest messages.

Nothing here blocks: each write takes what the socket has room for, and a thread sends the rest when there is room.
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
"""Data that may wait for one listener beyond what its socket holds [bytes]. The newest message waits whatever its size
(project default, unconfirmed: a second of the largest topic of 1 kHz)."""
DEAD = 600.0
"""A listener that takes nothing for so long is let go [s] (project default, unconfirmed: a debugger may hold it up)."""
PART = 1 << 18
"""Data that is written to a listener at a time while others wait for their turn [bytes]."""
LOOK = 1.0
"""Between two looks at who is behind [s]."""


class Listener:
    """A subscriber of a topic, at the other end of a socket.

    Args:
        name: who listens to what, for messages.
        socket: to write to.

    Attributes:
        lost: messages that were dropped since it did not read them.
    """

    def __init__(self, name: str, socket: socket) -> None:
        self.name, self.lost = name, 0
        self.file = socket.fileno()
        self.open = self.file >= 0
        self.waiting: deque[tuple[bytes | memoryview, int]] = deque()  # data and number of its messages
        self.size = 0
        self.begun = False  # the first of them is out in part, so that the rest must follow
        self.stuck = False  # nobody waits for it to catch up
        self.progress = 0.0
        self.reported = 0

    def let_go(self) -> None:
        """Close the connection; called without a lock."""

    def close(self) -> None:
        """Drop what waits, and close the connection."""
        DISPATCHER.forget(self)
        self.let_go()


class Parcel(NamedTuple):
    """Serialised messages of one topic, in their order.

    Attributes:
        listeners: whom it goes to.
        data: [bytes].
        number: of messages.
    """

    listeners: Sequence[Listener]
    data: bytes
    number: int = 1


NOTHING = Parcel((), b"", 0)


class Status(NamedTuple):
    """Listeners of this process that do not keep up.

    Attributes:
        behind: names of those for whom something waits.
        waiting: for all of them [bytes].
        lost: messages since the start, of all listeners.
        closed: listeners that were let go since they took nothing.
    """

    behind: tuple[str, ...]
    waiting: int
    lost: int
    closed: int


class Dispatcher:
    """Sends to all listeners of a process."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._behind: dict[int, Listener] = {}
        self._poll = select.epoll()
        self._thread: threading.Thread | None = None
        self._lost = self._closed = 0

    def send(self, parcels: Sequence[Parcel]) -> None:
        """Write what the sockets take, and keep the rest; a listener that cannot be written to is closed."""
        posts = [(listener, parcel.data, parcel.number) for parcel in parcels for listener in parcel.listeners]
        broken: list[Listener] = []
        with self._changed:
            while posts:
                posts = self._send(posts, broken)
        for listener in broken:
            listener.close()

    def flush(self, timeout: float) -> bool:
        """Wait until all listeners took what waits for them. One that did not within `timeout` [s] is not waited for
        again before it has caught up; then False."""
        with self._changed:
            done = self._changed.wait_for(lambda: all(one.stuck for one in self._behind.values()), max(timeout, 0.0))
            for listener in self._behind.values():
                listener.stuck = True
            return done and not self._behind

    def forget(self, listener: Listener) -> None:
        """Send it nothing more."""
        with self._changed:
            listener.open = False
            self._caught_up(listener)

    def status(self) -> Status:
        """Who does not keep up."""
        with self._changed:
            behind = list(self._behind.values())
            return Status(
                tuple(sorted(one.name for one in behind)), sum(one.size for one in behind), self._lost, self._closed
            )

    # -- with the lock -------------------------------------------------------------------------------------------------

    def _send(
        self, posts: Sequence[tuple[Listener, bytes, int]], broken: list[Listener]
    ) -> list[tuple[Listener, bytes, int]]:
        """Send the first post of each listener; returns the others."""
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
        """Let data wait; the oldest messages that are not begun give way."""
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
            with suppress(OSError):  # its owner has closed the socket, and the system forgets it by itself
                self._poll.unregister(listener.file)
            self._changed.notify_all()

    def _advance(self, listener: Listener) -> bool:
        """Send some of what waits; False when the connection is broken."""
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
                    whole = listener is None or self._advance(listener)
                if listener is not None and not whole:
                    listener.close()
            if time.monotonic() >= look:
                look = time.monotonic() + LOOK
                self._report()

    def _report(self) -> None:
        """Say who loses messages, and let go who is dead."""
        now = time.monotonic()
        with self._changed:
            behind = list(self._behind.values())
            dead = [listener for listener in behind if now - listener.progress > DEAD]
            self._closed += len(dead)
        for listener in behind:
            if listener.lost and not listener.reported:
                listener.reported = listener.lost
                LOG.warning(
                    "%s does not keep up: its oldest messages are dropped where more than %d MiB wait (reported once)",
                    listener.name,
                    LIMIT >> 20,
                )
        for listener in dead:
            LOG.warning("%s took nothing for %g s: closed", listener.name, DEAD)
            listener.close()


DISPATCHER = Dispatcher()
"""The process's one."""
