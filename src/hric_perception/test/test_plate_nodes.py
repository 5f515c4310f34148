"""The nodes `emulated_plate` and `force_plate` as processes: over LSL with a pushing load, and over NatNet pressed by
contacts of a simulation."""

import os

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, Vector3, Wrench, WrenchStamped
from real_master import free_port, ros, roscore
from sensor_nodes import LIMIT, Nodes, TellsTime, TopicActivation, nodes, run, wait
from tf2_msgs.msg import TFMessage

from gazebo_msgs.msg import ContactsState, ContactState
from hric_core.robot_time import stamps

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]


def listen(topic: str, kind: type) -> list:
    import rospy

    seen: list = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=None)
    return seen


def test_over_lsl_samples_wrench_and_centre_of_pressure_have_the_times_of_the_run(run: TellsTime, nodes: Nodes) -> None:
    session = f"test_plate_{os.getpid()}"
    samples = TopicActivation("/hric/perception/force_plate/left/samples")
    wrenches, points = (
        listen("/hric/perception/force_plate/left/wrench", WrenchStamped),
        listen("/hric/perception/force_plate/left/cop", PointStamped),
    )
    load = "_load:={program: push, force: 200, point: [0.1, -0.05], period: 1.0}"
    device = nodes.start("emulated_plate", f"_session:={session}", load, "_faults:={time_code: true, noise: 0.1}")
    driver = nodes.start("force_plate", f"_lsl:={{session: {session}}}", "_id:=left")
    wait(lambda: samples.chunks and samples.end > samples.chunks[0].start + 2.5)
    assert "Traceback" not in nodes.end(device) + nodes.end(driver)
    samples.close()
    late = [chunk for chunk in samples.chunks if chunk.start > samples.chunks[0].start + 0.5]
    assert late[0].layout.rate == 1000.0 and late[0].layout.frame == "force_plate_left"
    assert (
        late[0].layout.units == ("N", "N", "N", "N m", "N m", "N m", "s")
        and late[0].layout.unit == "N N N N*m N*m N*m s"
    )
    assert max(float(np.abs(chunk.times - chunk.data[:, -1]).max()) for chunk in late) < 2e-4
    truth = [-100 * (1 - np.cos(2 * np.pi * message.header.stamp.to_sec())) for message in wrenches]
    assert np.abs(np.array(truth) - [message.wrench.force.z for message in wrenches]).max() < 1.0
    assert len(points) > 50 and len(points) < len(wrenches)
    far = [message for message in points if 0.3 < message.header.stamp.to_sec() % 1.0 < 0.7]
    assert far and max(abs(message.point.x - 0.1) + abs(message.point.y + 0.05) for message in far) < 5e-3


def test_over_natnet_the_plate_measures_what_presses_on_it_in_the_simulation_and_publishes_its_pose(
    run: TellsTime, nodes: Nodes
) -> None:
    import rospy

    ports = f"command_port: {free_port()}, data_port: {free_port()}"
    samples, frames = TopicActivation("/hric/perception/force_plate/1/samples"), listen("/tf_static", TFMessage)
    points = listen("/hric/perception/force_plate/1/cop", PointStamped)
    contacts = rospy.Publisher("/sim/contacts", ContactsState, queue_size=100)
    where = "_pose:={xyz: [0.5, 0, 0.05]}"
    stream = f"_natnet:={{{ports}, rate: 200, latency: 0.06}}"
    nodes.start("emulated_plate", "_transport:=natnet", "_load:={program: contacts, body: plate}", where, stream)
    nodes.start("force_plate", "_source:=natnet", f"_natnet:={{{ports}}}")
    wait(lambda: len(samples.chunks) > 20)
    state = ContactState(collision1_name="panda::panda_hand", collision2_name="plate::link")
    state.contact_positions, state.wrenches = [Vector3(0.6, 0.1, 0.05)], [Wrench(force=Vector3(0, 0, 80))]
    began = run.time

    due = [began]

    def press() -> bool:
        """As the simulation: each 10 ms of robot time."""
        while due[0] <= run.time:
            message = ContactsState(states=[state])
            message.header.stamp = stamps.to_time(due[0])
            contacts.publish(message)
            due[0] += 0.01
        return len(points) > 50

    wait(press)
    samples.close()
    contacts.unregister()
    pressed = [chunk for chunk in samples.chunks if chunk.start > began + 0.3]
    assert pressed and np.allclose(pressed[0].data[:, :3], [0, 0, -80])
    assert (points[-1].point.x, points[-1].point.y) == pytest.approx((0.1, 0.1), abs=1e-4)
    (placed,) = [one for message in frames for one in message.transforms if one.child_frame_id == "force_plate_1"][-1:]
    assert placed.header.frame_id == "mocap"
    assert (placed.transform.translation.x, placed.transform.translation.z) == pytest.approx((0.5, 0.05), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "argument", "words"),
    [
        ("force_plate", "_id:=a/b", "id is 'a/b'; valid: letters"),
        (
            "emulated_plate",
            "_load:={program: fly}",
            "no program 'fly' in /wrong/load; valid: body, c3d, constant, contacts, push",
        ),
    ],
)
def test_a_wrong_parameter_ends_a_node_with_one_line(
    ros: str, nodes: Nodes, name: str, argument: str, words: str
) -> None:
    process = nodes.start(name, "__name:=wrong", argument)
    output = process.communicate(timeout=LIMIT)[0]
    assert process.returncode == 2 and words in output and "Traceback" not in output
