"""Topics of a running system for the window; messages are decoded only for somebody who looks at them.

With rospy, decoding a message and being woken for each cost more than all that the window does with them. So messages
are received as bytes, which a frame decodes, and a thread that receives rests after a message that it waited for: those
that arrive meanwhile are received together.
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
"""Rest of a thread that receives, after a message [s of wall time]: about the period of frames; project default."""
WAITED = 1e-3
"""Time without a message from which on a thread has waited for the next one [s of wall time]."""
STALE = 0.25
"""Age from which a message is no longer shown to the first viewer [s of wall time]; project default."""


class Feed:
    """Messages of one topic.

    Args:
        kind: type of the messages.
        refuse: called with the reason for which a message cannot be shown.
    """

    def __init__(self, kind: type, refuse: Callable[[str], object]) -> None:
        self._kind, self._refuse, self._received = kind, refuse, -REST
        self._waiting = deque[tuple[float, bytes]](maxlen=1)
        self._shown, self._kept = list[tuple[Callable[[Any], None], bool]](), list[Callable[[bytes], None]]()

    def show(self, receiver: Callable[[Any], None], depth: int, lasting: bool) -> None:
        """Add a receiver; see Feeds.show."""
        self._waiting = deque(self._waiting, max(depth, self._waiting.maxlen or 0))
        self._shown.append((receiver, lasting))

    def keep(self, receiver: Callable[[bytes], None]) -> None:
        """Add a receiver; see Feeds.keep."""
        self._kept.append(receiver)

    def receive(self, message: Any) -> None:
        """Store a message of the type `undecoded(kind)`, and rest."""
        now = time.monotonic()
        self._waiting.append((now, message.data))
        for receiver in self._kept:
            receiver(message.data)
        if now - self._received > WAITED:
            time.sleep(REST)
        self._received = time.monotonic()

    def deliver(self) -> None:
        """Decode the messages since the last call for the receivers that show them."""
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
    """Topics of the window.

    Args:
        root: node in the namespace of the robot.
    """

    def __init__(self, root: Node) -> None:
        self._root, self._feeds = root, dict[str, Feed]()

    def show(
        self, topic: str, kind: type, receiver: Callable[[Any], None], *, depth: int = 1, lasting: bool = False
    ) -> None:
        """Show a topic: `receiver(message)` is called by `deliver` with the newest messages since its last call.

        Args:
            topic: name of the topic.
            kind: type of its messages.
            receiver: receiver of the messages.
            depth: largest number of messages at once.
            lasting: True: a message holds until the next one, however old it is.
        """
        self._feed(topic, kind).show(receiver, depth, lasting)

    def keep(self, topic: str, kind: type, receiver: Callable[[bytes], None]) -> None:
        """Call `receiver(data)` with each message of a topic, serialised, as it arrives; kind: type of the messages."""
        self._feed(topic, kind).keep(receiver)

    def deliver(self) -> None:
        """Decode what is to be shown, and give it to its receivers, in this thread."""
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
    """Return the type by which messages of a type are received without being decoded; `data` has their bytes."""

    def begin(message: Any) -> None:
        message.data = b""

    def take(message: Any, data: bytes) -> Any:
        message.data = data
        return message

    return type(f"Undecoded{kind.__name__}", (kind,), {"__init__": begin, "deserialize": take})
