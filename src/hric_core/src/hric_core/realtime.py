"""Between callbacks and the control loop, without the loop ever waiting: newest values in, messages out.

In: `LatestValue`. Out: `publisher(...)` gives a `RealtimePublisher`; the loop hands it a function that builds the
message and its arguments, and the process's one `PublishThread` builds and sends it while the loop sleeps; a loop that
never sleeps calls `hand_over` now and then. `defer(...)` has any other call on ROS made by the thread (the result of an
action, a log line).
On a LocalNode all this happens within the call, so that a headless run is deterministic.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from hric_core.node import Node, Publisher
from hric_core.publishing import Outbox, PublishThread
from hric_core.scoped_node import ScopedNode

T = TypeVar("T")

LAGGING_LIMIT = 100
"""Messages of one topic that may wait when it is not lossless, a second's worth of most topics; beyond it the newest
win."""
LOSSLESS_LIMIT = 100_000
"""Messages that may wait on a lossless topic: half an hour of a 50 Hz log behind a subscriber that hangs. Beyond it the
oldest are dropped."""


class LatestValue(Generic[T]):
    """The newest value from callbacks, for one reader in the loop. No locks: a deque's append and popleft are
    atomic."""

    __slots__ = ("_new", "_value")

    def __init__(self, initial: T) -> None:
        self._value = initial
        self._new: deque[T] = deque(maxlen=1)

    def set(self, value: T) -> None:
        """Replace the value; from any thread."""
        self._value = value
        self._new.append(value)

    def get(self) -> T:
        """The newest value, or the initial one."""
        return self._value

    def take_new(self) -> T | None:
        """The newest value if it was set since the last call, else None. For one reader."""
        return self._new.popleft() if self._new else None


class RealtimePublisher:
    """Publishes from the loop without blocking it. `publisher` below makes one for a topic of a node.

    Args:
        publisher: of the topic; for a thread it also has `pack`, as `ros.node.RosPublisher`.
        name: topic, for messages.
        limit: how many may wait; the oldest give way.
        report: takes one line of text when something fails; from the publishing thread.
        thread: who sends; None builds and sends within `publish`, where anybody listens.
        latch: the publisher keeps the last message for those who listen later.
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
        """Have `build(*args)` called and its message sent. Never blocks.

        It is called later, by the thread or between two cycles: it must get plain snapshots (lists of floats, the
        stamp), not live storage.
        """
        if self._outbox is not None:
            self._outbox.append(build, args)
        elif self.needed:
            self._publisher.publish(build(*args))

    @property
    def needed(self) -> bool:
        """Whether a message would be built: always where a thread does it, else where somebody listens now, or later to
        a latched topic."""
        return self._outbox is not None or self._latch or self._publisher.subscribers() > 0

    @property
    def dropped(self) -> int:
        """Messages dropped because the thread lagged."""
        return 0 if self._outbox is None else self._outbox.dropped

    def subscribers(self) -> int:
        """Number of listeners now."""
        return self._publisher.subscribers()

    def unregister(self) -> None:
        """Send what waits, then stop advertising. Outside the loop."""
        if self._thread is not None and self._outbox is not None:
            self._thread.drain(0.5)
            self._thread.remove(self._outbox)
        self._publisher.unregister()


_lock = threading.Lock()
_thread: PublishThread | None = None


def publisher(
    node: Node, topic: str, message_type: type, latch: bool = False, lossless: bool = False, newest_only: bool = False
) -> RealtimePublisher:
    """A publisher for the loop.

    Args:
        node: where to advertise.
        topic: name, relative to the node.
        message_type: message class.
        latch: give the last message to subscribers that come later.
        lossless: keep all messages when the thread lags (otherwise the newest ones).
        newest_only: a message that was not sent yet gives way to the next, without a word: for what only matters now,
            as /clock.
    """
    limit = LOSSLESS_LIMIT if lossless else 1 if newest_only else LAGGING_LIMIT
    name, thread = node.resolve(topic), None if node.publishes_inline else _the_thread()
    raw = node.advertise(topic, message_type, queue_size=0, latch=latch)
    made = RealtimePublisher(raw, name, limit=limit, report=node.log_error, thread=thread, latch=latch)
    if isinstance(node, ScopedNode):
        node.keep(made)
    return made


def defer(node: Node, call: Callable[[], None], what: str = "call") -> None:
    """Have `call()` done by the publishing thread: for what the loop may not do itself, e.g. finishing an action goal
    or logging.

    Args:
        node: whose; on a LocalNode the call is done at once.
        call: no arguments; an error is logged with `what`.
    """
    if node.publishes_inline:
        call()
        return

    def run() -> None:
        try:
            call()
        except Exception as error:  # the thread serves the whole process
            node.log_error(f"{what} failed: {type(error).__name__}: {error}")

    _the_thread().call(run)


def hand_over(timeout: float) -> bool:
    """Build and serialise what was published, and have it written while the loop goes on; for loops that never sleep,
    now and then.

    Args:
        timeout: longest wait for what was handed over before [s of wall time].

    Returns:
        False when that took longer; nothing was done then. While the same message hangs, further calls return False
        without waiting, so that nothing hangs with it.
    """
    return _thread.hand_over(timeout) if _thread is not None else True


def drain(timeout: float) -> bool:
    """Wait until everything published so far was sent; arguments and result as of `hand_over`."""
    return _thread.drain(timeout) if _thread is not None else True


def shutdown(timeout: float = 1.0) -> None:
    """Send what waits, end the thread; a later publisher starts a new one."""
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
