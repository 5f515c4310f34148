"""Topics of a rospy node that send in the publishing thread, as long as the network takes the data."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import rospy.topics
from rospy.exceptions import TransportTerminated

from hric_core.listeners import DISPATCHER, Listener, Parcel


def send_promptly() -> None:
    """Let all topics of this process with a queue send through a `PromptConnection`.

    rospy wakes a thread for each message to each listener, which costs several times the sending; without a queue a
    listener that does not read blocks the publisher, for a minute.
    """
    rospy.topics.QueuedConnection = PromptConnection


def prompt_connections(topic: Any) -> Sequence["PromptConnection"]:
    """Return the connections of rospy's implementation of a topic.

    rospy sets the queue size of a topic after the topic has begun to listen: a subscriber that connects in between has
    no queue, and gets its connection here.
    """
    if not all(isinstance(connection, PromptConnection) for connection in topic.connections or ()):
        with topic.c_lock:
            topic.connections = [
                connection if isinstance(connection, PromptConnection) else PromptConnection(connection)
                for connection in topic.connections
            ]
    return topic.connections or ()  # none while rospy closes it


class PromptConnection(Listener):
    """Connection of a listener that replaces rospy's QueuedConnection; it never waits for the listener either.

    Args:
        connection: connection of rospy.
        queue_size: size of rospy's queue; waiting data is bounded in bytes instead, see `listeners.LIMIT`.
    """

    def __init__(self, connection: Any, queue_size: int = 0) -> None:
        super().__init__(f"{connection.endpoint_id} on {connection.name}", connection.socket)
        self._connection = connection

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes | bytearray) -> bool:
        """Send or queue data. Raises TransportTerminated: the connection is closed."""
        DISPATCHER.send((Parcel((self,), bytes(data)),))
        if not self.open:
            raise TransportTerminated("connection closed")
        self._connection.stat_bytes += len(data)
        self._connection.stat_num_msg += 1
        return True

    def let_go(self) -> None:
        """Close rospy's connection."""
        with suppress(Exception):  # any error, if rospy closes the topic at the same time
            self._connection.close()
