"""A recorder that is killed: its recording can be read after `hric health`, with at most one second lost."""

import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rospy
from real_master import ros, roscore  # noqa: F401
from rosbags.highlevel import AnyReader
from std_msgs.msg import UInt32

from hric_core.command import main
from hric_experiments.recorder import process as recorder_process
from hric_experiments.recorder.process import RecorderProcess

pytestmark = [pytest.mark.alone, pytest.mark.rostest]
RATE = 100.0
"""Rate of the single topic [Hz]."""
MOST_LOST = 1.0
"""Maximum duration that may be lost [s]."""


class Counter:
    """Publishes 0, 1, 2, ... with RATE: numbers show which messages are missing."""

    def __init__(self) -> None:
        self.sent = 0
        self._publisher = rospy.Publisher("/counter", UInt32, queue_size=100)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        begin = time.monotonic()
        while not self._stop.wait(max(begin + (self.sent + 1) / RATE - time.monotonic(), 0.0)):
            self._publisher.publish(UInt32(self.sent))
            self.sent += 1

    def wait_heard(self) -> None:
        """Wait for a subscriber."""
        deadline = time.monotonic() + 20.0
        while not self._publisher.get_num_connections():
            assert time.monotonic() < deadline, "the recorder does not listen"
            time.sleep(0.02)

    def close(self) -> None:
        """Stop publishing."""
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


@pytest.fixture
def counter(ros: str) -> Iterator[Counter]:  # noqa: F811
    running = Counter()
    yield running
    running.close()


def lost_when_killed(counter: Counter, bag: Path, after: float) -> float:
    """Record for `after` [s], kill the recorder, salvage; return the missing duration at the end, from the numbers of
    the messages [s]."""
    arguments = recorder_process.arguments(bag, ["/counter"], "", f"record_{bag.stem}")
    recorder = RecorderProcess(bag, [recorder_process.find_recorder(), *arguments])
    recorder.wait_open(20.0)
    counter.wait_heard()
    time.sleep(after)
    recorder._child.kill()
    sent = counter.sent
    recorder._child.wait()
    active = bag.with_name(bag.name + ".active")
    assert main(["health", str(active), "--quiet"]) == 4
    assert main(["health", str(active), "--salvage", "--quiet"]) == 0
    with AnyReader([bag]) as reader:
        numbers = [reader.deserialize(raw, connection.msgtype).data for connection, _, raw in reader.messages()]  # type: ignore[attr-defined]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    return (sent - 1 - numbers[-1]) / RATE


def test_a_killed_recording_of_one_slow_topic_opens_after_the_health_command_with_at_most_a_second_lost(
    counter: Counter, tmp_path: Path
) -> None:
    assert lost_when_killed(counter, tmp_path / "a.bag", 2.5) <= MOST_LOST


@pytest.mark.slow
def test_so_do_recordings_killed_at_ten_random_moments(counter: Counter, tmp_path: Path) -> None:
    chance = random.Random(20)
    lost = [lost_when_killed(counter, tmp_path / f"k{i}.bag", chance.uniform(1.5, 5.0)) for i in range(10)]
    print("lost [s]:", ", ".join(f"{seconds:.2f}" for seconds in lost))
    assert max(lost) <= MOST_LOST
