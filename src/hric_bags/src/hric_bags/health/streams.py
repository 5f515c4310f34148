"""Message counts, stamps and running numbers of each topic of a bag, collected message by message."""

import re
import struct
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hric_bags.health.bag_records import BagConnection

IntArray = npt.NDArray[np.int64]
_HEADER = re.compile(r"^\s*(std_msgs/)?Header\s+header\b")
_STAMP = struct.Struct("<III")
SYNCED = "hric_msgs/SyncedSample"
"""Message type whose running number is the `seq` of its header, which ROS 2 does not have."""
COUNTED: dict[str, tuple[str, Callable[[Any], tuple[int, int]]]] = {
    "hric_msgs/ControlLog": ("cycles", lambda message: (int(message.first_cycle), int(message.n_cycles))),
    "hric_msgs/SampleChunk": (
        "samples",
        lambda message: (int(message.first_sample), len(message.data) // max(len(message.channels), 1)),
    ),
    "hric_msgs/MocapData": ("frames", lambda message: (int(message.frame_number), 1)),
    SYNCED: ("samples", lambda message: (int(message.header.seq), 1)),
}
"""Message type with a running number -> unit that it counts, function from message to (first number, how many)."""
PAUSING = {"gazebo_msgs/ContactsState", "hric_msgs/RegionContacts"}
"""Message types with a list after the header; while it is empty, the source publishes less often or not at all."""
_COUNT = struct.Struct("<I")
_WRAP = 1 << 32
"""Number of values of a 32-bit counter, which wraps to 0; gaps of 64-bit counters are below half of this."""


@dataclass
class TopicStream:
    """Times, publishers and running numbers of the messages of one topic.

    Attributes:
        topic, type_name: name and message type as in the bag.
        latched: True if a publisher latches the topic.
        recorded: recording times in the order of the file, shape (n,) [ns].
        stamps: header stamps, shape (n,) [ns]; None: the type has no header.
        publishers: names of the publishing nodes in the order of their first messages; "": not in the bag.
        published_by: publisher of each message as an index into `publishers`, shape (n,).
        idle: True for each message after which the source may pause (`PAUSING`), shape (n,).
        counts: unit of the running number, e.g. "samples"; "": messages have none.
        missing: running numbers that are not in the bag, as (first, how many).
        repeated: running numbers at which the count went back, by repeats or a restarted source, as (first, how many).
        first, next: first running number, and the one that would follow the last message; 0: messages have none.
    """

    topic: str
    type_name: str
    latched: bool
    recorded: IntArray
    stamps: IntArray | None
    publishers: tuple[str, ...]
    published_by: IntArray
    idle: npt.NDArray[np.bool_]
    counts: str = ""
    missing: tuple[tuple[int, int], ...] = ()
    repeated: tuple[tuple[int, int], ...] = ()
    first: int = 0
    next: int = 0

    @property
    def judged(self) -> IntArray | None:
        """Header stamps that are checked for order and gaps, shape (n,) [ns]; None: latched topic, or no header."""
        return None if self.latched else self.stamps

    @property
    def period(self) -> float:
        """Median time between header stamps or, without header, recordings [s]; NaN: fewer than two messages."""
        times = np.sort(self.recorded if self.stamps is None else self.stamps)
        return float(np.median(np.diff(times))) * 1e-9 if len(times) > 1 else float("nan")

    @property
    def rate(self) -> float:
        """Messages per second over the whole stream [Hz]; NaN: fewer than two, or all at one time."""
        times = self.recorded if self.stamps is None else self.stamps
        span = float(np.ptp(times)) * 1e-9 if len(times) > 1 else 0.0
        return (len(times) - 1) / span if span else float("nan")


@dataclass
class _Gathered:
    connection: BagConnection
    recorded: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    numbers: list[tuple[int, int]] = field(default_factory=list)
    publishers: dict[str, int] = field(default_factory=dict)
    published_by: list[int] = field(default_factory=list)
    idle: list[bool] = field(default_factory=list)

    def stream(self) -> TopicStream:
        connection, numbers = self.connection, self.numbers
        missing, repeated = _continuity(numbers)
        return TopicStream(
            connection.topic,
            connection.type_name,
            connection.latching,
            np.array(self.recorded, dtype=np.int64),
            np.array(self.stamps, dtype=np.int64) if len(self.stamps) == len(self.recorded) else None,
            tuple(self.publishers),
            np.array(self.published_by, dtype=np.int64),
            np.array(self.idle, dtype=np.bool_),
            counts=COUNTED[connection.type_name][0] if connection.type_name in COUNTED else "",
            missing=missing,
            repeated=repeated,
            first=numbers[0][0] if numbers else 0,
            next=sum(numbers[-1]) if numbers else 0,
        )


class StreamGatherer:
    """Collector that makes a stream per topic from serialised messages; uncounted: types without running number."""

    def __init__(self, uncounted: Collection[str] = ()) -> None:
        self._uncounted = uncounted
        self._topics: dict[str, _Gathered] = {}
        self._readers: dict[str, Callable[[bytes], tuple[int, int]]] = {}

    def add(self, connection: BagConnection, time: int, raw: bytes) -> None:
        """Add a serialised message; time: recording time [ns]."""
        gathered = self._topics.get(connection.topic)
        if gathered is None:
            gathered = self._topics[connection.topic] = _Gathered(connection)
        gathered.recorded.append(time)
        gathered.published_by.append(gathered.publishers.setdefault(connection.caller, len(gathered.publishers)))
        gathered.idle.append(connection.type_name in PAUSING and _has_empty_list(raw))
        if _has_header(connection) and len(raw) >= _STAMP.size:
            _, seconds, nanoseconds = _STAMP.unpack_from(raw)
            gathered.stamps.append(seconds * 1_000_000_000 + nanoseconds)
        if connection.type_name in COUNTED and connection.type_name not in self._uncounted:
            gathered.numbers.append(self._reader(connection)(raw))

    def _reader(self, connection: BagConnection) -> Callable[[bytes], tuple[int, int]]:
        reader = self._readers.get(connection.md5sum)
        if reader is None:
            store = get_typestore(Stores.EMPTY)
            name = connection.type_name.replace("/", "/msg/")
            store.register(get_types_from_msg(connection.definition, name))
            numbers = COUNTED[connection.type_name][1]

            def read(raw: bytes) -> tuple[int, int]:
                return numbers(store.deserialize_ros1(raw, name))

            reader = self._readers[connection.md5sum] = read
        return reader

    def streams(self) -> list[TopicStream]:
        """Return all topics, sorted by name."""
        return [self._topics[topic].stream() for topic in sorted(self._topics)]


def _has_header(connection: BagConnection) -> bool:
    lines = (line for line in connection.definition.splitlines() if line.strip() and not line.lstrip().startswith("#"))
    return _HEADER.match(next(lines, "")) is not None


def _has_empty_list(raw: bytes) -> bool:
    """Return True if the list after the header of a serialised message is empty."""
    start = _STAMP.size + _COUNT.size  # of the header's last field, frame_id
    start += _COUNT.unpack_from(raw, _STAMP.size)[0] if len(raw) >= start else 0
    return len(raw) >= start + _COUNT.size and _COUNT.unpack_from(raw, start) == (0,)


def _continuity(numbers: list[tuple[int, int]]) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    missing, repeated = [], []
    expected = numbers[0][0] if numbers else 0
    for first, count in numbers:
        step = (first - expected + _WRAP // 2) % _WRAP - _WRAP // 2
        if step > 0:
            missing.append((expected, step))
        elif step < 0:
            repeated.append((first, -step))
        expected = first + count
    return tuple(missing), tuple(repeated)
