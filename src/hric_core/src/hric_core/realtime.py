"""Data exchange between callbacks and the control loop, which never waits.

In: `LatestValue`. Out: `publisher(...)` returns a `RealtimePublisher`; the loop passes it a function that builds the
message and its arguments, and the process's `PublishThread` builds and sends it while the loop sleeps; a loop that
never sleeps calls `hand_over` periodically. `defer(...)` lets the thread make any other call to ROS (the result of an
action, a log line). A `Throttle` holds messages to a rate of robot time.

On a LocalNode all this happens within the call, so that a headless run is deterministic.
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
"""Number of messages that may wait on a topic that is not lossless; beyond it the oldest are dropped.

It is a second's worth of most topics."""
LOSSLESS_LIMIT = 100_000
"""Number of messages that may wait on a lossless topic; beyond it the oldest are dropped.

It is half an hour of a 50 Hz log behind a subscriber that hangs."""


class LatestValue(Generic[T]):
    """Newest value from callbacks, for one reader in the loop. No locks: a deque's append and popleft are atomic."""

    __slots__ = ("_new", "_value")

    def __init__(self, initial: T) -> None:
        self._value = initial
        self._new: deque[T] = deque(maxlen=1)

    def set(self, value: T) -> None:
        """Replace the value. May be called from any thread."""
        self._value = value
        self._new.append(value)

    def get(self) -> T:
        """Return the newest value, or the initial one."""
        return self._value

    def take_new(self) -> T | None:
        """Return the newest value if it was set since the last call, else None. For one reader."""
        return self._new.popleft() if self._new else None


class Throttle:
    """Throttle to a fixed rate of robot time, without drift.

    Args:
        rate: [Hz]; 0 means never.
    """

    __slots__ = ("_next", "_period")

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate if rate > 0.0 else math.inf
        self._next = -math.inf if rate > 0.0 else math.inf

    def restart(self) -> None:
        """Make the next call due."""
        if self._period < math.inf:
            self._next = -math.inf

    def due(self, time: float) -> bool:
        """Return True if a period has passed; `time`: robot time [s]."""
        if time < self._next - 1e-9:
            return False
        self._next += self._period
        if self._next <= time:  # the first call, or the loop was interrupted
            self._next = time + self._period
        return True


class RealtimePublisher:
    """Publisher for the loop that never blocks it. `publisher` below creates one for a topic of a node.

    Args:
        publisher: publisher of the topic; for a thread it also has `pack`, as `ros.node.RosPublisher`.
        name: topic, for messages.
        limit: number of messages that may wait; beyond it the oldest are dropped.
        report: takes one line of text when something fails; from the publishing thread.
        thread: sending thread; None builds and sends within `publish`, if there is a subscriber.
        latch: the publisher sends the last message to later subscribers.
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
            self._outbox = Outbox(publisher.pack, name, limit, later)  # type: ignore[attr-defined]  # said above
            thread.add(self._outbox)

    def publish(self, build: Callable[..., Any], *args: Any) -> None:
        """Queue `build(*args)`, whose message is sent later. Never blocks.

        It is called later, by the thread or between two cycles: it must get plain snapshots (lists of floats, the
        stamp), not live storage.
        """
        if self._outbox is not None:
            self._outbox.append(build, args)
        elif self.needed:
            self._publisher.publish(build(*args))

    @property
    def needed(self) -> bool:
        """True if a message would be built: always with a thread, else with a subscriber or a latched topic."""
        return self._outbox is not None or self._latch or self._publisher.subscribers() > 0

    @property
    def dropped(self) -> int:
        """Number of messages dropped because the thread lagged."""
        return 0 if self._outbox is None else self._outbox.dropped

    def subscribers(self) -> int:
        """Return the current number of subscribers."""
        return self._publisher.subscribers()

    def unregister(self) -> None:
        """Send the waiting messages, then stop advertising. Outside the loop."""
        if self._thread is not None and self._outbox is not None:
            self._thread.drain(0.5)
            self._thread.remove(self._outbox)
        self._publisher.unregister()


_lock = threading.Lock()
_thread: PublishThread | None = None


def publisher(
    node: Node, topic: str, message_type: type, latch: bool = False, lossless: bool = False, newest_only: bool = False
) -> RealtimePublisher:
    """Return a publisher for the loop.

    Args:
        node: node that advertises.
        topic: name, relative to the node.
        message_type: message class.
        latch: send the last message to later subscribers.
        lossless: queue all messages when the thread lags (otherwise the newest ones).
        newest_only: silently replace an unsent message by the next one: for topics that only matter now, such as
            /clock.
    """
    limit = LOSSLESS_LIMIT if lossless else 1 if newest_only else LAGGING_LIMIT
    name, thread = node.resolve(topic), None if node.publishes_inline else _the_thread()
    raw = node.advertise(topic, message_type, queue_size=0, latch=latch)
    made = RealtimePublisher(raw, name, limit=limit, report=node.log_error, thread=thread, latch=latch)
    if isinstance(node, ScopedNode):
        node.keep(made)
    return made


def defer(node: Node, call: Callable[[], None], what: str = "call") -> None:
    """Let the publishing thread make a call that the loop may not, e.g. finishing an action goal or logging.

    Args:
        node: node of the call; on a LocalNode the call is made at once.
        call: no arguments; an error is logged with `what`.
        what: name of the call for the log.
    """
    if node.publishes_inline:
        call()
        return

    def run() -> None:
        try:
            call()
        except Exception as error:  # must not end the thread, which serves the process
            node.log_error(f"{what} failed: {type(error).__name__}: {error}")

    _the_thread().call(run)


def hand_over(timeout: float) -> bool:
    """Build and serialise the published messages, and let the thread write them; for loops that never sleep.

    Args:
        timeout: longest wait for the last hand-over [s of wall time].

    Returns:
        False when that took longer; nothing was done then. While the same message hangs, further calls return False
            without waiting.
    """
    return _thread.hand_over(timeout) if _thread is not None else True


def drain(timeout: float) -> bool:
    """Wait until everything published so far was sent; arguments and result as in `hand_over`."""
    return _thread.drain(timeout) if _thread is not None else True


def shutdown(timeout: float = 1.0) -> None:
    """Send the waiting messages and end the thread; a later publisher starts a new one."""
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
