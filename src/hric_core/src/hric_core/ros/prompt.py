"""Replacement of rospy's queued connections: messages are sent in the publishing thread, without blocking it."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import rospy.topics
from rospy.exceptions import TransportTerminated

from hric_core.listeners import DISPATCHER, Listener, Parcel


def send_promptly() -> None:
    """Let all rospy topics of this process that have a queue send through a `PromptConnection`.

    With a queue, rospy wakes a thread for each message to each subscriber, which takes several times as long as the
    sending; without a queue, a subscriber that does not read blocks the publisher, for a minute.
    """
    rospy.topics.QueuedConnection = PromptConnection


def prompt_connections(topic: Any) -> Sequence["PromptConnection"]:
    """Return the connections to the subscribers of a topic; `topic`: rospy's implementation object.

    rospy sets the queue size of a topic only after the topic accepts connections. A subscriber that connects in between
    has no queue; its connection is replaced by a `PromptConnection` here.
    """
    if not all(isinstance(connection, PromptConnection) for connection in topic.connections or ()):
        with topic.c_lock:
            topic.connections = [
                connection if isinstance(connection, PromptConnection) else PromptConnection(connection)
                for connection in topic.connections
            ]
    return topic.connections or ()  # None while rospy closes the topic


class PromptConnection(Listener):
    """Connection to a subscriber that replaces rospy's QueuedConnection; like that, it never waits for the subscriber.

    Args:
        connection: rospy's connection.
        queue_size: not used: queued data is limited in bytes instead, see `listeners.LIMIT`.
    """

    def __init__(self, connection: Any, queue_size: int = 0) -> None:
        super().__init__(f"{connection.endpoint_id} on {connection.name}", connection.socket)
        self._connection = connection

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes | bytearray) -> bool:
        """Send data, and queue what cannot be sent at once. Raises TransportTerminated if the connection is closed."""
        DISPATCHER.send((Parcel((self,), bytes(data)),))
        if not self.open:
            raise TransportTerminated(
                "the connection is closed; this subscriber gets no messages until it connects again"
            )
        self._connection.stat_bytes += len(data)
        self._connection.stat_num_msg += 1
        return True

    def let_go(self) -> None:
        """Close rospy's connection."""
        with suppress(Exception):  # any error, if rospy closes the topic at the same time
            self._connection.close()
