"""The node `emulated_arm` under a master: libfranka's peer connects to it, and who acts in its plant has its place in
the time of the run."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fci_peer import PATIENCE, Peer, log_of, new_address, wait_until_up
from real_master import end_nodes, ros, roscore
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

import panda_description
from franka_hw_interface.robot_state import RobotMode
from hric_core.robot_time import stamps
from hric_msgs.msg import ClockPair

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "emulated_arm"
LIMIT = 30.0
HUMAN = {"type": "hric_human/Human", "position": [0.85, -0.2]}
EPOCH = 1.5e9
"""Of the run that this test plays: years from this machine's time [s]."""


class Node:
    """Node `emulated_arm` in the namespace /cell, with a human as participant in MuJoCo."""

    def __init__(self, packages: str = "", **parameters: Any) -> None:
        import rospy

        self.ip = new_address()
        rospy.set_param("/cell/robot_description", panda_description.load(hand=parameters.pop("hand", True)))
        given = {"ip": self.ip, "plant_type": "mujoco_ros_control/MujocoPlant", "participants": {"human": HUMAN}}
        rospy.set_param("/cell/emulated_arm", given | parameters)
        log = tempfile.TemporaryFile("w+")  # noqa: SIM115  (closed with the node)
        self.process = subprocess.Popen(
            [sys.executable, str(NODE)],
            env={
                **os.environ,
                "ROS_NAMESPACE": "/cell",
                "ROS_PACKAGE_PATH": f"{packages}:{os.environ['ROS_PACKAGE_PATH']}",
            },
            stdout=log,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.process.stderr = log  # so that it can be read

    def output(self) -> str:
        """Return the whole output of the node until its end."""
        self.process.wait(LIMIT)
        return log_of(self.process)

    def close(self) -> None:
        end_nodes(self.process)
        assert self.process.stderr is not None
        self.process.stderr.close()


@pytest.fixture
def node(ros: Any) -> Iterator[Callable[..., Node]]:

    made: list[Node] = []

    def start(**parameters: Any) -> Node:
        made.append(Node(**parameters))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.mark.parametrize(("robot", "version"), [("panda", 5), ("fr3", 10)])
def test_a_client_connects_to_arm_and_hand_and_the_node_ends_well_when_asked(
    node: Callable[..., Node], robot: str, version: int
) -> None:
    cell = node(robot=robot)
    wait_until_up(cell.ip, cell.process)
    with Peer(cell.ip, version) as arm, Peer(cell.ip, 3, port=1338):
        assert arm.modes(arm.state())[2] == 1
    cell.process.send_signal(signal.SIGINT)
    output = cell.output()
    assert cell.process.returncode == 0 and "Traceback" not in output, output


def test_the_user_stop_is_pressed_by_a_service(node: Callable[..., Node]) -> None:
    import rospy

    cell = node(participants={})
    wait_until_up(cell.ip, cell.process)
    rospy.wait_for_service("/cell/franka_control/set_user_stop", LIMIT)
    press = rospy.ServiceProxy("/cell/franka_control/set_user_stop", SetBool)
    with Peer(cell.ip, 5) as arm:
        for pressed, mode in ((True, RobotMode.USER_STOPPED), (False, RobotMode.IDLE)):
            assert press(pressed).success
            end = time.monotonic() + LIMIT
            while arm.modes(arm.state())[2] != mode.value:  # states that were sent before wait in the socket
                assert time.monotonic() < end, mode


def test_without_a_hand_in_the_description_no_hand_listens(node: Callable[..., Node]) -> None:
    cell = node(hand=False, participants={})
    wait_until_up(cell.ip, cell.process)
    with pytest.raises(ConnectionRefusedError):
        Peer(cell.ip, 3, port=1338)


def test_the_human_beside_it_is_stamped_with_the_time_of_the_run_and_hears_their_services(
    node: Callable[..., Node],
) -> None:
    import rospy

    cell = node()
    heard: list[float] = []
    rospy.Subscriber("/cell/hric/human/joint_states", JointState, lambda m: heard.append(m.header.stamp.to_sec()))
    clock = rospy.Publisher("/cell/hric/clock", ClockPair, queue_size=10)
    wait_until_up(cell.ip, cell.process)
    began, end = time.monotonic_ns(), time.monotonic() + LIMIT
    while not heard or abs(heard[-1] - EPOCH) > 1e6:  # until the first pair has come
        assert time.monotonic() < end, heard[-3:]
        now = time.monotonic_ns()
        clock.publish(ClockPair(now, stamps.to_time(EPOCH + 1e-9 * (now - began)), 1.0, False))
        time.sleep(0.02)
    run = EPOCH + 1e-9 * (time.monotonic_ns() - began)
    assert heard[-1] == pytest.approx(run, abs=PATIENCE)
    assert rospy.ServiceProxy("/cell/hric/human/start", Trigger)().success


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"ip": "here"}, "/cell/emulated_arm/ip is 'here'; valid: an IPv4 address of this machine"),
        ({"robot": "ur5"}, "/cell/emulated_arm/robot is 'ur5'; valid: panda, fr3"),
        ({"plant": {"time_step": 0.002}}, "/cell/emulated_arm/plant/time_step is 0.002; valid: 0.001"),
        ({"participants": {"door": {"type": "lab/Door"}}}, "no hric_control::Participant 'lab/Door'"),
        ({"ip": "192.0.2.1"}, "192.0.2.1"),
    ],
)
def test_what_cannot_be_ends_it_with_one_line(
    node: Callable[..., Node], parameters: dict[str, Any], message: str
) -> None:
    cell = node(**parameters)
    output = cell.output()
    assert cell.process.returncode in (1, 2) and message in output and "Traceback" not in output, output


DOOR = """
from hric_control.sim.participants import Participant

class Door(Participant):
    def __init__(self, name, plant, node, config):
        pass

    def reset(self):
        pass

    def act(self, time):
        if time > 0.1:
            raise RuntimeError("the hinge is broken")
"""


def test_what_breaks_in_the_loop_ends_the_node_with_its_reason(node: Callable[..., Node], tmp_path: Path) -> None:
    export = '<export><hric_control plugin="${prefix}/plugins.xml"/></export>'
    (tmp_path / "package.xml").write_text(f"<package format='3'><name>lab</name>{export}</package>")
    (tmp_path / "plugins.xml").write_text(
        '<library path="lib"><class name="lab/Door" type="lab_door:Door"'
        ' base_class_type="hric_control::Participant"/></library>'
    )
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/lab_door.py").write_text(DOOR)
    cell = node(packages=str(tmp_path), participants={"door": {"type": "lab/Door"}})
    assert "the hinge is broken" in cell.output()
    assert cell.process.returncode == 1
