"""The node `franka_gripper` as a process under a master, asked by actionlib's own clients."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import actionlib
import pytest
from actionlib_msgs.msg import GoalStatus
from real_master import end_nodes, ros, roscore

from control_msgs.msg import GripperCommandAction, GripperCommandGoal
from franka_gripper.msg import (
    GraspAction,
    GraspGoal,
    HomingAction,
    HomingGoal,
    MoveAction,
    MoveGoal,
    StopAction,
    StopGoal,
)

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "franka_gripper"
LIMIT = 30.0


class Node:
    def __init__(self, *arguments):
        environment = os.environ | {"ROS_NAMESPACE": "/grip"}
        self.process = subprocess.Popen(
            [sys.executable, str(NODE), *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def client(self, name, kind):
        import rospy

        client = actionlib.SimpleActionClient(f"/grip/franka_gripper/{name}", kind)
        assert client.wait_for_server(rospy.Duration(LIMIT))
        return client

    def end(self):
        self.process.send_signal(signal.SIGINT)
        begin = time.monotonic()
        output, _ = self.process.communicate(timeout=LIMIT)
        return time.monotonic() - begin, output


@pytest.fixture
def node(ros):

    node = Node()
    yield node
    end_nodes(node.process)


def sent(client, goal):
    import rospy

    client.send_goal(goal)
    assert client.wait_for_result(rospy.Duration(LIMIT))
    return client.get_state(), client.get_result()


def grasp(width):
    goal = GraspGoal(width=width, speed=0.1, force=10.0)
    goal.epsilon.inner = goal.epsilon.outer = 0.005
    return goal


def test_actionlib_clients_home_move_grasp_miss_stop_and_command(node):
    import rospy
    from dynamic_reconfigure.client import Client
    from sensor_msgs.msg import JointState

    move, hold = node.client("move", MoveAction), node.client("grasp", GraspAction)
    state, result = sent(node.client("homing", HomingAction), HomingGoal())
    assert (state, result.success) == (GoalStatus.SUCCEEDED, True)
    state, result = sent(move, MoveGoal(width=0.05, speed=0.1))
    assert (state, result.success) == (GoalStatus.SUCCEEDED, True)
    message = rospy.wait_for_message("/grip/franka_gripper/joint_states", JointState, LIMIT)
    assert list(message.position) == pytest.approx([0.025, 0.025])
    Client("/grip/franka_gripper", timeout=LIMIT).update_configuration({"object_width": 0.03})
    state, result = sent(hold, grasp(0.03))
    assert (state, result.success) == (GoalStatus.SUCCEEDED, True)
    state, result = sent(hold, grasp(0.01))
    assert (state, result.success) == (GoalStatus.SUCCEEDED, False)
    goal = GripperCommandGoal()
    goal.command.position = 0.04
    state, result = sent(node.client("gripper_action", GripperCommandAction), goal)
    assert (state, result.reached_goal, result.position) == (GoalStatus.SUCCEEDED, True, 0.08)
    state, result = sent(move, MoveGoal(width=0.5, speed=0.1))
    assert (state, result.success) == (GoalStatus.ABORTED, False)
    assert "valid: 0 to 0.08 m" in result.error


def test_all_that_the_node_offers_stands_on_the_page_and_the_page_promises_no_more(node):
    import rosgraph

    node.client("gripper_action", GripperCommandAction)
    page = (Path(__file__).parents[2] / "franka_gripper" / "INTERFACE.md").read_text()
    tables = page[page.index("## Actions") : page.index("## Parameters")].splitlines()
    wanted = {
        line.split("|")[1].strip(" `").removeprefix("franka_gripper/") for line in tables if line.startswith("| `")
    }
    publishers, _, services = rosgraph.Master("/page").getSystemState()
    base = "/grip/franka_gripper/"
    topics = {name.removeprefix(base) for name, _ in publishers if name.startswith(base)}
    offered = {name.removesuffix("/status") for name in topics if name.endswith("/status")} | {
        name for name in topics if "/" not in name
    }
    offered |= {name.removeprefix(base) for name, _ in services if name.startswith(base)}
    assert offered - {"get_loggers", "set_logger_level"} == wanted


def test_stop_and_cancel_end_a_motion(node):
    import rospy

    move, stop = node.client("move", MoveAction), node.client("stop", StopAction)
    move.send_goal(MoveGoal(width=0.0, speed=0.001))
    rospy.sleep(0.3)
    state, result = sent(stop, StopGoal())
    assert (state, result.success) == (GoalStatus.SUCCEEDED, True)
    assert move.wait_for_result(rospy.Duration(LIMIT))
    assert move.get_state() == GoalStatus.ABORTED
    move.send_goal(MoveGoal(width=0.0, speed=0.001))
    rospy.sleep(0.3)
    move.cancel_goal()
    assert move.wait_for_result(rospy.Duration(LIMIT))
    assert move.get_state() == GoalStatus.PREEMPTED


@pytest.mark.parametrize(
    "action", ["homing", "gripper_action"]
)  # the first and the last that it offers: while it starts, and when it is up
def test_it_ends_on_ctrl_c_without_a_traceback(node, action):
    node.client(action, HomingAction if action == "homing" else GripperCommandAction)
    node.client("move", MoveAction).send_goal(MoveGoal(width=0.0, speed=0.001))
    _, output = node.end()
    assert node.process.returncode == 0, output
    assert "Traceback" not in output


def test_a_bad_parameter_ends_it_with_one_clear_line(ros):
    node = Node("_publish_rate:=-1")
    output, _ = node.process.communicate(timeout=LIMIT)
    assert node.process.returncode == 2
    assert "/grip/franka_gripper/publish_rate is -1; valid: a finite number above 0" in output
    assert "Traceback" not in output


def test_help_needs_no_master():
    done = subprocess.run(
        [sys.executable, str(NODE), "--help"],
        env=os.environ | {"ROS_MASTER_URI": "http://127.0.0.1:1"},
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0
    assert "rosrun franka_sim franka_gripper" in done.stdout
