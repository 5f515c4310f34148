"""The thread that builds and sends messages for the control loop."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

Build = Callable[..., Any]
Send = Callable[[Build, tuple[Any, ...]], None]
"""Takes a function that builds a message and its arguments."""


class Outbox:
    """Messages of one topic that wait to be built and sent.

    Args:
        send: builds and sends.
        name: topic, for messages.
        limit: how many may wait; the oldest are dropped. That is reported, but for a limit of 1, where only the newest
            counts.
        report: takes one line of text, at the first failure and at the first drop.
    """

    __slots__ = ("_limit", "_queue", "_report", "_reported_drop", "_reported_error", "dropped", "name", "send")

    def __init__(self, send: Send, name: str, limit: int, report: Callable[[str], None] | None = None) -> None:
        self.send, self.name, self.dropped = send, name, 0
        self._queue: deque[tuple[Build, tuple[Any, ...]]] = deque(maxlen=limit)
        self._limit, self._report = limit, report
        self._reported_error = self._reported_drop = False

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
            if not self._reported_error:
                self._reported_error = True
                self._warn(f"{self.name}: message could not be sent: {type(error).__name__}: {error} (reported once)")
        if self.dropped and self._limit > 1 and not self._reported_drop:
            self._reported_drop = True
            self._warn(f"{self.name}: messages were dropped, more than {self._limit} waited (reported once)")

    def _warn(self, text: str) -> None:
        if self._report is not None:
            self._report(text)


POLL_PERIOD = 0.002
"""How often the thread looks for messages [s]. Looking beats being woken: measured beside a 1 kHz loop that publishes
in every fourth cycle, waking an event costs the loop 35 us for each message (the woken thread requests the interpreter
at once), looking every 2 ms costs it nothing, the lateness of its cycles is the same, and the process spends no more
(18 % of a core either way)."""


DOZE = 0.1
"""The same for a loop that drains by itself [s]: between two drains it shall have the interpreter for itself."""


class PublishThread:
    """Sends what waits in its outboxes; daemon. The loop only appends; it takes no lock that is held while building or
    sending.

    Attributes:
        polling: look for messages by itself (a paced loop, which sleeps), or only in `drain` (one that runs as
            fast as it can).
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
        """Wait until nothing waits; False when it took longer than `timeout` [s], or still hangs where it hung
        before."""
        deadline = time.monotonic() + timeout
        if self._hung is not None and self._hung is self._sending:
            return False
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
        return self._sending is not None or any(map(len, self._outboxes))

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
