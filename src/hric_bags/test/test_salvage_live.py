"""A flipped bit anywhere in a bag of the real recorder destroys at most one chunk."""

import random
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rospy
from real_master import ros, roscore  # noqa: F401
from rosbags.rosbag1 import Reader
from std_msgs.msg import Float64MultiArray, UInt32

from hric_bags.health.examine import examine
from hric_bags.health.salvage import salvage
from hric_experiments.recorder import process as recorder_process
from hric_experiments.recorder.process import RecorderProcess

pytestmark = [pytest.mark.alone, pytest.mark.rostest]
ARRAY, NUMBER = "/salvage_test/array", "/salvage_test/number"
CHUNK_TIME = 0.4
"""Time that the recorder leaves a chunk open [s]: CHUNK_TIME of bag_writer.cpp."""
Message = tuple[str, str, str, int, bytes]
"""Topic, type, checksum of the type, time of recording [ns], serialised message."""


def record(path: Path, chunks: int) -> Path:
    """Record arrays of random numbers, which compression leaves as long as they are, and numbers from 0 on."""
    publishers = {
        topic: rospy.Publisher(topic, kind, queue_size=1000)
        for topic, kind in ((ARRAY, Float64MultiArray), (NUMBER, UInt32))
    }
    arguments = recorder_process.arguments(path, list(publishers), "", f"record_{path.stem}")
    recorder = RecorderProcess(path, [recorder_process.find_recorder(), *arguments])
    recorder.wait_open(20.0)
    deadline = time.monotonic() + 20.0
    while not all(publisher.get_num_connections() for publisher in publishers.values()):
        assert time.monotonic() < deadline, "the recorder does not listen"
        time.sleep(0.02)
    values = np.random.default_rng(1)
    for k in range(round(chunks * CHUNK_TIME / 0.01)):
        publishers[ARRAY].publish(Float64MultiArray(data=values.normal(size=64).tolist()))
        publishers[NUMBER].publish(UInt32(k))
        time.sleep(0.01)
    for publisher in publishers.values():
        publisher.unregister()
    return recorder.stop()


def contents(path: Path) -> list[Message]:
    with Reader(path) as reader:
        return [(c.topic, c.msgtype, c.digest, time, bytes(raw)) for c, time, raw in reader.messages()]


def check(whole: Path, damaged: Path, seed: int) -> None:
    """Flip a random bit of a bag, salvage the bag, and compare its messages with the original ones."""
    expected, data, places = contents(whole), bytearray(whole.read_bytes()), random.Random(seed)
    at, bit = places.randrange(len(data)), places.randrange(8)
    where = f"bit {bit} of byte {at} of {len(data)}"
    with Reader(whole) as reader:
        largest = max(sum(info.connection_counts.values()) for info in reader.chunk_infos)
        assert len(reader.chunk_infos) >= 4 and largest < len(expected) / 2
    data[at] ^= 1 << bit
    damaged.write_bytes(data)
    if examine(damaged).code != 4:
        assert contents(damaged) == expected, f"{where}: what is wrong is found"
        return
    salvaged = salvage(damaged)
    kept = contents(salvaged.bag)
    assert (Counter(expected) - Counter(kept)).total() <= largest, f"{where}: one chunk at most is lost"
    assert salvaged.doubtful or not Counter(kept) - Counter(expected), f"{where}: what is wrong is marked"
    common = set(kept) & set(expected)
    in_order = [message for message in expected if message in common]
    assert [message for message in kept if message in common] == in_order, f"{where}: what is kept is in order"
    assert examine(salvaged.bag).code == 0, where


@pytest.fixture(scope="module")
def live_bag(ros: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:  # noqa: F811
    yield record(tmp_path_factory.mktemp("live") / "live.bag", 5)


@pytest.mark.parametrize("seed", range(10))
def test_a_flipped_bit_of_a_live_bag_costs_one_chunk_at_most(live_bag: Path, tmp_path: Path, seed: int) -> None:
    check(live_bag, tmp_path / "damaged.bag", seed)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(10))
def test_ten_flipped_bits_of_each_live_bag_cost_one_chunk_at_most_each(
    ros: str,  # noqa: F811
    tmp_path: Path,
    number: int,
) -> None:
    whole = record(tmp_path / f"live_{number}.bag", 8)
    for seed in range(10):
        check(whole, tmp_path / f"damaged_{seed}.bag", 10 * number + seed)
