"""Data exchange between ROS callbacks and the control loop, without making the loop wait.

Into the loop: `LatestValue`. Out of it: `publisher(...)` returns a `RealtimePublisher`; the loop passes it a function
that builds the message, and the function's arguments. The `PublishThread` of the process builds and sends the message
while the loop sleeps; a loop that never sleeps calls `hand_over` periodically. `defer(...)` lets the thread make any
other call to ROS (the result of an action, a log line). A `Throttle` limits messages to a rate of robot time.

On a LocalNode, messages are built and sent within the call, so that a run without ROS is deterministic.
"""

import math
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from hric_core.node import Node, Publisher
from hric_core.publishing import Outbox, PublishThread
from hric_core.scoped_node import ScopedNode

T = TypeVar("T")

LAGGING_LIMIT = 100
"""Capacity of the queue of a topic that is not lossless; if it is full, the oldest message is dropped.

It is one second of the messages of most topics."""
LOSSLESS_LIMIT = 100_000
"""Capacity of the queue of a lossless topic; if it is full, the oldest message is dropped.

It is half an hour of a 50 Hz log, if the publishing thread hangs."""


class LatestValue(Generic[T]):
    """Newest value set by callbacks, for one reader in the control loop.

    There are no locks: append and popleft of a deque are atomic."""

    __slots__ = ("_new", "_value")

    def __init__(self, initial: T) -> None:
        self._value = initial
        self._new: deque[T] = deque(maxlen=1)

    def set(self, value: T) -> None:
        """Replace the value. May be called from any thread."""
        self._value = value
        self._new.append(value)

    def get(self) -> T:
        """Return the newest value; before the first call of `set` the initial one."""
        return self._value

    def take_new(self) -> T | None:
        """Return the newest value if it was set since the last call of this method, else None. For one reader only."""
        return self._new.popleft() if self._new else None


class Throttle:
    """Throttle that decides in which control cycles to publish, at a fixed rate of robot time and without drift.

    Args:
        rate: number of publications per second of robot time [Hz]; 0 means never.
    """

    __slots__ = ("_next", "_period")

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate if rate > 0.0 else math.inf
        self._next = -math.inf if rate > 0.0 else math.inf

    def restart(self) -> None:
        """Make the next call of `due` return True, unless the rate is 0."""
        if self._period < math.inf:
            self._next = -math.inf

    def due(self, time: float) -> bool:
        """Return True if it is time to publish, at most once per period of the rate; `time`: robot time [s]."""
        if time < self._next - 1e-9:
            return False
        self._next += self._period
        if self._next <= time:  # the first call, or the loop was interrupted
            self._next = time + self._period
        return True


class RealtimePublisher:
    """Publisher for the control loop that never blocks. The function `publisher` creates one for a topic of a node.

    Args:
        publisher: publisher of the topic; with a thread it must also have a method `pack`, like `RosPublisher`.
        name: name of the topic, for log lines.
        limit: capacity of the queue; if it is full, the oldest message is dropped.
        report: function that logs a line of text about a failure; called in the publishing thread.
        thread: sending thread; None: messages are built and sent within `publish`, if there is a subscriber.
        latch: True if the publisher sends the last message to later subscribers.
    """

    __slots__ = ("_latch", "_outbox", "_publisher", "_thread")

    def __init__(
        self,
        publisher: Publisher,
        name: str = "",
        *,
        limit: int = LAGGING_LIMIT,
        report: Callable[[str], None] | None = None,
        thread: PublishThread | None = None,
        latch: bool = False,
    ) -> None:
        self._publisher, self._thread, self._latch = publisher, thread, latch
        self._outbox: Outbox | None = None
        if thread is not None:
            later = None if report is None else lambda text: thread.call(lambda: report(text))
            self._outbox = Outbox(publisher.pack, name, limit, later)  # type: ignore[attr-defined]  # see Args
            thread.add(self._outbox)

    def publish(self, build: Callable[..., Any], *args: Any) -> None:
        """Queue the message that `build(*args)` returns; it is sent later. Never blocks.

        `build` is called later, by the thread or between two cycles. So the arguments must be copies (lists of floats,
        the stamp), not objects that the loop goes on changing.
        """
        if self._outbox is not None:
            self._outbox.append(build, args)
        elif self.needed:
            self._publisher.publish(build(*args))

    @property
    def needed(self) -> bool:
        """True if `publish` would build a message: always with a thread, else if there is a subscriber or a latch."""
        return self._outbox is not None or self._latch or self._publisher.subscribers() > 0

    @property
    def dropped(self) -> int:
        """Number of messages dropped because the publishing thread was too slow."""
        return 0 if self._outbox is None else self._outbox.dropped

    def subscribers(self) -> int:
        """Return the current number of subscribers."""
        return self._publisher.subscribers()

    def unregister(self) -> None:
        """Send the queued messages, then stop advertising. It waits, so it must not be called in the control loop."""
        if self._thread is not None and self._outbox is not None:
            self._thread.drain(0.5)
            self._thread.remove(self._outbox)
        self._publisher.unregister()


