"""The nodes in robot time that the test publishes: stamps, a pause, an unpaced run, and takes named after runs."""

import itertools
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from real_master import end_nodes, free_port, ros, roscore
from rosgraph_msgs.msg import Log
from std_msgs.msg import String

from hric_core.robot_time import stamps
from hric_msgs.msg import ClockPair, MocapData

sys.path.insert(0, str(Path(__file__).parent))

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODES = Path(__file__).parents[1] / "nodes"
LIMIT = 90.0


class TellsTime:
    """Publisher of hric_msgs/ClockPair at 50 Hz, as a robot publishes them.

    Attributes:
        pace: robot time per wall time; may be changed.
        loses: wall time that the run loses at once every half second, as a loop does that a busy machine keeps from
            running [s]; may be changed.
    """

    def __init__(self) -> None:
        import rospy

        self.pace, self.time, self.loses, self._stop = 1.0, 0.0, 0.0, threading.Event()
        self.told: float | None = None
        self._publisher = rospy.Publisher("/hric/clock", ClockPair, queue_size=10)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        last = time.monotonic_ns()
        for index in itertools.count():
            if self._stop.wait(0.02):
                return
            now = time.monotonic_ns()
            self.time += self.pace * 1e-9 * (now - last)
            last = now
            if self.loses and index % 25 == 0:
                time.sleep(self.loses)
                last = time.monotonic_ns()
            self._publisher.publish(
                ClockPair(now, stamps.to_time(self.time), self.pace or 1.0 if self.told is None else self.told, False)
            )

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


@pytest.fixture
def robot(ros: str) -> Iterator[TellsTime]:
    import rospy

    rospy.set_param("/use_sim_time", True)
    telling = TellsTime()
    yield telling
    telling.close()
    rospy.set_param("/use_sim_time", False)


@pytest.fixture
def nodes(robot: TellsTime) -> Iterator[tuple[subprocess.Popen[str], subprocess.Popen[str]]]:
    """Start the client, and the emulated Motive from which it receives."""
    yield from _started()


@pytest.fixture
def elsewhere(robot: TellsTime) -> Iterator[tuple[subprocess.Popen[str], subprocess.Popen[str]]]:
    """Start the client, and a Motive that streams even while the run is paused, as a real one does."""
    yield from _started("--clock", "wall")


def _started(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], subprocess.Popen[str]]]:
    command, data = str(free_port()), str(free_port())
    client = _start("natnet_client", f"_command_port:={command}", f"_data_port:={data}", "_local:=127.0.0.1")
    motive = _start(
        "emulated_motive", "--transport", "unicast", "--command-port", command, "--data-port", data, *arguments
    )
    yield client, motive
    end_nodes(client, motive)


def _start(name: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(NODES / name), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def _end(process: subprocess.Popen[str]) -> str:
    process.send_signal(signal.SIGINT)
    return process.communicate(timeout=LIMIT)[0]


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def test_stamps_are_those_of_the_run_at_half_its_pace_and_a_pause_has_no_frames(robot: TellsTime, nodes) -> None:
    import rospy

    robot.pace = 0.5
    frames: list = []
    subscriber = rospy.Subscriber("/hric/perception/mocap", MocapData, frames.append, queue_size=None)
    _wait(lambda: len(frames) > 300)
    steps = [
        (b.header.stamp - a.header.stamp).to_sec() - (b.frame_number - a.frame_number) / 240.0
        for a, b in itertools.pairwise(frames[100:])
    ]
    assert sorted(map(abs, steps))[len(steps) // 2] < 1e-3
    assert abs(frames[-1].header.stamp.to_sec() - robot.time) < 1.0
    robot.pace = 0.0
    time.sleep(0.5)
    stood = len(frames)
    time.sleep(0.5)
    assert len(frames) == stood
    robot.pace = 0.5
    _wait(lambda: len(frames) > stood + 50)
    subscriber.unregister()
    assert "Traceback" not in _end(nodes[0]) + _end(nodes[1])


def test_where_the_run_loses_time_again_and_again_no_stamp_goes_back(robot: TellsTime, elsewhere) -> None:
    import rospy

    frames: list = []
    subscriber = rospy.Subscriber("/hric/perception/mocap", MocapData, frames.append, queue_size=None)
    _wait(lambda: len(frames) > 50)
    robot.loses = 0.15
    begun = len(frames)
    _wait(lambda: len(frames) > begun + 600)
    robot.loses = 0.0
    numbers, stamps = zip(*((frame.frame_number, frame.header.stamp.to_nsec()) for frame in list(frames)), strict=True)
    assert list(numbers) == sorted(numbers) and min(b - a for a, b in itertools.pairwise(stamps)) > 0
    latest = frames[-1].header.stamp.to_sec()
    assert abs(latest - robot.time) < 0.5
    subscriber.unregister()


def test_an_unpaced_run_is_refused_by_name(robot: TellsTime, nodes) -> None:
    robot.told = 0.0
    for process, name in zip(nodes, ("natnet_client", "emulated_motive"), strict=True):
        output = process.communicate(timeout=LIMIT)[0]
        assert process.returncode == 1
        assert (
            f"/{name}: the simulation is not paced (real_time_factor is 0)" in output
            and "valid: real_time_factor above 0, or a run without ROS (hric run)" in output
            and "Traceback" not in output
        )


def test_motive_records_a_take_beside_each_run_that_is_recorded(robot: TellsTime, nodes) -> None:
    import rospy

    recorder = rospy.Publisher("/hric/experiment/recording", String, queue_size=1, latch=True)
    flags: list = []
    subscriber = rospy.Subscriber("/rosout", Log, lambda message: flags.append(message.msg), queue_size=None)
    _wait(lambda: subscriber.get_num_connections() == 3)  # this node and both others
    recorder.publish(String("/somewhere/runs/marker_tracking_20260101-120000"))
    _wait(lambda: any("Motive records the take marker_tracking_20260101-120000" in text for text in list(flags)))
    recorder.publish(String(""))
    _wait(lambda: any("Motive has ended the take" in text for text in list(flags)))
    subscriber.unregister()
    recorder.unregister()
