"""The node `equilibrium_marker` with the simulated arm, live: the topics of rviz's client move the equilibrium."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from real_master import end_nodes, ros, roscore
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit, InteractiveMarkerUpdate

import panda_description
from controller_manager_msgs.srv import LoadController, SwitchController

__all__ = ["ros", "roscore"]
pytestmark = pytest.mark.alone

SRC = Path(__file__).parents[2]
NAME = "cartesian_impedance_controller"
LIMIT = 60.0
"""For a busy machine [s]."""


def wait(condition):
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def listen(topic, kind):
    import rospy

    seen = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=100)
    return seen


@pytest.fixture
def arm(ros):
    """Start the simulated arm with the controller; yield a function that starts further nodes."""
    import rospy

    configured = (SRC / "hric_bringup/config/controllers.yaml").read_text().replace("$(arg arm_id)", "panda")
    rospy.set_param("/robot_description", panda_description.load(arm_id="panda", meshes=False))
    rospy.set_param(f"/{NAME}", yaml.safe_load(configured)[NAME])
    plant = {"collision": False, "self_collision": False}
    rospy.set_param("/robot", {"robot_hw": "franka_sim/FrankaHWSim", "arm_id": "panda", "plant": plant})
    processes = []

    def start(path, *arguments):
        words = [sys.executable, str(SRC / path), *arguments]
        processes.append(subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
        return processes[-1]

    start("hric_control/nodes/robot", "__name:=robot")
    for name in ("load", "switch"):
        rospy.wait_for_service(f"/controller_manager/{name}_controller", LIMIT)
    assert rospy.ServiceProxy("/controller_manager/load_controller", LoadController)(NAME).ok
    switch = rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)
    assert switch(start_controllers=[NAME], stop_controllers=[], strictness=2, start_asap=True, timeout=0.0).ok
    yield start
    for process, output in zip(processes, end_nodes(*processes), strict=True):
        print(process.args, output)
        assert "Traceback" not in output


def test_a_dragged_marker_moves_the_arm_and_a_released_one_follows_the_equilibrium(arm):
    import rospy

    shown, updates = listen("/equilibrium_marker/update_full", InteractiveMarkerInit), []
    rospy.Subscriber("/equilibrium_marker/update", InteractiveMarkerUpdate, updates.append, queue_size=100)
    sent, measured = listen(f"/{NAME}/equilibrium_pose", PoseStamped), listen(f"/{NAME}/measured_pose", PoseStamped)
    wait(lambda: measured)
    arm("hric_controllers/nodes/equilibrium_marker")
    wait(lambda: shown and shown[-1].markers)
    (marker,) = shown[-1].markers
    start = measured[-1].pose.position
    assert marker.header.frame_id == "panda_link0" and marker.pose.position.z == pytest.approx(start.z, abs=1e-3)
    assert sorted(control.name for control in marker.controls) == [
        *(f"move_{axis}" for axis in "xyz"),
        *(f"turn_{axis}" for axis in "xyz"),
    ]
    client = rospy.Publisher("/equilibrium_marker/feedback", InteractiveMarkerFeedback, queue_size=10)
    wait(client.get_num_connections)
    feedback = InteractiveMarkerFeedback(client_id="/rviz", marker_name=marker.name, control_name="move_x")
    feedback.header.frame_id, feedback.pose = "panda_link0", marker.pose
    time.sleep(1.1)  # for its first second, interactive_markers takes a marker for one that another client drags
    feedback.event_type = InteractiveMarkerFeedback.MOUSE_DOWN
    client.publish(feedback)
    feedback.event_type = InteractiveMarkerFeedback.POSE_UPDATE
    for _ in range(5):
        feedback.pose.position.x += 0.01
        client.publish(feedback)
        time.sleep(0.05)
    feedback.event_type = InteractiveMarkerFeedback.MOUSE_UP
    client.publish(feedback)
    wait(lambda: len(sent) >= 5)
    assert sent[-1].header.frame_id == "panda_link0"
    assert sent[-1].pose.position.x == pytest.approx(start.x + 0.05, abs=1e-3)
    wait(lambda: measured[-1].pose.position.x > start.x + 0.045)
    wait(lambda: updates and updates[-1].poses and updates[-1].poses[0].pose.position.x > start.x + 0.049)
    assert not any(update.erases for update in updates)
