"""Thread that sends messages for the control loop.

If the loop is paced (sleeps between two cycles), the thread polls for messages, builds and sends them. An unpaced loop
never sleeps: every 100 cycles it builds and serialises the queued messages itself, and the thread only writes them to
the sockets, without Python's interpreter lock, while the loop goes on. If loop and thread shared the interpreter in
each cycle, waiting for its lock would cost more than building the messages.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from hric_core.listeners import DISPATCHER, Parcel

Build = Callable[..., Any]
"""Function that builds a message from its arguments."""
OnError = Callable[[Exception], None]
"""Callback for the error of a message that could not be serialised."""
Pack = Callable[[Sequence[Any], OnError], Parcel]
"""Function (messages, on_error) that serialises messages; it passes errors to `on_error` and omits their messages."""


class Outbox:
    """Queue of one topic's messages that are to be built and sent.

    Args:
        pack: function that serialises messages.
        name: name of the topic, for log lines.
        limit: capacity of the queue; if it is full, the oldest message is dropped. The first drop is reported, unless
            the limit is 1, by which only the newest message matters.
        report: function that logs a line of text, at the first failure and at the first drop.
    """

    __slots__ = ("_limit", "_pack", "_queue", "_report", "_reported_drop", "_reported_error", "dropped", "name")

    def __init__(self, pack: Pack, name: str, limit: int, report: Callable[[str], None] | None = None) -> None:
        self._pack, self.name, self.dropped = pack, name, 0
        self._queue: deque[tuple[Build, tuple[Any, ...]]] = deque(maxlen=limit)
        self._limit, self._report = limit, report
        self._reported_error = self._reported_drop = False

    def append(self, build: Build, args: tuple[Any, ...] = ()) -> None:
        """Queue the message that `build(*args)` returns; if the queue is full, drop the oldest message."""
        if len(self._queue) == self._limit:
            self.dropped += 1
        self._queue.append((build, args))

    def __len__(self) -> int:
        return len(self._queue)

    def pack(self) -> Parcel | None:
        """Build and serialise the oldest messages, at most TOGETHER; return None if the queue is empty.

        The first message of this topic that fails is reported; the other messages are not affected."""
        built: list[Any] = []
        try:
            for _ in range(min(len(self._queue), TOGETHER)):
                build, args = self._queue.popleft()
                try:
                    built.append(build(*args))
                except Exception as error:
                    self._report_error(error)
        except IndexError:  # the loop's append has just dropped the last one
            pass
        if self.dropped and self._limit > 1 and not self._reported_drop:
            self._reported_drop = True
            self._warn(f"{self.name}: messages were dropped, as more than {self._limit} were queued (reported once)")
        try:
            return self._pack(built, self._report_error) if built else None
        except Exception as error:  # an error of this topic must not stop the loop or other topics
            self._report_error(error)
            return None

    def _report_error(self, error: Exception) -> None:
        if not self._reported_error:
            self._reported_error = True
            self._warn(f"{self.name}: message could not be sent: {type(error).__name__}: {error} (reported once)")

    def _warn(self, text: str) -> None:
        if self._report is not None:
            self._report(text)


TOGETHER = 200
"""Largest number of a topic's messages that are serialised together: those of 200 cycles of a 1 kHz loop."""
POLL_PERIOD = 0.002
"""Period at which the publishing thread polls for messages [s].

Polling is better than waking the thread by an event. Measured with a 1 kHz loop that publishes in every fourth cycle:
an event costs the loop 35 us per message, as the woken thread requests the interpreter lock at once; polling every 2 ms
costs it nothing. The lateness of the cycles and the load of the process (18 % of a core) are the same."""
PATIENCE = 0.1
"""Time after the loop's last call of `hand_over` after which the thread polls for messages again [s]."""


class PublishThread:
    """Daemon thread that sends the messages in its outboxes, which the control loop fills.

    A paced loop only fills the outboxes; an unpaced one also calls `hand_over` periodically."""

    def __init__(self) -> None:
        self._outboxes: tuple[Outbox, ...] = ()
        self._lock = threading.Lock()  # for add and remove only
        self._calls: deque[Callable[[], None]] = deque()
        self._event = threading.Event()
        self._busy = threading.Lock()  # held by the packing thread until the parcels are delivered
        self._handed: list[Parcel] | None = None
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="publish", daemon=True)
        self._thread.start()

    def add(self, outbox: Outbox) -> None:
        """Add an outbox whose messages are to be sent."""
        with self._lock:
            self._outboxes = (*self._outboxes, outbox)

    def remove(self, outbox: Outbox) -> None:
        """Remove an outbox; its unsent messages are dropped."""
        with self._lock:
            self._outboxes = tuple(other for other in self._outboxes if other is not outbox)

    def call(self, function: Callable[[], None]) -> None:
        """Let the thread call a function once. The function must not raise an exception."""
        self._calls.append(function)

    def hand_over(self, timeout: float) -> bool:
        """Build and serialise the queued messages, and let the thread write them to the sockets.

        First wait, for `timeout` [s] at most, until the thread has written the messages of the last call and no
        listener's queue has data. A listener that needs longer is not waited for again until its queue is empty. Return
        False if the thread was busy for the whole time; then nothing was done."""
        deadline = time.monotonic() + timeout
        if not self._acquire(deadline):
            return False
        DISPATCHER.flush(deadline - time.monotonic())
        self._hand_over()
        return True

    def drain(self, timeout: float) -> bool:
        """Wait until all queued messages are built and sent; return False if `timeout` [s] passes first.

        Listeners that have stopped reading are not waited for."""
        deadline = time.monotonic() + timeout
        while self._calls or any(map(len, self._outboxes)) or self._busy.locked():
            if not self._acquire(deadline):
                return False
            self._hand_over()
            if not self._acquire(deadline):
                return False
            self._busy.release()
        return DISPATCHER.flush(deadline - time.monotonic())

    def _acquire(self, deadline: float) -> bool:
        return self._busy.acquire(timeout=max(deadline - time.monotonic(), 0.0))

    def _hand_over(self) -> None:
        """Serialise the queued messages and pass them to the thread, which releases `_busy` after writing them."""
        parcels: list[Parcel] = []
        try:
            parcels += filter(None, (outbox.pack() for outbox in self._outboxes))
        finally:
            self._handed = parcels
            self._event.set()

    def stop(self) -> None:
        """End the thread after its present task; wait for at most 1 s."""
        self._stopped = True
        self._event.set()
        self._thread.join(1.0)

    def _work(self) -> None:
        period = POLL_PERIOD
        while not self._stopped:
            self._event.wait(period)
            self._event.clear()
            handed, self._handed = self._handed, None
            if handed is None and not self._busy.acquire(blocking=False):
                continue
            try:
                while self._calls:
                    self._calls.popleft()()
                if handed is None:
                    period = POLL_PERIOD
                    self._look()
                else:
                    period = PATIENCE
                    DISPATCHER.send(handed)
            finally:
                self._busy.release()

    def _look(self) -> None:
        for outbox in self._outboxes:
            while not self._stopped and (parcel := outbox.pack()) is not None:
                DISPATCHER.send((parcel,))
