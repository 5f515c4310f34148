"""Subscriptions of the window to topics of a running system, which decode only the messages that are drawn.

In rospy, decoding each message and waking a thread for it cost more than everything else that the window does. So
messages are received as bytes and decoded once per frame, and the receiving thread of a topic sleeps after a message,
so that the messages of this time are received together.
"""

import time
from collections import deque
from collections.abc import Callable
from functools import cache
from typing import Any

import genpy

from hric_core.errors import HricError
from hric_core.node import LogThrottle, Node

REST = 0.03
"""Time for which a receiving thread sleeps after a message [s of wall time]: about the period of frames; project
default."""
WAITED = 1e-3
"""Time between two messages above which the receiving thread sleeps after the second [s of wall time]; project
default."""
STALE = 0.25
"""Age above which a received message is no longer shown [s of wall time], unless it is lasting; project default."""


class Feed:
    """Newest messages of one topic, and their receivers.

    Args:
        kind: class of the messages.
        refuse: callback that gets the reason why a message cannot be decoded or shown.
    """

    def __init__(self, kind: type, refuse: Callable[[str], object]) -> None:
        self._kind, self._refuse, self._received = kind, refuse, -REST
        self._waiting = deque[tuple[float, bytes]](maxlen=1)
        self._shown, self._kept = list[tuple[Callable[[Any], None], bool]](), list[Callable[[bytes], None]]()

    def show(self, receiver: Callable[[Any], None], depth: int, lasting: bool) -> None:
        """Add a receiver of decoded messages, for which the last `depth` messages are stored; see Feeds.show."""
        self._waiting = deque(self._waiting, max(depth, self._waiting.maxlen or 0))
        self._shown.append((receiver, lasting))

    def keep(self, receiver: Callable[[bytes], None]) -> None:
        """Add a receiver of each message as bytes; see Feeds.keep."""
        self._kept.append(receiver)

    def receive(self, message: Any) -> None:
        """Store a message of the class `undecoded(kind)`, then sleep for REST; called by rospy."""
        now = time.monotonic()
        self._waiting.append((now, message.data))
        for receiver in self._kept:
            receiver(message.data)
        if now - self._received > WAITED:
            time.sleep(REST)
        self._received = time.monotonic()

    def deliver(self) -> None:
        """Decode the stored messages, pass them to the receivers of decoded messages, and delete them."""
        while self._waiting:
            received, data = self._waiting.popleft()
            stale = time.monotonic() - received > STALE
            try:
                message = self._kind().deserialize(data)
                for receiver, lasting in self._shown:
                    if lasting or not stale:
                        receiver(message)
            except (HricError, ValueError, genpy.DeserializationError) as error:
                self._refuse(str(error))  # a strange message must not end the frames


class Feeds:
    """Subscriptions of the window, one for each topic.

    Args:
        root: node in the namespace of the robot.
    """

    def __init__(self, root: Node) -> None:
        self._root, self._feeds = root, dict[str, Feed]()

    def show(
        self, topic: str, kind: type, receiver: Callable[[Any], None], *, depth: int = 1, lasting: bool = False
    ) -> None:
        """Subscribe to a topic whose messages are drawn: `deliver` calls `receiver(message)` with the newest ones.

        Args:
            topic: name of the topic.
            kind: class of its messages.
            receiver: callback for decoded messages.
            depth: largest number of messages for one call of `deliver`.
            lasting: True: a message is valid until the next one; False: messages older than STALE are not passed on.
        """
        self._feed(topic, kind).show(receiver, depth, lasting)

    def keep(self, topic: str, kind: type, receiver: Callable[[bytes], None]) -> None:
        """Subscribe to a topic of which every message is needed: `receiver(data)` is called with its bytes on arrival.

        Args:
            topic: name of the topic.
            kind: class of its messages.
            receiver: callback for serialised messages.
        """
        self._feed(topic, kind).keep(receiver)

    def deliver(self) -> None:
        """Decode the stored messages of all topics and pass them to the receivers of `show`, in the calling thread."""
        for feed in list(self._feeds.values()):
            feed.deliver()

    def _feed(self, topic: str, kind: type) -> Feed:
        full = self._root.resolve(topic)
        if full not in self._feeds:
            refused = LogThrottle(self._root.log_error, time.monotonic)
            self._feeds[full] = feed = Feed(kind, lambda reason: refused(f"{full} is not shown: {reason}"))
            self._root.subscribe(topic, undecoded(kind), feed.receive, queue_size=0)
        return self._feeds[full]


@cache
def undecoded(kind: type) -> type:
    """Return the message class that receives messages of class `kind` without decoding; `data` has their bytes."""

    def begin(message: Any) -> None:
        message.data = b""

    def take(message: Any, data: bytes) -> Any:
        message.data = data
        return message

    return type(f"Undecoded{kind.__name__}", (kind,), {"__init__": begin, "deserialize": take})
