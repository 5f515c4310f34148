"""A bag that is kept in memory: what a run published, for whoever analyses it without leaving a file."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from rosbags.typesys.store import Typestore

from hric_bags.parts import typestore_of
from hric_core.robot_time.stamps import to_time


@dataclass(eq=False)
class Connection:
    """One topic.

    Attributes:
        id: within the bag.
        topic, msgtype: its name and its type, e.g. "hric_msgs/msg/ControlLog".
        definition, digest: of the type, as ROS has them.
        msgcount: messages so far.
    """

    id: int
    topic: str
    msgtype: str
    definition: str
    digest: str
    msgcount: int = 0


class MemoryBag:
    """Reads like a `PartsReader` of the bag that a run would have left, message for message.

    Attributes:
        bag: a name for messages about it.
        connections: topics that were announced or written.
    """

    bag = Path("the messages of this run")

    def __init__(self) -> None:
        self.connections: list[Connection] = []
        self._by_topic: dict[str, Connection] = {}
        self._messages: list[tuple[Connection, int, bytes]] = []

    def announce(self, topic: str, kind: Any) -> Connection:
        """The connection of a topic, made at first; kind: class of its messages."""
        if topic not in self._by_topic:
            package, name = kind._type.split("/")
            made = Connection(len(self.connections), topic, f"{package}/msg/{name}", kind._full_text, kind._md5sum)
            self._by_topic[topic] = made
            self.connections.append(made)
        return self._by_topic[topic]

    def write(self, topic: str, message: Any, time: float) -> int:
        """Take a message, in the order in which they come, at a robot time [s]; returns the time of a bag [ns]."""
        connection, data = self.announce(topic, type(message)), BytesIO()
        message.serialize(data)
        stamp = nanoseconds(time)
        connection.msgcount += 1
        self._messages.append((connection, stamp, data.getvalue()))
        return stamp

    @cached_property
    def typestore(self) -> Typestore:
        """What reads the messages; made when the first of them is read."""
        return typestore_of(frozenset((c.msgtype, c.definition, c.digest) for c in self.connections))

    def deserialize(self, raw: bytes, kind: str) -> Any:
        """A message as rosbags reads it."""
        return self.typestore.deserialize_ros1(raw, kind)

    def messages(self, connections: Collection[Any] = ()) -> Iterator[tuple[Connection, int, bytes]]:
        """(connection, time of recording [ns], serialised message), of some connections or of all."""
        chosen = set(map(id, connections or self.connections))
        return (item for item in self._messages if id(item[0]) in chosen)

    def chosen(
        self, chooses: Callable[[Connection], bool], progress: str = ""
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """The same of the connections that are chosen; progress: nobody waits for it."""
        selected = [connection for connection in self.connections if chooses(connection)]
        return self.messages(selected) if selected else iter(())

    @property
    def topics(self) -> dict[str, Connection]:
        """By name, with their message counts."""
        return {connection.topic: connection for connection in self.connections if connection.msgcount}

    @property
    def message_count(self) -> int:
        """Of all topics."""
        return len(self._messages)

    @property
    def start_time(self) -> int:
        """Of the first message [ns]; there must be one."""
        return self._messages[0][1]

    @property
    def end_time(self) -> int:
        """Of the last message [ns]; there must be one."""
        return self._messages[-1][1]

    @property
    def duration(self) -> int:
        """From the first to the last message [ns]."""
        return self._messages[-1][1] - self._messages[0][1] if self._messages else 0


def nanoseconds(time: float) -> int:
    """A robot time [s] as a bag has it [ns]."""
    return int(to_time(max(time, 0.0)).to_nsec())
