"""The node `franka_gripper` on libfranka and an emulated control box, asked by actionlib's own clients."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import actionlib
import pytest
from actionlib_msgs.msg import GoalStatus
from fci_peer import control_box, new_address
from real_master import end_nodes, ros, roscore

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


@contextmanager
def running(*arguments):

    process = subprocess.Popen(
        [sys.executable, str(NODE), *arguments],
        env=os.environ | {"ROS_NAMESPACE": "/real"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        end_nodes(process)


def client(name, kind):
    import rospy

    made = actionlib.SimpleActionClient(f"/real/franka_gripper/{name}", kind)
    assert made.wait_for_server(rospy.Duration(LIMIT))
    return made


def sent(made, goal):
    import rospy

    made.send_goal(goal)
    assert made.wait_for_result(rospy.Duration(LIMIT))
    return made.get_state(), made.get_result().success


def grasp(width):
    goal = GraspGoal(width=width, speed=0.1, force=10.0)
    goal.epsilon.inner = goal.epsilon.outer = 0.005
    return goal


@pytest.mark.parametrize("library", ["panda_py", "pylibfranka"])
def test_the_actions_home_move_grasp_miss_and_refuse_through_libfranka(ros, library):
    with control_box("--constant", "--console") as (ip, box), running(f"_robot_ip:={ip}", f"_library:={library}"):
        move, hold = client("move", MoveAction), client("grasp", GraspAction)
        assert sent(client("homing", HomingAction), HomingGoal()) == (GoalStatus.SUCCEEDED, True)
        assert sent(move, MoveGoal(width=0.06, speed=0.1)) == (GoalStatus.SUCCEEDED, True)
        box.stdin.write("object 0.03\n")
        box.stdin.flush()
        assert sent(hold, grasp(0.03)) == (GoalStatus.SUCCEEDED, True)
        assert sent(hold, grasp(0.01)) == (GoalStatus.SUCCEEDED, False)
        assert sent(client("stop", StopAction), StopGoal()) == (GoalStatus.SUCCEEDED, True)
        assert sent(move, MoveGoal(width=0.5, speed=0.1)) == (GoalStatus.ABORTED, False)


def test_stop_and_cancel_end_a_motion_through_libfranka(ros):
    import rospy

    with control_box("--constant") as (ip, _), running(f"_robot_ip:={ip}"):
        move, stop = client("move", MoveAction), client("stop", StopAction)
        move.send_goal(MoveGoal(width=0.0, speed=0.001))
        rospy.sleep(0.5)
        assert sent(stop, StopGoal()) == (GoalStatus.SUCCEEDED, True)
        assert move.wait_for_result(rospy.Duration(LIMIT))
        assert move.get_state() == GoalStatus.ABORTED
        move.send_goal(MoveGoal(width=0.0, speed=0.001))
        rospy.sleep(0.5)
        move.cancel_goal()
        assert move.wait_for_result(rospy.Duration(LIMIT))
        assert move.get_state() == GoalStatus.PREEMPTED


def test_a_wrong_address_ends_it_with_one_clear_line(ros):
    address = new_address()
    with running(f"_robot_ip:={address}") as process:
        output, _ = process.communicate(timeout=LIMIT)
        assert process.returncode == 1
        assert address in output and "1338" in output
        assert "Traceback" not in output
