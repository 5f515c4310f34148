"""Helpers of tests of sensor nodes: clock of robot time, node processes that end with the test, diagnostics."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from real_master import end_nodes

from hric_core.robot_time import stamps
from hric_msgs.msg import ClockPair, SampleChunk
from hric_perception.chunk import Chunk, read_chunk

NODES = Path(__file__).parents[1] / "nodes"
LIMIT = 90.0


class TellsTime:
    """Publisher of hric_msgs/ClockPair at 50 Hz, as a robot publishes them.

    Attributes:
        pace: robot time per wall time; may be changed.
    """

    def __init__(self) -> None:
        import rospy

        self.pace, self.time, self._stop = 1.0, 10.0, threading.Event()
        self._publisher = rospy.Publisher("/hric/clock", ClockPair, queue_size=10)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        last = time.monotonic_ns()
        while not self._stop.wait(0.02):
            now = time.monotonic_ns()
            self.time += self.pace * 1e-9 * (now - last)
            last = now
            self._publisher.publish(ClockPair(now, stamps.to_time(self.time), self.pace or 1.0, False))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


@pytest.fixture
def run(ros: str) -> Iterator[TellsTime]:
    import rospy

    rospy.set_param("/use_sim_time", True)
    telling = TellsTime()
    yield telling
    telling.close()
    rospy.set_param("/use_sim_time", False)


class Nodes:
    """Node processes that end with the test."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen[str]] = []

    def start(self, name: str, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(NODES / name), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._running.append(process)
        return process

    def end(self, process: subprocess.Popen[str]) -> str:
        process.send_signal(signal.SIGINT)
        return process.communicate(timeout=LIMIT)[0]

    def close(self) -> None:
        """End all processes, and print their output."""
        for process, said in zip(self._running, end_nodes(*self._running), strict=True):
            print(process.args, said)


@pytest.fixture
def nodes(ros: str) -> Iterator[Nodes]:
    import rospy

    # The master may be that of tests which gave nodes of these names other parameters.
    for name in [*(path.name for path in NODES.iterdir()), "wrong"]:
        if rospy.has_param(f"/{name}"):
            rospy.delete_param(f"/{name}")
    made = Nodes()
    yield made
    made.close()


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


class TopicActivation:
    """Recorder of the chunks on a topic."""

    def __init__(self, topic: str) -> None:
        import rospy

        self.chunks: list[Chunk] = []
        self._subscriber = rospy.Subscriber(
            topic, SampleChunk, lambda message: self.chunks.append(read_chunk(message)), queue_size=None
        )

    def close(self) -> None:
        self._subscriber.unregister()

    @property
    def end(self) -> float:
        return self.chunks[-1].start if self.chunks else -1.0


class Diagnosis:
    """Recorder of a node's status on /diagnostics."""

    def __init__(self, name: str) -> None:
        import rospy

        self.seen: list[Any] = []
        rospy.Subscriber(
            "/diagnostics",
            DiagnosticArray,
            lambda message: self.seen.extend(s for s in message.status if s.name.startswith(name)),
        )

    def says(self, words: str) -> bool:
        return any(words in status.message for status in list(self.seen))
