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
from contextlib import AbstractContextManager, ExitStack, nullcontext
from socket import socket
from typing import Any, NamedTuple, Protocol

from hric_control.native.sending import send_all

Build = Callable[..., Any]
"""Builds a message from its arguments."""
OnError = Callable[[Exception], None]
"""Takes what went wrong with one of several messages."""


class Listener(Protocol):
    """Somebody who listens to a topic, as rospy keeps it.

    Attributes:
        socket: to write to; None when it has gone.
    """

    socket: socket | None

    def close(self) -> None:
        """Be rid of it."""


class Parcel(NamedTuple):
    """Serialised messages of one topic, in their order.

    Attributes:
        lock: of the topic, so that nobody else writes into the middle of it.
        listeners: whom it goes to.
        data: [bytes].
    """

    lock: AbstractContextManager[Any]
    listeners: Sequence[Listener]
    data: bytes


NOTHING = Parcel(nullcontext(), (), b"")

Pack = Callable[[Sequence[Any], OnError], Parcel]
"""(messages, on_error): serialises them; those that cannot be are reported and left out."""


def deliver(parcels: Sequence[Parcel]) -> None:
    """Write all parcels, without the interpreter; a listener that cannot be written to is closed."""
    with ExitStack() as locks:
        for parcel in parcels:
            locks.enter_context(parcel.lock)
        open_ = [
            (listener, listener.socket.fileno(), parcel.data)
            for parcel in parcels
            for listener in parcel.listeners
            if parcel.data and listener.socket is not None
        ]
        if not open_:
            return
        listeners, numbers, data = zip(*open_, strict=True)
        for listener, error in zip(listeners, send_all(list(numbers), list(data)), strict=True):
            if error:  # whatever is wrong with it, it is a listener less
                listener.close()


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
        self._rounds, self._hung = 0, -1
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
        """Build and serialise what waits, and have it written while the caller goes on. False when what was handed over
        before is not written within `timeout` [s], or still hangs where it hung before: nothing is done then."""
        if not self._acquire(timeout):
            return False
        parcels: list[Parcel] = []
        try:
            parcels += filter(None, (outbox.pack() for outbox in self._outboxes))
        finally:
            self._handed = parcels
            self._event.set()
        return True

    def drain(self, timeout: float) -> bool:
        """Wait until nothing waits; False when it took longer than `timeout` [s], or hangs as before."""
        deadline = time.monotonic() + timeout
        while self._calls or any(map(len, self._outboxes)) or self._busy.locked():
            if not self.hand_over(deadline - time.monotonic()) or not self._acquire(deadline - time.monotonic()):
                return False
            self._busy.release()
        return True

    def stop(self) -> None:
        """End the thread after what it is sending now."""
        self._stopped = True
        self._event.set()
        self._thread.join(1.0)

    def _acquire(self, timeout: float) -> bool:
        if self._hung == self._rounds:
            timeout = 0.0
        if not self._busy.acquire(timeout=max(timeout, 0.0)):
            self._hung = self._rounds
            return False
        self._rounds += 1
        return True

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
                    deliver(handed)
            finally:
                self._busy.release()

    def _look(self) -> None:
        self._rounds += 1
        for outbox in self._outboxes:
            while not self._stopped and (parcel := outbox.pack()) is not None:
                deliver((parcel,))
