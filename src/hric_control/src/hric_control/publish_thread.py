"""The thread that sends messages for the control loop, or hands them to the process that does."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from hric_control.publish_process import PublishProcess

Build = Callable[..., Any]
Send = Callable[[Build, tuple[Any, ...]], None]
"""Takes a function that builds a message and its arguments."""


class Outbox:
    """Messages of one topic that wait to be built and sent.

    Args:
        send: builds and sends, or hands over to the process that does.
        name: topic, for messages.
        limit: how many may wait; the oldest give way. That is worth a word, but for a limit of 1, where only the newest is wanted.
        report: takes one line of text, at the first failure and at the first drop.
        process: where `send` hands over to; None: it builds and sends itself, and may hang at a listener.
    """

    __slots__ = ("_limit", "_queue", "_report", "_told_drop", "_told_error", "dropped", "name", "process", "send")

    def __init__(self, send: Send, name: str, limit: int, report: Callable[[str], None] | None = None, process: PublishProcess | None = None) -> None:
        self.send, self.name, self.process, self.dropped = send, name, process, 0
        self._queue: deque[tuple[Build, tuple[Any, ...]]] = deque(maxlen=limit)
        self._limit, self._report = limit, report
        self._told_error = self._told_drop = False

    def append(self, build: Build, args: tuple[Any, ...] = ()) -> None:
        """Let a message wait; the oldest gives way when too many do."""
        if len(self._queue) == self._limit:
            self.dropped += 1
        self._queue.append((build, args))

    def __len__(self) -> int:
        return len(self._queue)

    def send_inline(self) -> None:
        """Build and send all that waits in the calling thread; errors reach the caller."""
        while self._queue:
            self.send(*self._queue.popleft())

    def send_next(self) -> None:
        """Build and send the oldest. A failure is reported once for this topic and does not reach the caller."""
        try:
            build, args = self._queue.popleft()
        except IndexError:  # the loop's append pushed it out in this very moment
            return
        try:
            self.send(build, args)
        except Exception as error:  # whatever a builder does, the other topics go on
            if not self._told_error:
                self._told_error = True
                self._tell(f"{self.name}: message could not be sent: {type(error).__name__}: {error} (told once)")
        if self.dropped and self._limit > 1 and not self._told_drop:
            self._told_drop = True
            self._tell(f"{self.name}: messages were dropped, more than {self._limit} waited (told once)")

    def _tell(self, text: str) -> None:
        if self._report is not None:
            self._report(text)


POLL_PERIOD = 0.002
"""How often the thread looks for messages [s]. Looking beats being woken: measured beside a 1 kHz loop that publishes in every fourth cycle, waking
an event costs the loop 35 us for each message (the woken thread asks for the interpreter at once), looking every 2 ms costs it nothing, the lateness
of its cycles is the same, and the process spends no more (18 % of a core either way)."""


DOZE = 0.1
"""The same for a loop that drains by itself [s]: between two drains it shall have the interpreter for itself."""


class PublishThread:
    """Sends what waits in its outboxes; daemon. The loop only appends; it takes no lock that is held while building or sending.

    Attributes:
        polling: look for messages by itself (a paced loop, which sleeps), or only when `drain` asks (one that runs as fast as it can).
    """

    def __init__(self) -> None:
        self._outboxes: tuple[Outbox, ...] = ()
        self._lock = threading.Lock()  # for add and remove only
        self._handing_over = threading.Lock()  # one thread at a time, so that the messages of a topic keep their order
        self._event = threading.Event()
        self._idle = threading.Event()
        self._stopped = False
        self.polling = True
        self._sending: object | None = None
        self._hung: object | None = None
        self._thread = threading.Thread(target=self._work, name="publish", daemon=True)
        self._thread.start()

    def add(self, outbox: Outbox) -> None:
        """Take an outbox into care."""
        with self._lock:
            self._outboxes = (*self._outboxes, outbox)

    def remove(self, outbox: Outbox) -> None:
        """Drop an outbox and what waits in it."""
        with self._lock:
            self._outboxes = tuple(other for other in self._outboxes if other is not outbox)

    def drain(self, timeout: float) -> bool:
        """Wait until nothing waits; False when it took longer than `timeout` [s], or when it still hangs where it hung the last time.

        What goes to another process is handed over by the calling thread, and may be a little behind there (`PublishProcess.has_room`).
        """
        deadline = time.monotonic() + timeout
        handed_over = self._hand_over(deadline)
        if self._hung is not None and self._hung is self._sending:
            return False
        while self._busy():
            self._idle.clear()
            self._event.set()
            if not self._idle.wait(max(0.0, deadline - time.monotonic())):
                self._hung = self._sending
                return False
        return handed_over

    def stop(self) -> None:
        """End the thread after what it is sending now."""
        self._stopped = True
        self._event.set()
        self._thread.join(1.0)

    def _busy(self) -> bool:
        return self._sending is not None or any(len(outbox) for outbox in self._outboxes if outbox.process is None)

    def _hand_over(self, deadline: float) -> bool:
        """Give everything to the publishing process, waiting for room until the deadline [s of the monotonic clock]; False where that did not do."""
        if not self._handing_over.acquire(timeout=max(0.0, deadline - time.monotonic())):
            return False
        try:
            remote = [(outbox, outbox.process) for outbox in self._outboxes if outbox.process is not None]
            whole = all([_give(outbox, process, deadline) for outbox, process in remote if len(outbox)])
            for process in {process for _, process in remote}:
                process.push()
            return whole
        finally:
            self._handing_over.release()

    def _work(self) -> None:
        while not self._stopped:
            self._event.wait(POLL_PERIOD if self.polling else DOZE)
            self._event.clear()
            if self.polling:
                self._hand_over(-math.inf)
            for outbox in self._outboxes:
                while outbox.process is None and len(outbox) and not self._stopped:
                    self._sending = object()
                    outbox.send_next()
                    self._sending = None
            self._idle.set()


def _give(outbox: Outbox, process: PublishProcess, deadline: float) -> bool:
    while len(outbox):
        if not process.has_room() and not process.make_room(deadline - time.monotonic()):
            return False
        outbox.send_next()
    return True
