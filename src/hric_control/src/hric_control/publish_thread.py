"""The thread that builds and sends messages for the control loop."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any


class Outbox:
    """Messages of one topic that wait to be built and sent.

    Args:
        send: takes the built message.
        name: topic, for messages.
        limit: how many may wait; the oldest give way. That is worth a word, but for a limit of 1, where only the newest is wanted.
        report: takes one line of text, at the first failure and at the first drop.
    """

    __slots__ = ("_limit", "_queue", "_report", "_told_drop", "_told_error", "dropped", "name", "send")

    def __init__(self, send: Callable[[Any], None], name: str, limit: int, report: Callable[[str], None] | None = None) -> None:
        self.send, self.name, self.dropped = send, name, 0
        self._queue: deque[Callable[[], Any]] = deque(maxlen=limit)
        self._limit, self._report = limit, report
        self._told_error = self._told_drop = False

    def append(self, build: Callable[[], Any]) -> None:
        """Let `build` wait; the oldest gives way when too many do."""
        if len(self._queue) == self._limit:
            self.dropped += 1
        self._queue.append(build)

    def __len__(self) -> int:
        return len(self._queue)

    def send_inline(self) -> None:
        """Build and send all that waits in the calling thread; errors reach the caller."""
        while self._queue:
            self.send(self._queue.popleft()())

    def send_next(self) -> None:
        """Build and send the oldest. A failure is reported once for this topic and does not reach the caller."""
        try:
            build = self._queue.popleft()
        except IndexError:  # the loop's append pushed it out in this very moment
            return
        try:
            self.send(build())
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
    """Builds and sends what waits in its outboxes; daemon. The loop only appends; it takes no lock that is held while building or sending.

    Attributes:
        polling: look for messages by itself (a paced loop, which sleeps), or only when `drain` asks (one that runs as fast as it can).
    """

    def __init__(self) -> None:
        self._outboxes: tuple[Outbox, ...] = ()
        self._lock = threading.Lock()  # for add and remove only
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
        """Wait until nothing waits; False when it took longer than `timeout` [s], or when it still hangs where it hung the last time."""
        if self._hung is not None and self._hung is self._sending:
            return False
        deadline = time.monotonic() + timeout
        while self._busy():
            self._idle.clear()
            self._event.set()
            if not self._idle.wait(max(0.0, deadline - time.monotonic())):
                self._hung = self._sending
                return False
        return True

    def stop(self) -> None:
        """End the thread after what it is sending now."""
        self._stopped = True
        self._event.set()
        self._thread.join(1.0)

    def _busy(self) -> bool:
        return self._sending is not None or any(len(outbox) for outbox in self._outboxes)

    def _work(self) -> None:
        while not self._stopped:
            self._event.wait(POLL_PERIOD if self.polling else DOZE)
            self._event.clear()
            for outbox in self._outboxes:
                while len(outbox) and not self._stopped:
                    self._sending = object()
                    outbox.send_next()
                    self._sending = None
            self._idle.set()
