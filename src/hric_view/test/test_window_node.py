"""The node of the window shows what the running system says, to viewers alone, and ends with a word."""

import contextlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
from browser import Browser, installed
from geometry_msgs.msg import Point, PoseStamped
from real_master import end_nodes, ros, roscore  # noqa: F401
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from websockets.sync.client import connect

from franka_msgs.msg import FrankaState
from hric_core.robot_time import stamps
from hric_core.urdf import read
from hric_human.body import Subject, describe
from hric_msgs.msg import MocapData, MuscleActivation, RegionContact, RegionContacts
from panda_description import description

pytestmark = pytest.mark.alone

NODE = Path(__file__).parents[1] / "nodes" / "window"
ARM = """<robot name="arm"><link name="base"/><link name="two"/>
<link name="one"><visual><geometry><box size="0.1 0.1 0.4"/></geometry></visual></link>
<joint name="arm_joint1" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="2" velocity="2" effort="10"/></joint>
<joint name="arm_joint2" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" velocity="2" effort="10"/></joint></robot>"""
SHOWN = "report.started === true && report.forces.arrows.size === 1 && report.replay.robots[0].tracks.length === 2"
SUBJECT = {"code": "S1", "mass": 79.0, "height": 1.75, "sex": "male", "parts": "upper_body"}
IDENTITY = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
NAMES = ("right_bic", *(f"right_{number}" for number in range(67)))
MUSCLES = {name: [["r_shoulder", 0.0, 0.0, 0.0], ["r_elbow", 0.0, 0.0, -0.1]] for name in NAMES}
PANDA = description.load()
PANDA_JOINTS = [name for name, joint in read(PANDA).joints.items() if joint.type != "fixed"]
PERSON = describe(Subject.of(SUBJECT, "subject:")).urdf
PERSON_JOINTS = [name for name, joint in read(PERSON).joints.items() if joint.type != "fixed"]
LIMIT, SECONDS = 40e3, 8.0
"""Largest traffic to a viewer [bytes per second], and the time for which it is measured [s]."""


@pytest.fixture
def address(ros: str, request: pytest.FixtureRequest) -> Iterator[str]:  # noqa: F811
    """Address of the window of an arm with a person beside it; the node ends with the test. Parameter: another arm."""
    subject = Subject.of(SUBJECT, "subject:")
    rospy.set_param("/robot_description", getattr(request, "param", ARM))
    rospy.set_param("/hric/human/robot_description", describe(subject).urdf)
    rospy.set_param("/hric/human/muscle_lines", MUSCLES)
    rospy.set_param("/robot/participants/human", {"type": "hric_human/Human", "subject": SUBJECT})
    node = start("_port:=0")
    yield opened(node)
    (said,) = end_nodes(node)
    for name in ("/robot_description", "/hric/human", "/robot/participants"):
        rospy.delete_param(name)
    assert node.returncode == 0 and "Traceback" not in said, said


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(NODE), *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def opened(node: subprocess.Popen[str]) -> str:
    assert node.stdout is not None
    for line in node.stdout:
        if found := re.search(r"http://\S+", line):
            return found[0]
    raise AssertionError("the node ended without an address")


