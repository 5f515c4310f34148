"""Program that writes a recording: no message is lost, also without processor time, and errors have one line."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
import rospy
from real_master import ros, roscore  # noqa: F401
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64, UInt8MultiArray, UInt32

from hric_experiments.recorder import process as recorder_process
from hric_experiments.recorder.process import RecorderProcess

pytestmark = [pytest.mark.alone, pytest.mark.rostest]


def record(bag: Path, topics: list[str], exclude: str = "") -> RecorderProcess:
    """Return a recorder that has opened its bag."""
    arguments = recorder_process.arguments(bag, topics, exclude, f"record_{bag.stem}")
    recorder = RecorderProcess(bag, [recorder_process.find_recorder(), *arguments])
    recorder.wait_open(20.0)
    return recorder


def advertise(topic: str, kind: type, latch: bool = False) -> rospy.Publisher:
    return rospy.Publisher(topic, kind, queue_size=10_000, latch=latch)


def wait_heard(*publishers: rospy.Publisher) -> None:
    """Wait until each publisher has a subscriber."""
    deadline = time.monotonic() + 20.0
    while not all(publisher.get_num_connections() for publisher in publishers):
        assert time.monotonic() < deadline, "the recorder does not listen"
        time.sleep(0.02)


def test_what_arrives_while_the_recorder_stands_is_in_the_bag_when_it_goes_on(ros: str, tmp_path: Path) -> None:  # noqa: F811
    publisher, recorder = advertise("/stood", UInt32), record(tmp_path / "stood.bag", ["/stood"])
    wait_heard(publisher)
    recorder._child.send_signal(signal.SIGSTOP)
    for number in range(3000):
        publisher.publish(UInt32(number))
    time.sleep(0.5)
    recorder._child.send_signal(signal.SIGCONT)
    time.sleep(0.5)
    with AnyReader([recorder.stop()]) as reader:
        assert [reader.deserialize(raw, connection.msgtype).data for connection, _, raw in reader.messages()] == list(
            range(3000)
        )  # type: ignore[attr-defined]


def test_a_recording_takes_no_more_memory_the_longer_it_is(ros: str, tmp_path: Path) -> None:  # noqa: F811
    # A megabyte a second: chunks end by time, before they are full.
    publisher, recorder = advertise("/long", UInt8MultiArray), record(tmp_path / "long.bag", ["/long"])
    wait_heard(publisher)
    memory = []
    for number in range(350):
        publisher.publish(UInt8MultiArray(data=bytes([number % 256]) * 20_000))
        time.sleep(0.02)
        memory.append(int(Path(f"/proc/{recorder.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    assert memory[-1] - memory[100] < 2e6
    with AnyReader([recorder.stop()]) as reader:
        data = [reader.deserialize(raw, connection.msgtype).data[0] for connection, _, raw in reader.messages()]  # type: ignore[attr-defined]
    assert data == [number % 256 for number in range(350)]


@pytest.mark.parametrize(("address", "local"), [("127.0.0.1", True), ("localhost", True), ("", False)])
def test_it_listens_on_loopback_where_ros_is_and_elsewhere_if_ros_is(
    ros: str,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    local: bool,
) -> None:
    monkeypatch.delenv("ROS_IP")
    monkeypatch.setenv("ROS_HOSTNAME", address) if address else monkeypatch.delenv("ROS_HOSTNAME", raising=False)
    recorder = record(tmp_path / "local.bag", ["/local"])
    shown = subprocess.run(["ss", "-ltunpH"], capture_output=True, text=True, check=True).stdout
    recorder.stop()
    bound = [line.split()[4] for line in shown.splitlines() if f"pid={recorder.pid}," in line]
    assert len(bound) >= 2 and all(place.startswith("127.0.0.1:") for place in bound) == local


def test_all_topics_but_the_excluded_are_recorded_also_those_that_come_later(ros: str, tmp_path: Path) -> None:  # noqa: F811
    first, hidden = advertise("/all/first", UInt32), advertise("/all/hidden/one", UInt32)
    recorder = record(tmp_path / "all.bag", [], exclude="/all/hidden/.*|/rosout.*")
    wait_heard(first)
    later = advertise("/all/later", Float64, latch=True)
    later.publish(Float64(2.5))
    wait_heard(later)
    for publisher in (first, hidden):
        publisher.publish(UInt32(1))
    time.sleep(0.3)
    with AnyReader([recorder.stop()]) as reader:
        found = {
            connection.topic: connection for connection in reader.connections if connection.topic.startswith("/all")
        }
        assert set(found) == {"/all/first", "/all/later"}
        later_connection = found["/all/later"].ext
        assert later_connection.callerid == rospy.get_name() and later_connection.latching  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "the path of the bag is missing"),
        (["x.bag", "--exclude", "("], "--exclude '(' is no regular expression"),
        (["x.bag", "--exclude"], "--exclude needs a regular expression"),
        (["--split", "x.bag"], "unknown option '--split'; valid: --exclude EXPRESSION"),
    ],
)
def test_an_invalid_command_line_is_one_error_before_the_master_is_contacted(
    tmp_path: Path, arguments: list[str], text: str
) -> None:
    done = subprocess.run(
        [recorder_process.find_recorder(), *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=20.0
    )
    assert done.returncode == 2 and text in done.stdout + done.stderr and not list(tmp_path.iterdir())


def test_a_bag_that_cannot_be_opened_is_reported_with_its_path(ros: str, tmp_path: Path) -> None:  # noqa: F811
    bag = tmp_path / "nowhere" / "x.bag"
    done = subprocess.run([recorder_process.find_recorder(), str(bag)], capture_output=True, text=True, timeout=20.0)
    assert done.returncode == 1 and str(bag) in done.stdout + done.stderr


def test_without_a_master_it_says_so_waits_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    environment = {**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:9"}
    command = [recorder_process.find_recorder(), str(tmp_path / "x.bag")]
    child = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    assert child.stderr is not None and "http://127.0.0.1:9" in child.stderr.readline()
    child.send_signal(signal.SIGINT)
    assert child.wait(10.0) == 130 and not list(tmp_path.iterdir())
    child.stderr.close()


def test_help_needs_no_master() -> None:
    done = subprocess.run([recorder_process.find_recorder(), "--help"], capture_output=True, text=True, timeout=20.0)
    assert done.returncode == 0 and "Usage" in done.stdout
