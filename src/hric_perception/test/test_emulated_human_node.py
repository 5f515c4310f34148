"""The node `emulated_human` under a ROS master, received by the real client."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from real_master import end_nodes, free_port, ros, roscore
from std_msgs.msg import String
from std_srvs.srv import Trigger

from hric_msgs.msg import MocapData

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "emulated_human"
CLIENT = Path(__file__).parents[2] / "mocap_natnet" / "nodes" / "natnet_client"
LIMIT = 30.0
HUMAN = "{program: minimum_jerk, points: [[0, 0.6, 0, 0.4], [3, 0.6, 0.2, 0.5]]}"


@contextlib.contextmanager
def process(path: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    child = subprocess.Popen(
        [sys.executable, str(path), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield child
    finally:
        end_nodes(child)


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def listen(topic: str, kind: type) -> list[Any]:
    import rospy

    seen: list[Any] = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=None)
    return seen


def test_the_hand_rests_until_it_is_started_and_the_client_sees_what_it_really_does(ros: str) -> None:
    import rospy

    frames, truth, phases = (
        listen("/hric/perception/mocap", MocapData),
        listen("/hric/human/hand", PoseStamped),
        listen("/hric/human/phase", String),
    )
    ports = {"command_port": free_port(), "data_port": free_port()}
    stream = f"_stream:={{transport: unicast, command_port: {ports['command_port']}, data_port: {ports['data_port']}}}"
    client = [f"_{name}:={port}" for name, port in ports.items()]
    with (
        process(NODE, f"_human:={HUMAN}", stream) as node,
        process(CLIENT, *client, "_local:=127.0.0.1", "_base_frame:=panda_link0"),
    ):
        # A latency is known once the client knows the server's clock.
        wait(lambda: len(truth) > 20 and len(frames) > 50 and frames[-1].latency > 0.0)
        assert {message.pose.position.y for message in truth} == {0.0} and phases[-1].data == "rest"
        start = rospy.ServiceProxy("/emulated_human/start", Trigger)
        answer = start()
        assert answer.success and "the hand starts at" in answer.message
        wait(lambda: phases[-1].data == "done" and truth[-1].pose.position.y > 0.1999)
        again = start()
        assert not again.success and "the hand's program has already started" in again.message
        wait(lambda: frames[-1].rigid_bodies[0].pose.position.y > 0.1999)
        node.send_signal(signal.SIGINT)
        output, _ = node.communicate(timeout=LIMIT)
        assert node.returncode == 0 and "Traceback" not in output
    assert [message.data for message in phases] == ["rest", "moving", "done"]
    moved = [
        message for message in frames if message.latency > 0 and 0.05 < message.rigid_bodies[0].pose.position.y < 0.15
    ]
    assert len(moved) > 20
    for message in moved:  # the speed is 0.125 m/s at most: 1 ms of a wrong stamp is 0.1 mm
        assert message.rigid_bodies[0].pose.position.y == pytest.approx(
            at(truth, message.header.stamp.to_sec()), abs=2e-4
        )


def at(truth: list[Any], when: float) -> float:
    """Return the hand's y at a time [s], interpolated between two of its poses."""
    after = next(k for k, message in enumerate(truth) if message.header.stamp.to_sec() >= when)
    a, b = truth[after - 1], truth[after]
    share = (when - a.header.stamp.to_sec()) / (b.header.stamp.to_sec() - a.header.stamp.to_sec())
    return float(a.pose.position.y + share * (b.pose.position.y - a.pose.position.y))


def test_a_wrong_parameter_ends_the_node_with_one_line(ros: str) -> None:
    with process(NODE, "__name:=wrong_human", "_human:={program: walk}") as node:
        output, _ = node.communicate(timeout=LIMIT)
    assert node.returncode == 2
    assert (
        "no program 'walk' in /wrong_human/human; valid: body, c3d, minimum_jerk, reactive, sinusoid" in output
        and "Traceback" not in output
    )


def test_help_works_without_a_master() -> None:
    environment = os.environ | {"ROS_MASTER_URI": "http://127.0.0.1:9"}
    result = subprocess.run(
        [sys.executable, str(NODE), "--help"], env=environment, capture_output=True, text=True, timeout=LIMIT
    )
    assert result.returncode == 0 and "rosrun hric_perception emulated_human" in result.stdout
