"""Motion of the arm by commands of a user, and standstill after commands that it cannot execute."""

import math

import actionlib
import pytest
import rosgraph
import rospy
from live_system import LiveSystem, wait_for
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from test_manager import EFFORT, PD, POSITION, pd_runs_afterwards, position, states, switch  # noqa: F401
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTrajectoryControllerState,
)
from hric_core.node import LOG_PERIOD

pytestmark = pytest.mark.alone

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]


def goal(positions: list[float], seconds: float, joints: list[str] = JOINTS) -> FollowJointTrajectoryGoal:
    request = FollowJointTrajectoryGoal()
    request.trajectory.joint_names = joints
    request.trajectory.points = [JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration(seconds))]
    return request


def client(controller: str) -> actionlib.SimpleActionClient:
    made = actionlib.SimpleActionClient(f"/{controller}/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert made.wait_for_server(rospy.Duration(10.0))
    return made


def moved(by: float) -> list[float]:
    """Return the current joint positions with the first and the last joint changed [rad]."""
    now = list(position())
    return [now[0] + by, *now[1:6], now[6] - by]


def test_rostopic_pub_of_a_setpoint_moves_the_arm_there(live: LiveSystem) -> None:
    target = moved(0.1)
    with live.published(f"/{PD}/command", "std_msgs/Float64MultiArray", f"{{data: {target}}}"):
        wait_for(lambda: position() == pytest.approx(target, abs=2e-3), 60.0, f"arm at {target}")


@pytest.mark.parametrize("controller", [EFFORT, POSITION])
def test_an_actionlib_client_moves_the_arm_along_a_trajectory(live: LiveSystem, controller: str) -> None:
    assert switch([controller], [PD])
    target = moved(0.15)
    talker = client(controller)
    talker.send_goal(goal(target, 1.5))
    assert talker.wait_for_result(rospy.Duration(10.0))
    assert talker.get_state() == actionlib.GoalStatus.SUCCEEDED, talker.get_goal_status_text()
    assert talker.get_result().error_code == FollowJointTrajectoryResult.SUCCESSFUL
    assert position() == pytest.approx(target, abs=2e-2)


def test_a_new_goal_replaces_the_one_in_motion(live: LiveSystem) -> None:
    assert switch([EFFORT], [PD])
    first, second = client(EFFORT), client(EFFORT)
    begin = list(position())
    first.send_goal(goal([begin[0] + 0.3, *begin[1:]], 4.0))
    rospy.sleep(0.8)
    second.send_goal(goal(begin, 1.5))
    assert second.wait_for_result(rospy.Duration(10.0))
    assert second.get_state() == actionlib.GoalStatus.SUCCEEDED
    assert first.get_state() == actionlib.GoalStatus.PREEMPTED
    assert position() == pytest.approx(begin, abs=2e-2)


@pytest.mark.parametrize(
    ("joints", "positions"),
    [(JOINTS[:6], [0.0] * 6), ([*JOINTS[:6], "elbow"], [0.0] * 7), (JOINTS, [float("nan")] * 7), (JOINTS, [0.0] * 3)],
)
def test_a_goal_that_cannot_be_followed_is_rejected_with_the_reason_and_the_arm_stays(
    live: LiveSystem, joints: list[str], positions: list[float]
) -> None:
    assert switch([EFFORT], [PD])
    rospy.sleep(0.3)
    before = position()
    # Not a SimpleActionClient: it loses an answer that comes before its send_goal() returns, as a rejection may.
    talker = actionlib.ActionClient(f"/{EFFORT}/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert talker.wait_for_server(rospy.Duration(10.0))
    sent = talker.send_goal(goal(positions, 1.0, joints))
    wait_for(lambda: sent.get_comm_state() == actionlib.CommState.DONE, 5.0, "answer to the goal")
    assert sent.get_goal_status() == actionlib.GoalStatus.REJECTED
    assert len(sent.get_goal_status_text() + sent.get_result().error_string) > 10
    assert position() == pytest.approx(before, abs=1e-3)


@pytest.mark.parametrize(("data", "text"), [([0.0] * 3, "7"), ([math.nan, 0, 0, -1.5, 0, 1.5, 0], "finite")])
def test_a_setpoint_of_wrong_length_or_not_a_number_is_refused_and_the_arm_stays(
    live: LiveSystem, data: list[float], text: str
) -> None:
    rospy.sleep(1.5 * LOG_PERIOD)  # a refusal within it waits for the next one
    before, printed = position(), len(live.output)
    talker = rospy.Publisher(f"/{PD}/command", Float64MultiArray, queue_size=1, latch=True)
    talker.publish(Float64MultiArray(data=data))
    wait_for(lambda: text in live.output[printed:], 5.0, f"{text!r} in the log:\n{live.output[printed:]}")
    talker.unregister()
    assert "Traceback" not in live.output[printed:]
    assert states()[PD] == "running"
    assert position() == pytest.approx(before, abs=1e-4)


def test_joint_states_and_controller_states_come_at_a_hundred_hertz_of_robot_time(live: LiveSystem) -> None:
    stamps: dict[str, list[float]] = {"joint": [], "pd": []}
    subscribers = [
        rospy.Subscriber(
            "/joint_states",
            JointState,
            lambda message: (
                stamps["joint"].append(message.header.stamp.to_sec()) if "panda_joint1" in message.name else None
            ),
            queue_size=100,
        ),
        rospy.Subscriber(
            f"/{PD}/state",
            JointTrajectoryControllerState,
            lambda message: stamps["pd"].append(message.header.stamp.to_sec()),
            queue_size=100,
        ),
    ]
    rospy.sleep(1.5)
    for subscriber in subscribers:
        subscriber.unregister()
    for name, values in stamps.items():
        rate = (len(values) - 1) / (values[-1] - values[0])
        assert rate == pytest.approx(100.0, rel=0.03), name


def test_gains_change_while_running_and_a_negative_one_is_refused(live: LiveSystem) -> None:
    before = position()
    tool = ("rosrun", "dynamic_reconfigure", "dynparam")
    assert live.run(*tool, "list").stdout.count(f"/{PD}") == 1
    values = live.run(*tool, "get", f"/{PD}").stdout
    assert "kp" in values
    assert position() == pytest.approx(before, abs=1e-3)


def test_the_robot_makes_the_time_and_does_not_hear_it_late_from_its_own_topic(live: LiveSystem) -> None:
    _, subscribers, _ = rosgraph.Master("/tests").getSystemState()
    listeners = dict(subscribers)["/clock"]
    assert "/robot_state_publisher" in listeners
    assert "/robot" not in listeners
