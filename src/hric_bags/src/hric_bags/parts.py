"""Reader of a bag that the recorder split into several files (parts): messages in order of time, each once."""

import re
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Protocol

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag1.reader import ReaderError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from tqdm import tqdm

from hric_bags import foreign
from hric_bags.indexed import BagError, IndexedReader, damaged
from hric_bags.ros2 import Ros2Reader
from hric_core.errors import HricError

MARGIN = 2_000_000_000
"""Largest difference between the times at which two recorders store the same message [ns]."""
_NUMBERED = re.compile(r"(.+)_(\d+)\.bag")
Stream = tuple[str, str]
"""Messages of one node on one topic: topic, and name of the publishing node."""
Messages = dict[Stream, list[tuple[int, bytes]]]
"""Stream -> its messages in order, as (recording time [ns], serialised message)."""


class Bag(Protocol):
    """Interface of a bag for analyses, read from files (`PartsReader`) or from memory (`hric_bags.memory`)."""

    bag: Path
    connections: list[Any]

    @property
    def topics(self) -> Any:
        """Topics by name, each with `msgcount`."""

    @property
    def message_count(self) -> int:
        """Number of messages on all topics."""

    @property
    def start_time(self) -> int:
        """Recording time of the first message [ns]."""

    @property
    def end_time(self) -> int:
        """Recording time of the last message [ns]."""

    @property
    def duration(self) -> int:
        """Time from the first to the last message [ns]."""

    def deserialize(self, raw: bytes, kind: str) -> Any:
        """Return a deserialised message."""

    def messages(self, connections: Collection[Any] = ()) -> Iterator[tuple[Any, int, bytes]]:
        """Iterate over (connection, recording time [ns], serialised message) of some or all connections."""

    def chosen(self, chooses: Callable[[Any], bool], progress: str = "") -> Iterator[tuple[Any, int, bytes]]:
        """Iterate over the messages of the connections that `chooses` accepts."""


class PartsError(HricError):
    """Error for a part of a bag that is missing or was not closed."""


def parts(bag: Path) -> list[Path]:
    """Return the files of a bag in order: its parts, or the bag alone if it was not split.

    Args:
        bag: path of the bag, or of its first part, `..._0.bag`.

    Raises:
        PartsError: a part between two others is missing, or a part was not closed.
    """
    match = _NUMBERED.fullmatch(bag.name)
    if match is not None and match[2] != "0":
        return [bag]
    stem = match[1] if match is not None else bag.stem
    names = [path.name.removesuffix(".active") for path in bag.parent.glob(f"{stem}_*.bag*")]
    numbers = [int(numbered[2]) for name in names if (numbered := _NUMBERED.fullmatch(name)) and numbered[1] == stem]
    paths = [bag]
    for number in range(1, max(numbers, default=0) + 1):
        part = bag.with_name(f"{stem}_{number}.bag")
        if not part.is_file():
            active = part.with_name(part.name + ".active")
            hint = f" was not closed, try: hric health --salvage {active}" if active.is_file() else " is missing"
            raise PartsError(f"part {part.name} of the recording in {bag.parent}{hint}")
        paths.append(part)
    return paths


@lru_cache(maxsize=64)
def typestore_of(definitions: frozenset[tuple[str, str, str]]) -> Typestore:
    """Return the typestore of some message types, given as (type, definition, checksum).

    The result is cached: it takes longer than reading most messages of a bag, and a process reads many similar bags.
    """
    types: dict[str, object] = {}
    for kind, text, _ in sorted(definitions):
        types.update(get_types_from_msg(text, kind))
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    for message in store.types.values():
        message.__getattr__ = _missing  # called for fields that the definition lacks
    for kind, _, checksum in definitions:
        if (actual := store.generate_msgdef(kind)[1]) != checksum:
            raise BagError(f"the definition of {kind} has checksum {actual}, but its messages have {checksum}")
    return store


class MissingFieldError(BagError, AttributeError):
    """Error for a message whose definition in the bag lacks a field that is read."""


def _missing(message: Any, name: str) -> Any:
    raise MissingFieldError(f"the definition of {type(message).__msgtype__} in the bag has no field {name!r}")