_lock = threading.Lock()
_thread: PublishThread | None = None


def publisher(
    node: Node, topic: str, message_type: type, latch: bool = False, lossless: bool = False, newest_only: bool = False
) -> RealtimePublisher:
    """Advertise a topic and return a non-blocking publisher for the control loop.

    Args:
        node: node that advertises.
        topic: name, relative to the node.
        message_type: message class.
        latch: True if later subscribers get the last message.
        lossless: True if the queue has a capacity of LOSSLESS_LIMIT instead of LAGGING_LIMIT.
        newest_only: True if a new message silently replaces an unsent one, for topics such as /clock, of which only the
            newest message matters.
    """
    limit = LOSSLESS_LIMIT if lossless else 1 if newest_only else LAGGING_LIMIT
    name, thread = node.resolve(topic), None if node.publishes_inline else _the_thread()
    raw = node.advertise(topic, message_type, queue_size=0, latch=latch)
    made = RealtimePublisher(raw, name, limit=limit, report=node.log_error, thread=thread, latch=latch)
    if isinstance(node, ScopedNode):
        node.keep(made)
    return made


def defer(node: Node, call: Callable[[], None], what: str = "call") -> None:
    """Let the publishing thread call a function that could block the control loop, e.g. one that ends an action goal.

    Args:
        node: node that logs errors; if it is a LocalNode, the function is called at once.
        call: function without arguments; an error of it is logged.
        what: name of the call for the log.
    """
    if node.publishes_inline:
        call()
        return

    def run() -> None:
        try:
            call()
        except Exception as error:  # an error must not end the thread, which serves the whole process
            node.log_error(f"{what} failed: {type(error).__name__}: {error}")

    _the_thread().call(run)


def hand_over(timeout: float) -> bool:
    """Build and serialise the queued messages, and let the publishing thread write them; for loops that never sleep.

    Args:
        timeout: longest wait for the thread to finish the messages of the last call [s of wall time].

    Returns:
        False if the thread did not finish in time; then no message was taken from the queue.
    """
    return _thread.hand_over(timeout) if _thread is not None else True


def drain(timeout: float) -> bool:
    """Wait until everything published so far was sent; return False if `timeout` [s of wall time] passes first."""
    return _thread.drain(timeout) if _thread is not None else True


def shutdown(timeout: float = 1.0) -> None:
    """Send the queued messages and end the publishing thread; a later publisher starts a new one."""
    global _thread
    with _lock:
        thread, _thread = _thread, None
    if thread is not None:
        thread.drain(timeout)
        thread.stop()


def _the_thread() -> PublishThread:
    global _thread
    with _lock:
        if _thread is None:
            _thread = PublishThread()
        return _thread
