"""A recorder in its own process, and a source of numbered messages; fixtures for tests that import them."""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from real_master import ros, roscore  # noqa: F401
from std_msgs.msg import String, UInt32
from std_srvs.srv import Trigger

from hric_bags.run_folder import RunFolder

RATE = 500.0
"""Rate of the topic with numbered messages [Hz]."""


class Source:
    """Publishes 0, 1, 2, ... from a thread, and a latched text that does not change."""

    def __init__(self) -> None:
        self.sent = 0
        self._counter = rospy.Publisher("/recorder_test/counter", UInt32, queue_size=10_000)
        self._latched = rospy.Publisher("/recorder_test/layout", String, queue_size=1, latch=True)
        self._latched.publish(String("x y z"))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        begin = time.monotonic()
        while not self._stop.wait(max(begin + (self.sent + 1) / RATE - time.monotonic(), 0.0)):
            self._counter.publish(UInt32(self.sent))
            self.sent += 1

    def close(self) -> None:
        """Stop the source."""
        self._stop.set()
        self._thread.join()
        self._counter.unregister()
        self._latched.unregister()


class Node:
    """A recorder in its own process."""

    def __init__(
        self, runs: Path, name: str, *given: str, topics: str = "[/recorder_test/counter, /recorder_test/layout]"
    ) -> None:
        self.runs, self._name = runs, name
        for old in rospy.get_param_names():
            if old.startswith(f"/{name}/"):
                rospy.delete_param(old)
        command = [
            str(Path(__file__).parents[1] / "nodes" / "recorder"),
            f"__name:={name}",
            f"_runs:={runs}",
            f"_topics:={topics}",
            *given,
        ]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        )

    def call(self, what: str) -> Any:
        """Call a service of the recorder."""
        rospy.wait_for_service(f"/hric/experiment/{what}_recording", 20.0)
        return rospy.ServiceProxy(f"/hric/experiment/{what}_recording", Trigger)()

    def wait_recording(self) -> None:
        """Wait until the recorder reports that it records."""
        heard: list[str] = []
        subscriber = rospy.Subscriber("/hric/experiment/recording", String, lambda message: heard.append(message.data))
        until(lambda: bool(heard and heard[-1]))
        subscriber.unregister()

    def folder(self) -> RunFolder:
        """Return the newest run folder."""
        return RunFolder.open("latest", self.runs)

    def close(self) -> str:
        """Stop the recorder as Ctrl-C does, and return its output."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
        try:
            return self.process.communicate(timeout=30)[0]
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            raise


def until(what: Callable[[], bool], timeout: float = 30.0) -> None:
    deadline = time.monotonic() + timeout
    while not what():
        assert time.monotonic() < deadline, f"not within {timeout} s"
        time.sleep(0.02)


@pytest.fixture
def source(ros: str) -> Iterator[Source]:  # noqa: F811
    running = Source()
    yield running
    running.close()


@pytest.fixture
def start(ros: str, tmp_path: Path) -> Iterator[Callable[..., Node]]:  # noqa: F811
    started: list[Node] = []

    def begin(*given: str, runs: Path = tmp_path, **other: str) -> Node:
        # A name of its own: the parameters of another test do not reach it.
        started.append(Node(runs, f"recorder_{tmp_path.name}", *given, **other))
        return started[-1]

    yield begin
    for node in started:
        if not node.process.stdout.closed:  # type: ignore[union-attr]
            print(node.close())
