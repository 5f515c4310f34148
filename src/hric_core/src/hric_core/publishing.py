"""The thread that sends messages for the control loop.

Beside a paced loop, which sleeps between two cycles, it looks for messages by itself, builds and sends them. A loop
that runs as fast as it can never sleeps: it builds and serialises what waits itself, every 100 cycles, and only the
writes are done by the thread, without the interpreter, while the loop goes on. Shared cycle by cycle the interpreter
would be waited for at each of them, which costs more than building the messages.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from hric_core.listeners import DISPATCHER, Parcel

Build = Callable[..., Any]
"""Builds a message from its arguments."""
OnError = Callable[[Exception], None]
"""Takes what went wrong with one of several messages."""
Pack = Callable[[Sequence[Any], OnError], Parcel]
"""(messages, on_error): serialises them; those that cannot be are reported and left out."""


class Outbox:
    """Messages of one topic that wait to be built and sent.

    Args:
        pack: serialises them.
        name: topic, for messages.
        limit: how many may wait; the oldest are dropped. That is reported, but for a limit of 1, where only the newest
            counts.
        report: takes one line of text, at the first failure and at the first drop.
    """

    __slots__ = ("_limit", "_pack", "_queue", "_report", "_reported_drop", "_reported_error", "dropped", "name")

    def __init__(self, pack: Pack, name: str, limit: int, report: Callable[[str], None] | None = None) -> None:
        self._pack, self.name, self.dropped = pack, name, 0
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

    def pack(self) -> Parcel | None:
        """Build and serialise the oldest, at most TOGETHER; None when nothing waits. A failure is reported once for
        this topic, and the other messages go on."""
        built: list[Any] = []
        try:
            for _ in range(min(len(self._queue), TOGETHER)):
                build, args = self._queue.popleft()
                try:
                    built.append(build(*args))
                except Exception as error:
                    self._report_error(error)
        except IndexError:  # the loop's append pushed it out in this very moment
            pass
        if self.dropped and self._limit > 1 and not self._reported_drop:
            self._reported_drop = True
            self._warn(f"{self.name}: messages were dropped, more than {self._limit} waited (reported once)")
        try:
            return self._pack(built, self._report_error) if built else None
        except Exception as error:  # whatever is wrong with this topic, the loop and the others go on
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
"""Most messages of a topic in one parcel: two of those that a loop of 1 kHz hands over at a time."""
POLL_PERIOD = 0.002
"""How often the thread looks for messages [s]. Looking beats being woken: measured beside a 1 kHz loop that publishes
in every fourth cycle, waking an event costs the loop 35 us for each message (the woken thread requests the interpreter
at once), looking every 2 ms costs it nothing, the lateness of its cycles is the same, and the process spends no more
(18 % of a core either way)."""
PATIENCE = 0.1
"""The thread looks by itself again when the loop has handed nothing over for so long [s]."""


class PublishThread:
    """Sends what waits in its outboxes; daemon. The loop only appends, and hands over if it does not sleep."""

    def __init__(self) -> None:
        self._outboxes: tuple[Outbox, ...] = ()
        self._lock = threading.Lock()  # for add and remove only
        self._calls: deque[Callable[[], None]] = deque()
        self._event = threading.Event()
        self._busy = threading.Lock()  # of whoever packs, until it is delivered
        self._handed: list[Parcel] | None = None
        self._stopped = False
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

    def call(self, function: Callable[[], None]) -> None:
        """Have the thread call a function that raises nothing."""
        self._calls.append(function)

    def hand_over(self, timeout: float) -> bool:
        """Build and serialise what waits, and have it written while the caller goes on, once all listeners took what
        was handed over before. One that needs longer than `timeout` [s] is not waited for until it has caught up.
        False when the thread itself is busy for so long: nothing is done then."""
        deadline = time.monotonic() + timeout
        if not self._acquire(deadline):
            return False
        DISPATCHER.flush(deadline - time.monotonic())
        self._hand_over()
        return True

    def drain(self, timeout: float) -> bool:
        """Wait until nothing waits, here or for a listener that reads; False when it took longer than `timeout` [s]."""
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
        """Pack what waits for the thread, which gives `_busy` back."""
        parcels: list[Parcel] = []
        try:
            parcels += filter(None, (outbox.pack() for outbox in self._outboxes))
        finally:
            self._handed = parcels
            self._event.set()

    def stop(self) -> None:
        """End the thread after what it is sending now."""
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