class PartsReader(AnyReader):
    """Reader of a bag with all its parts, with the interface of `AnyReader`.

    Two parts overlap, because both recorders ran for a moment and latched messages were sent again to the second one.
    These repetitions are left out of the later part.

    Args:
        bag: path of the bag, or of its first part; or path of a bag of ROS 2, a folder or file.

    Attributes:
        bag: path of the bag, as passed in.

    Raises:
        PartsError, BagError, OSError: the bag cannot be read.
    """

    def __init__(self, bag: Path) -> None:
        self.bag = bag
        ros2 = foreign.is_ros2(bag)
        paths = [bag] if ros2 else parts(bag)
        if not ros2 and (kind := next(filter(None, map(foreign.describe, paths)), "")):
            raise BagError(kind)
        try:
            super().__init__(paths)
        except AnyReaderError as error:  # the file name has no bag extension
            raise damaged(bag, error) from error
        self.readers: list[Any] = [Ros2Reader(bag)] if ros2 else [IndexedReader(path) for path in paths]
        self._repeated: list[dict[Stream, int]] | None = None
        self._typestores: dict[str, Typestore] = {}

    def _open(self) -> None:
        assert self.stack is not None
        for reader in self.readers:
            self.stack.enter_context(reader)
        self.connections = [connection for reader in self.readers for connection in reader.connections]
        del self.typestore  # removes the empty typestore of AnyReader

    @cached_property
    def typestore(self) -> Typestore:
        """Definitions of all message types."""
        return self._typestore_of(self.connections)

    def _typestore_of(self, connections: Sequence[Connection]) -> Typestore:
        try:
            return typestore_of(frozenset((c.msgtype, c.msgdef.data, c.digest) for c in connections))
        except (TypesysError, BagError) as error:
            raise damaged(self.bag, error) from error

    def deserialize(self, rawdata: bytes, typ: str) -> Any:
        """Return a deserialised message. Raises BagError if the message or the definition of its type is damaged."""
        if typ not in self._typestores:  # only the types that are read: the definitions of all take 30 ms
            self._typestores[typ] = self._typestore_of([c for c in self.connections if c.msgtype == typ])
        try:
            return self._typestores[typ].deserialize_ros1(rawdata, typ)
        except HricError:
            raise
        except Exception as error:  # a damaged message may raise any error
            raise damaged(self.bag, f"a message of type {typ} is damaged ({error})") from error

    def messages(
        self,
        connections: Collection[Connection] = (),
        start: int | None = None,
        stop: int | None = None,
    ) -> Generator[Any, None, None]:
        """Yield (connection, recording time [ns], serialised message), each once. Raises AnyReaderError if damaged."""
        try:
            yield from self._messages(connections, start, stop)
        except ReaderError as error:
            raise AnyReaderError(*error.args) from error

    def _messages(
        self, connections: Collection[Connection], start: int | None, stop: int | None
    ) -> Generator[Any, None, None]:
        if len(self.readers) == 1:
            yield from self.readers[0].messages(connections, start, stop)
            return
        repeated, earliest = [dict(counts) for counts in self._seams()], -1 if start is None else start
        numbers = {id(reader): number for number, reader in enumerate(self.readers)}
        for connection, time, raw in super().messages(connections, None, stop):
            left, stream = repeated[numbers[id(connection.owner)]], _stream(connection)
            if left.get(stream, 0):
                left[stream] -= 1
            elif time >= earliest:
                yield connection, time, raw

    def chosen(
        self, chooses: Callable[[Connection], bool], progress: str = ""
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield (connection, recording time [ns], serialised message) of the connections that `chooses` accepts.

        progress: label of a progress bar on the terminal; "": no bar.
        """
        connections = [connection for connection in self.connections if chooses(connection)]
        if connections:  # with an empty list `messages` would take all
            yield from tqdm(
                self.messages(connections),
                total=sum(connection.msgcount for connection in connections),
                unit=" messages",
                desc=progress,
                disable=not progress,
                leave=False,
            )

    def _seams(self) -> list[dict[Stream, int]]:
        """Return, for each part, how many of the first messages of each stream are also in the part before it."""
        if self._repeated is None:
            self._repeated = [{}] + [
                _seam(before, after) for before, after in zip(self.readers, self.readers[1:], strict=False)
            ]
        return self._repeated


def _stream(connection: Connection) -> Stream:
    return connection.topic, str(getattr(connection.ext, "callerid", ""))


def _seam(before: Any, after: Any) -> dict[Stream, int]:
    if not before.message_count or not after.message_count:
        return {}
    latched = [connection for connection in before.connections if getattr(connection.ext, "latching", 0)]
    held = _gather(before, before.connections, start=after.start_time - MARGIN) | (
        _gather(before, latched) if latched else {}
    )
    names = {_stream(connection) for connection in latched}
    return {
        stream: overlap(held.get(stream, []), begun, latched=stream in names)
        for stream, begun in _gather(after, after.connections, stop=before.end_time + MARGIN).items()
    }


def _gather(
    reader: Any, connections: Sequence[Connection], start: int | None = None, stop: int | None = None
) -> Messages:
    messages: Messages = {}
    for connection, time, raw in reader.messages(connections=connections, start=start, stop=stop):
        messages.setdefault(_stream(connection), []).append((time, raw))
    return messages


def overlap(before: Sequence[tuple[int, bytes]], after: Sequence[tuple[int, bytes]], *, latched: bool = False) -> int:
    """Return how many of the first messages of a part are the last ones of the part before it.

    For a stream that repeats one message, several counts are possible: the one that fits the times best is returned, or
    for a latched stream the largest.

    Args:
        before: (time [ns], serialised message) of one stream in the first part, in order.
        after: messages of that stream in the second part.
        latched: True if the stream's last message was sent again to the second recorder.
    """
    old, new = [raw for _, raw in before], [raw for _, raw in after]
    fitting = [count for count in range(min(len(old), len(new)) + 1) if old[len(old) - count :] == new[:count]]
    if latched or not after:
        return fitting[-1]
    expected = sum(time >= after[0][0] for time, _ in before)
    return min(fitting, key=lambda count: abs(count - expected))
