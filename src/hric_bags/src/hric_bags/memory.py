"""Bag in memory: messages that a run published, for analyses without a file."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rosbags.typesys.store import Typestore

from hric_bags.parts import typestore_of
from hric_core.message_bytes import message_bytes

FIRST = 1
"""Smallest recording time of a bag [ns]; ROS does not load messages that were recorded at time 0."""


@dataclass(eq=False)
class MemoryConnection:
    """Topic of a bag in memory.

    Attributes:
        id: number of the topic within the bag.
        topic, msgtype: name and type of the topic, e.g. "hric_msgs/msg/ControlLog".
        definition, digest: definition and MD5 sum of the type, as in ROS.
        msgcount: number of messages so far.
    """

    id: int
    topic: str
    msgtype: str
    definition: str
    digest: str
    msgcount: int = 0


class MemoryBag:
    """Bag in memory with the interface of `PartsReader` and the same messages as a recorded bag of the run.

    Attributes:
        bag: name of this bag in error messages.
        connections: topics that were announced or written.
    """

    bag = Path("the messages of this run")

    def __init__(self) -> None:
        self.connections: list[MemoryConnection] = []
        self._by_topic: dict[str, MemoryConnection] = {}
        self._messages: list[tuple[MemoryConnection, int, bytes]] = []

    def announce(self, topic: str, kind: Any) -> MemoryConnection:
        """Return the connection of a topic, which the first call creates; kind: class of its messages."""
        if topic not in self._by_topic:
            package, name = kind._type.split("/")
            made = MemoryConnection(
                len(self.connections), topic, f"{package}/msg/{name}", kind._full_text, kind._md5sum
            )
            self._by_topic[topic] = made
            self.connections.append(made)
        return self._by_topic[topic]

    def write(self, topic: str, message: Any, time: float) -> int:
        """Store a message at a robot time [s], in the order of arrival; return its recording time [ns]."""
        connection, stamp = self.announce(topic, type(message)), nanoseconds(time)
        connection.msgcount += 1
        self._messages.append((connection, stamp, message_bytes(message)))
        return stamp

    @cached_property
    def typestore(self) -> Typestore:
        """Definitions of the message types, made when the first message is read."""
        return typestore_of(frozenset((c.msgtype, c.definition, c.digest) for c in self.connections))

    def deserialize(self, raw: bytes, kind: str) -> Any:
        """Return a deserialised message, as rosbags reads it from a file."""
        return self.typestore.deserialize_ros1(raw, kind)

    def messages(self, connections: Collection[Any] = ()) -> Iterator[tuple[MemoryConnection, int, bytes]]:
        """Iterate over (connection, recording time [ns], serialised message) of some or all connections."""
        chosen = set(map(id, connections or self.connections))
        return (item for item in self._messages if id(item[0]) in chosen)

    def chosen(
        self, chooses: Callable[[MemoryConnection], bool], progress: str = ""
    ) -> Iterator[tuple[MemoryConnection, int, bytes]]:
        """Iterate over the messages of the connections that `chooses` accepts; progress: ignored."""
        selected = [connection for connection in self.connections if chooses(connection)]
        return self.messages(selected) if selected else iter(())

    @property
    def topics(self) -> dict[str, MemoryConnection]:
        """Topics by name, with their message counts."""
        return {connection.topic: connection for connection in self.connections if connection.msgcount}

    @property
    def message_count(self) -> int:
        """Number of messages on all topics."""
        return len(self._messages)

    @property
    def start_time(self) -> int:
        """Recording time of the first message [ns]; there must be one."""
        return self._messages[0][1]

    @property
    def end_time(self) -> int:
        """Recording time of the last message [ns]; there must be one."""
        return self._messages[-1][1]

    @property
    def duration(self) -> int:
        """Time from the first to the last message [ns]."""
        return self._messages[-1][1] - self._messages[0][1] if self._messages else 0


def nanoseconds(time: float) -> int:
    """Return a robot time [s] as recording time of a bag [ns], at least FIRST."""
    return max(round(time * 1_000_000_000), FIRST)  # as `to_time` rounds
