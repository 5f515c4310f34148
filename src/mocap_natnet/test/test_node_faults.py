"""The node reports faults of the stream, and their end, on `diagnostics` and in its log within two seconds."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from real_master import free_port, ros, roscore
from rosgraph_msgs.msg import Log

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "natnet_client"
PATIENCE = 30.0
"""Time-out of waiting, for a busy machine [s]."""


class Watched:
    """The node as a process, its health and its log."""

    def __init__(self, ports: tuple[int, int]) -> None:
        import rospy

        self.ports, self.states, self.log = ports, [], []  # type: tuple[int, int], list[str], list[str]
        rospy.Subscriber(
            "/diagnostics",
            DiagnosticArray,
            lambda message: self.states.append(message.status[0].message),
            queue_size=None,
        )
        rospy.Subscriber("/rosout", Log, lambda message: self.log.append(message.msg), queue_size=None)
        self.process = subprocess.Popen(
            [sys.executable, str(NODE), f"_command_port:={ports[0]}", f"_data_port:={ports[1]}", "_local:=127.0.0.1"]
        )

    def serve(self, *more: str):  # type: ignore[no-untyped-def]
        """Return an emulated Motive on the ports of the node, as a context."""
        return motive("--command-port", str(self.ports[0]), "--data-port", str(self.ports[1]), *more)

    def seconds_until(self, words: str) -> float:
        """Wait for diagnostics with these words; return the time it took [s]."""
        begin, seen = time.monotonic(), len(self.states)
        while not any(words in state for state in self.states[seen:]):
            assert time.monotonic() < begin + PATIENCE, f"{words!r} is not said; but: {self.states[-3:]}"
            time.sleep(0.01)
        return time.monotonic() - begin


@pytest.fixture
def node(ros: str) -> Iterator[Watched]:
    made = Watched((free_port(), free_port()))
    yield made
    made.process.send_signal(signal.SIGINT)
    made.process.wait(PATIENCE)


@pytest.mark.parametrize("limit", [PATIENCE, pytest.param(2.0, marks=pytest.mark.live)])
def test_a_killed_server_a_new_one_and_another_bitstream_are_reported(
    node: Watched, limit: float, figure: Callable[..., None]
) -> None:
    with node.serve() as process:
        node.seconds_until("bitstream 4.1")
        process.kill()
        killed = node.seconds_until("command channel silent")
    with node.serve("--bitstream", "3.1", "--transport", "unicast"):
        replaced = node.seconds_until("bitstream 3.1")
    node.seconds_until("command channel silent")
    figure(f"natnet_client: a killed server is told (limit {limit:g} s) after", killed, "s")
    figure(f"natnet_client: one in its place is told (limit {limit:g} s) after", replaced, "s")
    assert max(killed, replaced) <= limit
    assert any("does not respond; check that this is Motive's address" in line for line in node.log)
    assert any("bitstream 3.1" in line for line in node.log)
