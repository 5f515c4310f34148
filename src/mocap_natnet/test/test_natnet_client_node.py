"""The node `natnet_client` as a process under a master, fed by the emulated Motive as another process."""

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseStamped
from real_master import end_nodes, free_port, ros, roscore
from std_srvs.srv import Trigger

from hric_msgs.msg import MocapData

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "natnet_client"
LIMIT = 30.0


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(NODE), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def end(process: subprocess.Popen[str]) -> str:
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=LIMIT)
    return output


@pytest.fixture
def ports() -> tuple[int, int]:
    return free_port(), free_port()


@pytest.fixture
def node(ros: str, ports: tuple[int, int]) -> Iterator[subprocess.Popen[str]]:
    process = start(f"_command_port:={ports[0]}", f"_data_port:={ports[1]}", "_local:=127.0.0.1", "_take:=run_7")
    yield process
    end_nodes(process)


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def listen(topic: str, kind: type) -> list:
    import rospy

    seen: list = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=None)
    return seen


def test_topics_diagnostics_and_services(node: subprocess.Popen[str], ports: tuple[int, int]) -> None:
    import rospy

    data, points, poses = (
        listen("/hric/perception/mocap", MocapData),
        listen("/mocap/marker", Point),
        listen("/mocap/marker/pose", PoseStamped),
    )
    health = listen("/diagnostics", DiagnosticArray)
    wait(lambda: any("command channel silent" in message.status[0].message for message in health))
    stream = ("--command-port", str(ports[0]), "--data-port", str(ports[1]), "--up", "z", "--transport", "unicast")
    with motive(*stream):
        wait(lambda: len(data) > 300 and len(points) > 200 and len(poses) > 200)
        wait(lambda: "frames per second" in health[-1].status[0].message)
        for name in ("start_recording", "stop_recording", "edit_mode", "live_mode"):
            answer = rospy.ServiceProxy(f"/natnet_client/{name}", Trigger)()
            assert answer.success, answer
    numbers = [message.frame_number for message in data]
    assert numbers == sorted(set(numbers))
    late = [message for message in data if message.latency > 0.004][-100:]
    assert len(late) == 100
    assert all(message.header.frame_id == "mocap" and message.rigid_bodies[0].name == "marker" for message in late)
    ages = [
        b.header.stamp.to_sec() - a.header.stamp.to_sec() - (b.frame_number - a.frame_number) / 240
        for a, b in itertools.pairwise(late)
    ]
    assert max(map(abs, ages)) < 1e-3
    assert abs(late[-1].header.stamp.to_sec() - time.time()) < LIMIT
    answer = rospy.ServiceProxy("/natnet_client/start_recording", Trigger)()
    assert not answer.success and "does not respond" in answer.message
    output = end(node)
    assert node.returncode == 0 and "Traceback" not in output


def test_a_wrong_parameter_ends_the_node_with_one_line(ros: str) -> None:
    process = start("__name:=wrong_client", "_up_axis:=x")
    output, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 2
    assert "/wrong_client/up_axis is 'x'; valid: y, z" in output and "Traceback" not in output


@pytest.mark.parametrize("name", ["natnet_client", "emulated_motive", "calibrate"])
def test_help_works_without_a_master(name: str) -> None:
    environment = os.environ | {"ROS_MASTER_URI": "http://127.0.0.1:9"}
    result = subprocess.run(
        [sys.executable, str(NODE.parent / name), "--help"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert result.returncode == 0 and name in result.stdout.partition("\n")[0]
