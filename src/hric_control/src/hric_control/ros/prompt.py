"""Topics of a rospy node send in the thread that publishes, as long as the network takes what is sent."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import rospy.topics
from rospy.exceptions import TransportTerminated

from hric_control.listeners import DISPATCHER, Listener, Parcel


def send_promptly() -> None:
    """Let all topics of this process send through a `PromptConnection` where they have a queue.

    rospy wakes a thread for each message to each listener, which costs several times what sending does; without a queue
    a listener that does not read holds up whoever publishes, for a minute.
    """
    rospy.topics.QueuedConnection = PromptConnection


def prompt_connections(topic: Any) -> Sequence["PromptConnection"]:
    """Return the connections of rospy's implementation of a topic.

    rospy sets the size of a topic's queue after the topic listens: who connects in between is left without a
    queue, and gets its connection here.
    """
    if not all(isinstance(connection, PromptConnection) for connection in topic.connections or ()):
        with topic.c_lock:
            topic.connections = [
                connection if isinstance(connection, PromptConnection) else PromptConnection(connection)
                for connection in topic.connections
            ]
    return topic.connections or ()  # none while rospy closes it


class PromptConnection(Listener):
    """A listener's connection in place of rospy's QueuedConnection: it never waits for the listener either.

    Args:
        connection: rospy's own.
        queue_size: of rospy's queue; what waits is bounded in bytes instead, see `listeners.LIMIT`.
    """

    def __init__(self, connection: Any, queue_size: int = 0) -> None:
        super().__init__(f"{connection.endpoint_id} on {connection.name}", connection.socket)
        self._connection = connection

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes | bytearray) -> bool:
        """Send, or keep for later. Raises TransportTerminated: the connection is closed."""
        DISPATCHER.send((Parcel((self,), bytes(data)),))
        if not self.open:
            raise TransportTerminated("connection closed")
        self._connection.stat_bytes += len(data)
        self._connection.stat_num_msg += 1
        return True

    def let_go(self) -> None:
        """Close rospy's connection."""
        with suppress(Exception):  # of any kind, where rospy closes the topic at the same time
            self._connection.close()
