"""The reader of one bag, compared with that of rosbags, also for some topics or times only."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

from hric_bags.indexed import BagError, IndexedReader

STORE = get_typestore(Stores.ROS1_NOETIC)
KIND = "std_msgs/msg/String"
COUNT = 10_000


@pytest.fixture(params=[None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4], ids=str)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Three topics, one of them twice, with times that repeat and are not in order, in several chunks."""
    path, random = tmp_path / "some.bag", np.random.default_rng(1)
    writer = Writer(path)
    writer.chunk_threshold = 10_000
    if request.param is not None:
        writer.set_compression(request.param)
    with writer:
        senders = [("/a", "/one"), ("/a", "/two"), ("/b", "/one"), ("/c", "/one")]
        sent = [writer.add_connection(topic, KIND, typestore=STORE, callerid=node) for topic, node in senders]
        for k in range(COUNT):
            text = STORE.types[KIND](data=f"{k} " + "x" * int(random.integers(0, 40)))
            time = max(0, 1_000_000 * (k + int(random.integers(-3, 3))))
            writer.write(sent[int(random.integers(0, 4))], time, STORE.serialize_ros1(text, KIND))
    return path


def shown(messages: object) -> list[tuple[str, int, bytes]]:
    return [(connection.topic, time, bytes(raw)) for connection, time, raw in messages]  # type: ignore[attr-defined]


def test_messages_come_as_from_rosbags_own_reader(bag: Path) -> None:
    with Reader(bag) as theirs, IndexedReader(bag) as ours:
        assert len(ours.chunks) > 5 and ours.message_count == theirs.message_count == COUNT
        assert [(c.topic, c.msgcount) for c in ours.connections] == [(c.topic, c.msgcount) for c in theirs.connections]
        assert (ours.start_time, ours.end_time) == (theirs.start_time, theirs.end_time)
        for start, stop in ((None, None), (10_000_000, 4_000_000_000), (None, 0)):
            assert shown(ours.messages(start=start, stop=stop)) == shown(theirs.messages(start=start, stop=stop))
        chosen = [[c for c in reader.connections if c.topic == "/a"] for reader in (theirs, ours)]
        assert shown(ours.messages(chosen[1])) == shown(theirs.messages(chosen[0]))


def test_a_bag_without_messages_has_none(tmp_path: Path) -> None:
    with Writer(tmp_path / "empty.bag") as writer:
        writer.add_connection("/a", KIND, typestore=STORE)
    with IndexedReader(tmp_path / "empty.bag") as reader:
        assert list(reader.messages()) == [] and reader.message_count == 0


def test_an_index_that_leads_nowhere_is_an_error_of_the_bag(tmp_path: Path) -> None:
    path = tmp_path / "one.bag"
    with Writer(path) as writer:
        connection = writer.add_connection("/a", KIND, typestore=STORE)
        writer.write(connection, 0, STORE.serialize_ros1(STORE.types[KIND](data="text"), KIND))
    content = path.read_bytes()
    at = content.index(b"op=\x02")
    path.write_bytes(content[:at] + b"op=\x07" + content[at + 4 :])
    with (
        IndexedReader(path) as reader,
        pytest.raises(BagError, match=r"its index names byte .*, where no message is; try: hric health"),
    ):
        list(reader.messages())