class Robot:
    """Publishers of what the window shows."""

    def __init__(self) -> None:
        self.joints = rospy.Publisher("/joint_states", JointState, queue_size=1)
        self.person = rospy.Publisher("/hric/human/joint_states", JointState, queue_size=1)
        self.root = rospy.Publisher("/hric/human/root", PoseStamped, queue_size=1)
        self.contacts = rospy.Publisher("/hric/human/contacts", RegionContacts, queue_size=1)
        self.mocap = rospy.Publisher("/hric/perception/mocap", MocapData, queue_size=1)
        self.state = rospy.Publisher("/franka_state_controller/franka_states", FrankaState, queue_size=1)
        self.activation = rospy.Publisher("/hric/human/activation", MuscleActivation, queue_size=1)

    def say(self, time: float) -> None:
        """Publish one state, with a contact of 30 N on the forearm."""
        stamp = stamps.to_time(time)
        arm = JointState(name=["arm_joint2"], position=[0.25])
        arm.header.stamp = stamp
        self.joints.publish(arm)
        elbow = JointState(name=["right_el_flex"], position=[1.5])
        elbow.header.stamp = stamp
        self.person.publish(elbow)
        root = PoseStamped()
        root.pose.position.x, root.pose.orientation.w = 0.9, 1.0
        self.root.publish(root)
        contact = RegionContact(link="r_elbow", regions=["lower arm, wrist"], force=30.0, peak=30.0, area=1e-3)
        contact.point.x, contact.normal.z = 0.4, -1.0
        self.contacts.publish(RegionContacts(touching=[contact]))
        self.say_sensors()

    def say_cycle(self, cycle: int) -> None:
        """Publish what is due in a cycle of 5 ms, all values changing."""
        stamp = Header(stamp=stamps.to_time(2.0 + 0.005 * cycle))
        wave = [math.sin(0.01 * cycle + k) for k in range(max(len(PANDA_JOINTS), len(PERSON_JOINTS)))]
        for joints, publisher, every in ((PERSON_JOINTS, self.person, 1), (PANDA_JOINTS, self.joints, 2)):
            if cycle % every == 0:
                values = wave[: len(joints)]
                publisher.publish(JointState(stamp, joints, values, values, values))
        self.activation.publish(MuscleActivation(stamp, NAMES, [], [abs(wave[0])] * len(NAMES), [], []))
        if cycle % 6 == 0:
            self.say_sensors()

    def say_sensors(self) -> None:
        """Publish a marker, the end effector with a force of 40 N on it, and an active muscle."""
        mocap = MocapData(labelled_marker_names=["hand/1"], labelled_marker_ids=[1])
        mocap.header.frame_id, mocap.labelled_markers = "base", [Point(0.5, 0.0, 1.0)]
        self.mocap.publish(mocap)
        state = FrankaState(O_T_EE=[*IDENTITY[:12], 0.3, 0.0, 0.5, 1.0], EE_T_K=IDENTITY)
        state.O_F_ext_hat_K = [-40.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        self.state.publish(state)
        self.activation.publish(MuscleActivation(name=["right_bic"], activation=[0.5]))


@pytest.fixture
def robot(ros: str) -> Iterator[Robot]:  # noqa: F811
    made = Robot()
    yield made
    for publisher in vars(made).values():
        publisher.unregister()


def frames(address: str, robot: Robot) -> Iterator[dict[str, Any]]:
    """Frames of a viewer while the robot says the same again and again."""
    origin, _, query = address.partition("/?")
    with connect(f"{origin.replace('http', 'ws')}/socket?{query}", origin=origin) as viewer:  # type: ignore[arg-type]
        yield json.loads(viewer.recv(20))
        for number in range(400):
            robot.say(2.0 + 0.01 * number)
            yield json.loads(viewer.recv(20))


def test_viewers_get_the_scene_and_what_the_topics_say(address: str, robot: Robot) -> None:
    came = frames(address, robot)
    arm, person = next(came)["data"]["scene"]["robots"]
    assert [joint["name"] for joint in arm["joints"]] == ["arm_joint1", "arm_joint2"] and arm["skin"] is None
    assert "r_wrist" in person["skin"]["links"]
    elbow = next(joint["column"] for joint in person["joints"] if joint["name"] == "right_el_flex")
    frame = next(
        frame
        for frame in came  # the topics are connected one after the other
        if frame["robots"][0]["q"][1] is not None and frame["robots"][1].get("root") and frame.get("forces")
    )
    first, second = frame["robots"]
    assert first["q"] == [None, 0.25] and second["q"][elbow] == 1.5
    assert second["root"] == [0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    assert frame["forces"] == [{"name": "lower arm, wrist", "point": [0.4, 0.0, 0.0], "force": [0.0, 0.0, -30.0]}]
    assert frame["t"] >= 2.0
    came.close()


def test_numbers_that_are_not_finite_are_unknown_and_stop_nothing(address: str, robot: Robot) -> None:
    came = frames(address, robot)
    next(came)
    bad = JointState(name=["arm_joint2"], position=[float("inf")])
    root = PoseStamped()
    root.pose.position.x = float("nan")
    for _ in range(20):
        robot.joints.publish(bad)
        robot.root.publish(root)
    frame = next(frame for frame in came if frame["robots"][0]["q"][1] == 0.25 and "root" in frame["robots"][1])
    assert frame["robots"][1]["root"][0] == 0.9
    came.close()


def test_a_taken_port_ends_the_node_with_one_line(address: str) -> None:
    port = address.partition("/?")[0].rpartition(":")[2]
    node = start(f"_port:={port}", "__name:=second")
    said, _ = node.communicate(timeout=30)
    assert node.returncode == 1 and "Traceback" not in said
    assert f"cannot listen on 127.0.0.1, port {port}: Address already in use; valid:" in said


def test_without_a_description_the_node_ends_with_a_word(ros: str) -> None:  # noqa: F811
    node = start("_port:=0", "_robot_description:=nowhere")
    said, _ = node.communicate(timeout=30)
    assert node.returncode != 0 and "Traceback" not in said and "nowhere" in said
    rospy.delete_param("/window/robot_description")


def processor_time() -> float:
    """Return the processor time of the window's node so far [s]."""
    node: Any = ServerProxy(rosgraph.Master("/test").lookupNode("/window"))
    fields = Path(f"/proc/{node.getPid('/test')[2]}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.slow
@pytest.mark.parametrize("address", [PANDA], indirect=True)
def test_the_traffic_to_a_viewer_is_small(address: str, robot: Robot) -> None:
    """The topics have the rates of a simulation: person 200 Hz, arm 100 Hz, its state 30 Hz."""
    origin, _, query = address.partition("/?")
    with connect(f"{origin.replace('http', 'ws')}/socket?{query}", origin=origin) as viewer:  # type: ignore[arg-type]
        viewer.recv(20)
        robot.say_cycle(0)
        begin, used, sizes, due = time.monotonic(), processor_time(), list[int](), 1
        while (now := time.monotonic() - begin) < SECONDS:
            while due < 200.0 * now:
                robot.say_cycle(due)
                due += 1
            with contextlib.suppress(TimeoutError):
                sizes.append(len(viewer.recv(0.002)))
        share = (processor_time() - used) / SECONDS
    sent, frames = 1e-3 * sum(sizes) / SECONDS, len(sizes) / SECONDS
    print(f"{sent:.1f} kB/s in {frames:.1f} frames per second to a viewer, {100.0 * share:.1f} % of a processor")
    assert 30.0 * sum(sizes) / len(sizes) < LIMIT


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
class TestInABrowser:
    def test_arm_person_and_force_are_drawn_where_they_are(self, address: str, robot: Robot, tmp_path: Path) -> None:
        with Browser(tmp_path) as page:
            page.open_address(address)
            for number in range(100):
                robot.say(2.0 + 0.01 * number)
                if page.evaluate(SHOWN):
                    break
            robots = "report.replay.robots"
            page.evaluate("report.replay.scene.updateMatrixWorld(true)")
            assert page.evaluate(f"{robots}[0].position[{robots}[0].position.length - 1]") == 0.25
            at = page.evaluate(f"{robots}[1].root.getWorldPosition(new THREE.Vector3()).toArray()")
            assert at == pytest.approx([0.9, 0.0, 0.0], abs=1e-6)
            assert page.evaluate(f"{robots}[1].skin.object.visible")
            assert page.evaluate(f"{robots}[0].tracks.map(({{name}}) => name).sort()") == ["end effector", "hand/1"]
            at = page.evaluate(f"{robots}[0].arrows[0].object.getWorldPosition(new THREE.Vector3()).toArray()")
            assert at == pytest.approx([0.3, 0.0, 0.5], abs=1e-6)
            assert page.evaluate(f"{robots}[1].lines.lines[0].material.color.getHexString()") == "b3261e"
            assert page.evaluate(f"JSON.parse({robots}[1].skin.shown)['right lower arm, wrist']") == pytest.approx(0.09)
            page.wait(
                "document.getElementById('link').textContent.startsWith('Nothing new from the arm and the person')"
            )
            assert page.problems == [] and page.requests == []

    def test_a_lost_connection_is_told_and_comes_back(self, ros: str, robot: Robot, tmp_path: Path) -> None:  # noqa: F811
        rospy.set_param("/robot_description", ARM)
        node = start("_port:=0")
        address = opened(node)
        with Browser(tmp_path) as page:
            page.open_address(address)
            page.wait("document.getElementById('link').textContent.startsWith('connected')")
            node.send_signal(signal.SIGINT)
            node.communicate(timeout=30)
            page.wait("document.getElementById('link').textContent.includes('lost')")
        rospy.delete_param("/robot_description")

    def test_curves_and_state_are_told_at_the_shown_time(self, address: str, robot: Robot, tmp_path: Path) -> None:
        with Browser(tmp_path) as page:
            page.open_address(address)
            for number in range(200):
                robot.say(2.0 + 0.01 * number)
                if page.evaluate("report.started === true && report.end > report.begin + 0.5"):
                    break
            page.evaluate("document.querySelector('#signals input').click()")
            page.wait("document.querySelector('#curves figcaption span') !== null")
            assert page.evaluate("document.querySelector('#curves figcaption').textContent").endswith("joint2 0.250  ")
            assert page.evaluate("document.getElementById('near').textContent").endswith(
                "arm_joint2: velocity and effort not known"
            )
            assert page.evaluate("document.getElementById('distance').textContent") == "not known: no supervisor"
            page.evaluate("report.setTime(report.begin - 5)")
            assert page.problems == []
