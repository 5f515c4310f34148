import itertools
import logging
import math

import pytest
import yaml
from controllers_rig import DT, Lab
from genpy import Duration, Time
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import FollowJointTrajectoryGoal, FollowJointTrajectoryResult, JointTolerance
from control_msgs.srv import QueryTrajectoryStateRequest
from hric_core.errors import HricError

GAINS = {"a": {"p": 400.0, "d": 40.0}, "b": {"p": 400.0, "d": 40.0}}
KINDS = {
    "effort": "effort_controllers/JointTrajectoryController",
    "position": "position_controllers/JointTrajectoryController",
}
R = FollowJointTrajectoryResult


def lab(kind="effort", start=True, description="", joints=("a", "b"), **extra):
    params = {"jt": {"type": KINDS[kind], "joints": list(joints), "constraints": {"goal_time": 0.5}, **extra}}
    if kind == "effort":
        params["jt"].setdefault("gains", GAINS)
    if description:
        params["robot_description"] = description
    return Lab(params).load("jt", start)


def point(time, positions, velocities=(), accelerations=()):
    return JointTrajectoryPoint(
        positions=list(positions),
        velocities=list(velocities),
        accelerations=list(accelerations),
        time_from_start=Duration.from_sec(time),
    )


def trajectory(*points, joints=("a", "b"), stamp=0.0):
    message = JointTrajectory(joint_names=list(joints), points=list(points))
    message.header.stamp = Time.from_sec(stamp)
    return message


def goal(*points, **fields):
    names = {key: fields.pop(key) for key in ("joints", "stamp") if key in fields}
    return FollowJointTrajectoryGoal(trajectory=trajectory(*points, **names), **fields)


def act(bench, message):
    return bench.node.send_goal("jt/follow_joint_trajectory", message)


def rest(*positions, time=1.0):
    return point(time, positions, [0.0] * len(positions), [0.0] * len(positions))


def positions(bench):
    return bench.hw.states.position


@pytest.mark.parametrize("kind", KINDS)
def test_a_goal_is_reached_and_succeeds_when_the_trajectory_ends(kind):
    bench = lab(kind).run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.9)
    assert client.status == "ACTIVE"
    bench.run(0.5)
    assert client.status == "SUCCEEDED"
    assert client.result.error_code == R.SUCCESSFUL
    assert positions(bench) == pytest.approx([0.5, -0.3], abs=5e-3)


def test_the_command_topic_moves_the_joints():
    bench = lab().run(0.1)
    bench.send("jt/command", trajectory(rest(0.5, -0.3)))
    bench.run(2.0)
    assert positions(bench) == pytest.approx([0.5, -0.3], abs=1e-4)


def test_joints_may_come_in_any_order():
    bench = lab("position").run(0.1)
    act(bench, goal(rest(-0.3, 0.5), joints=("b", "a")))
    bench.run(1.5)
    assert positions(bench) == pytest.approx([0.5, -0.3])


def test_a_position_goal_follows_the_quintic_through_all_points():
    bench = lab("position").run(0.1)
    act(bench, goal(point(0.5, [0.2, 0.1], [0.3, 0.0], [0.0, 0.0]), rest(0.5, -0.3)))
    bench.run(0.501)
    assert positions(bench) == pytest.approx([0.2, 0.1], abs=1e-9)


def test_before_any_goal_the_joints_are_held_where_they_are():
    bench = lab("position", start=False)
    bench.hw.states.position[:] = [0.2, 0.4]
    bench.manager.switch(["jt"], [])
    assert positions(bench.run(0.2)) == [0.2, 0.4]


def test_a_goal_with_a_future_stamp_starts_then():
    bench = lab("position").run(0.1)
    client = act(bench, goal(rest(0.5, -0.3), stamp=1.1))
    bench.run(1.0)
    assert positions(bench) == [0.0, 0.0]
    bench.run(1.01)
    assert client.status == "SUCCEEDED"
    assert positions(bench) == pytest.approx([0.5, -0.3])


def test_points_in_the_past_are_left_out():
    bench = lab("position").run(1.0)
    client = act(bench, goal(rest(9.0, 9.0, time=0.5), rest(0.5, -0.3, time=2.0), stamp=0.2))
    bench.run(1.5)
    assert client.status == "SUCCEEDED"
    assert max(row[1][0] for row in bench.history) <= 0.5 + 1e-9


def test_a_trajectory_that_is_past_altogether_is_refused_as_too_old():
    bench = lab("position").run(2.0)
    client = act(bench, goal(rest(0.5, -0.3), stamp=0.5))
    assert client.status == "REJECTED"
    assert client.result.error_code == R.OLD_HEADER_TIMESTAMP
    assert "0.5 s in the past" in client.result.error_string


def test_a_new_goal_in_motion_replaces_the_old_one_without_a_jump():
    bench = lab("position", state_publish_rate=1000).run(0.1)
    first = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    second = act(bench, goal(rest(-0.5, 0.3)))
    assert first.status == "PREEMPTED"
    bench.run(1.2)
    assert second.status == "SUCCEEDED"
    points = [message.desired for message in bench.published("/jt/state")]
    for before, now in itertools.pairwise(points):
        for i in range(2):
            assert abs(now.positions[i] - before.positions[i]) < 3.0 * DT
            assert abs(now.velocities[i] - before.velocities[i]) < 20.0 * DT
            assert abs(now.accelerations[i] - before.accelerations[i]) < 300.0 * DT


def test_a_replacement_in_the_future_lets_the_motion_go_on_until_then():
    bench = lab("position").run(0.1)
    act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.2)
    act(bench, goal(rest(-0.5, 0.3, time=0.5), stamp=0.8))
    before = positions(bench)[0]
    bench.run(0.49)
    assert positions(bench)[0] > before + 0.1
    bench.run(0.6)
    assert positions(bench) == pytest.approx([-0.5, 0.3])


def test_a_command_on_the_topic_replaces_a_goal():
    bench = lab("position").run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.2)
    bench.send("jt/command", trajectory(rest(0.0, 0.0)))
    assert client.status == "PREEMPTED"
    assert positions(bench.run(1.1)) == pytest.approx([0.0, 0.0])


def test_cancelling_brings_the_joints_smoothly_to_rest():
    bench = lab("position", stop_trajectory_duration=0.2).run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    speed = bench.hw.states.velocity[0]
    client.cancel()
    assert client.status == "PREEMPTED"
    bench.run(0.1)
    assert bench.hw.states.velocity[0] == pytest.approx(speed / 2, rel=0.05)
    bench.run(0.15)
    held = list(positions(bench))
    assert bench.run(0.5).hw.states.position == held


def test_an_empty_trajectory_stops_the_joints():
    bench = lab("position").run(0.1)
    first = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    bench.send("jt/command", trajectory())
    assert first.status == "PREEMPTED"
    held = list(bench.run(0.6).hw.states.position)
    assert 0.2 < held[0] < 0.5
    assert bench.run(0.5).hw.states.position == held


def test_an_empty_goal_stops_the_joints_and_succeeds():
    bench = lab("position").run(0.1)
    act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    assert act(bench, goal()).status == "SUCCEEDED"
    held = list(bench.run(0.6).hw.states.position)
    assert bench.run(0.5).hw.states.position == held


def test_leaving_the_path_aborts_and_names_joint_and_numbers():
    bench = lab(constraints={"a": {"trajectory": 0.05}, "goal_time": 0.5}).run(0.1)
    bench.hw.blocked = True
    client = act(bench, goal(rest(0.5, 0.0)))
    bench.run(1.0)
    assert client.status == "ABORTED"
    assert client.result.error_code == R.PATH_TOLERANCE_VIOLATED
    assert client.result.error_string.startswith("path tolerance: a: position error 0.05")
    assert client.result.error_string.endswith("exceeds 0.05")


@pytest.mark.parametrize("constraints", [{"a": {"trajectory": 0.05}, "goal_time": 0.5}, {"goal_time": 0.0}])
def test_a_reflex_of_the_arm_aborts_the_goal_at_once_by_its_name(constraints):
    bench = lab(constraints=constraints).run(0.1)
    client = act(bench, goal(rest(0.5, 0.0)))
    bench.run(0.2)
    bench.hw.blocked, bench.hw.error = True, "the motion was aborted: joint_reflex"
    bench.run(0.01)
    assert client.status == "ABORTED" and client.result.error_code == R.PATH_TOLERANCE_VIOLATED
    assert client.result.error_string == "the robot stopped: the motion was aborted: joint_reflex"
    again = act(bench, goal(rest(0.5, 0.0)))
    bench.run(0.01)
    assert again.status == "ABORTED" and "joint_reflex" in again.result.error_string
    bench.hw.blocked, bench.hw.error = False, ""
    assert act(bench.run(0.1), goal(rest(0.0, 0.0))).status == "ACTIVE"


def test_after_leaving_the_path_the_desired_state_comes_to_rest():
    bench = lab(constraints={"a": {"trajectory": 0.05}}, stop_trajectory_duration=0.1).run(0.1)
    bench.hw.blocked = True
    act(bench, goal(rest(0.5, 0.0)))
    bench.run(1.0)
    assert bench.published("/jt/state")[-1].desired.positions[0] < 0.15


def test_a_missed_goal_aborts_after_the_goal_time_and_names_joint_and_numbers():
    bench = lab(constraints={"a": {"goal": 0.01}, "goal_time": 0.3}).run(0.1)
    bench.hw.blocked = True
    client = act(bench, goal(rest(0.5, 0.0)))
    bench.run(1.25)
    assert client.status == "ACTIVE"
    bench.run(0.1)
    assert client.status == "ABORTED"
    assert client.result.error_code == R.GOAL_TOLERANCE_VIOLATED
    assert "a: position error 0.5 exceeds 0.01" in client.result.error_string


def test_tolerances_in_the_goal_go_before_those_of_the_yaml():
    bench = lab(constraints={"a": {"goal": 0.01}, "goal_time": 0.1}).run(0.1)
    bench.hw.blocked = True
    client = act(bench, goal(rest(0.5, 0.0), goal_tolerance=[JointTolerance(name="a", position=-1.0)]))
    assert bench.run(1.2) and client.status == "SUCCEEDED"


def refused(bench, message):
    client = act(bench, message)
    assert client.status == "REJECTED"
    return client.result


@pytest.mark.parametrize(
    ("message", "code", "words"),
    [
        (goal(rest(0.1, 0.2), joints=("a", "z")), R.INVALID_JOINTS, "unknown z; missing b; valid: a, b"),
        (goal(rest(0.1), joints=("a",)), R.INVALID_JOINTS, "missing b"),
        (goal(rest(0.1, 0.2), joints=("a", "a")), R.INVALID_JOINTS, "named twice"),
        (goal(rest(math.nan, 0.2)), R.INVALID_GOAL, "points[0].positions has a nan; valid: finite numbers"),
        (goal(point(1.0, [0.1, 0.2], [math.inf, 0.0])), R.INVALID_GOAL, "points[0].velocities has a inf"),
        (goal(rest(0.1)), R.INVALID_GOAL, "points[0].positions has 1 values; valid: 2 values"),
        (goal(point(1.0, [0.1, 0.2], [0.0])), R.INVALID_GOAL, "points[0].velocities has 1 values"),
        (goal(point(1.0, [], [0.0, 0.0])), R.INVALID_GOAL, "points[0].positions has 0 values"),
        (goal(rest(0.1, 0.2), rest(0.2, 0.3)), R.INVALID_GOAL, "points[1].time_from_start is 1 s; valid: after 1 s"),
        (goal(rest(0.1, 0.2, time=-1.0)), R.INVALID_GOAL, "points[0].time_from_start is -1 s; valid: 0 s or later"),
        (goal(rest(0.1, 0.2, time=0.0)), R.INVALID_GOAL, "valid: in the future"),
        (
            goal(rest(0.1, 0.2), path_tolerance=[JointTolerance(name="z")]),
            R.INVALID_GOAL,
            "path_tolerance names z; valid: a, b",
        ),
    ],
)
def test_a_bad_goal_is_refused_with_code_and_reason_and_the_joints_stay(message, code, words):
    bench = lab("position").run(0.1)
    result = refused(bench, message)
    assert result.error_code == code
    assert words in result.error_string
    assert positions(bench.run(0.5)) == [0.0, 0.0]


def test_a_refused_goal_leaves_the_running_one_alone():
    bench = lab("position").run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    refused(bench, goal(rest(0.1)))
    bench.run(0.6)
    assert client.status == "SUCCEEDED"


def test_a_bad_command_gives_one_clear_error_and_the_joints_stay(caplog):
    bench = lab("position").run(0.1)
    with caplog.at_level(logging.ERROR, "hric"):
        bench.send("jt/command", trajectory(rest(math.nan, 0.2)))
    assert len(caplog.records) == 1
    assert "/jt/command" in caplog.records[0].getMessage()
    assert positions(bench.run(0.5)) == [0.0, 0.0]


def test_a_goal_while_stopped_is_refused():
    result = refused(lab(start=False), goal(rest(0.1, 0.2)))
    assert "/jt is not running" in result.error_string


def test_stopping_the_controller_ends_the_goal():
    bench = lab("position").run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.2)
    bench.manager.switch([], ["jt"])
    assert client.status == "PREEMPTED"
    assert "stopped" in client.text


def test_part_of_the_joints_may_be_named_when_that_is_allowed():
    bench = lab("position", allow_partial_joints_goal=True).run(0.1)
    client = act(bench, goal(rest(0.4), joints=("b",)))
    bench.run(1.1)
    assert client.status == "SUCCEEDED"
    assert positions(bench) == pytest.approx([0.0, 0.4])


def test_joints_that_a_partial_goal_leaves_out_finish_their_motion():
    bench = lab("position", allow_partial_joints_goal=True).run(0.1)
    act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    act(bench, goal(rest(0.4), joints=("b",)))
    assert positions(bench.run(1.1)) == pytest.approx([0.5, 0.4])


def test_a_continuous_joint_takes_the_nearest_turn():
    description = """<robot name="r"><link name="x"/><link name="y"/><link name="z"/>
    <joint name="a" type="continuous"><parent link="x"/><child link="y"/></joint>
    <joint name="b" type="continuous"><parent link="y"/><child link="z"/></joint></robot>"""
    bench = lab("position", start=False, description=description)
    bench.hw.states.position[:] = [7.0, 0.0]
    bench.manager.switch(["jt"], [])
    act(bench, goal(rest(0.5, 0.5)))
    assert positions(bench.run(1.1)) == pytest.approx([0.5 + 2 * math.pi, 0.5])


def test_feedback_and_state_carry_desired_actual_and_error_at_their_rates():
    bench = lab(state_publish_rate=100, action_monitor_rate=20)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.9)
    assert len(bench.published("/jt/state")) == 90
    assert len(client.feedback) == 18
    feedback = client.feedback[-1]
    assert feedback.error.positions[0] == pytest.approx(feedback.desired.positions[0] - feedback.actual.positions[0])


def test_query_state_returns_where_the_joints_shall_be():
    bench = lab("position").run(0.1)
    act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.1)
    answer = bench.node.call("jt/query_state", QueryTrajectoryStateRequest(time=Time.from_sec(0.6)))
    assert answer.name == ["a", "b"]
    assert answer.position[0] == pytest.approx(0.25, abs=2e-3)
    assert answer.velocity[0] == pytest.approx(0.5 * 1.875, abs=2e-2)


def test_query_state_while_stopped_is_refused():
    with pytest.raises(HricError, match="not running"):
        lab(start=False).node.call("jt/query_state", QueryTrajectoryStateRequest())


def test_a_restart_holds_the_joints_where_they_are_and_ends_the_goal():
    bench = lab("position").run(0.1)
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(0.5)
    bench.hw.states.position[:] = [0.0, 0.0]
    bench.run(1.0, reset=True)
    assert client.status == "PREEMPTED"
    assert positions(bench) == [0.0, 0.0]


LISTING_5 = """
type: effort_controllers/JointTrajectoryController
state_publish_rate: 100
joints: [a, b]
gains:
  a: { p: 12000, d: 50, i: 0.0, i_clamp: 10000 }
  b: { p: 30000, d: 100, i: 0.02, i_clamp: 10000 }
constraints:
  goal_time: 2.0
"""


def test_the_yaml_of_thesis_listing_5_loads_and_follows():
    bench = Lab({"jt": yaml.safe_load(LISTING_5)}, inertia=5.0).load("jt")
    client = act(bench, goal(rest(0.5, -0.3)))
    bench.run(3.5)
    assert client.status == "SUCCEEDED"


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ({"gains": {"a": GAINS["a"]}}, "/jt/gains has no value for b"),
        ({"gains": {**GAINS, "z": {"p": 1}}}, "no joint 'z' in /jt/gains; valid: a, b"),
        ({"gains": {**GAINS, "b": {"p": -1.0}}}, "/jt/gains/b/p is -1.0"),
        (
            {"gains": {**GAINS, "b": {"p": 1.0, "kd": 2.0}}},
            "no parameter 'kd' in /jt/gains/b; valid: antiwindup, d, i, i_clamp",
        ),
        (
            {"constraints": {"z": {"goal": 1}}},
            "no constraint 'z' in /jt/constraints; valid: a, b, goal_time, stopped_velocity_tolerance",
        ),
        ({"constraints": {"a": {"goal": -1}}}, "/jt/constraints/a/goal is -1"),
        ({"joints": ["a", "z"]}, "no joint 'z' in EffortJointInterface; valid: a, b"),
        ({"state_publish_rate": "often"}, "/jt/state_publish_rate is 'often'"),
    ],
)
def test_a_bad_parameter_is_refused_at_load_by_name(extra, words):
    with pytest.raises(HricError) as caught:
        lab(**extra)
    assert words in str(caught.value)


def test_integral_action_without_a_clamp_is_warned_of(caplog):
    lab(gains={**GAINS, "b": {"p": 1.0, "i": 3.0}})
    assert "i without i_clamp has no effect (b)" in caplog.text


PENDULUM = """<robot name="p"><link name="base"/><link name="x"/>
<link name="y"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="a" type="continuous"><parent link="base"/><child link="x"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/></joint></robot>"""


def test_the_effort_version_adds_gravity_where_the_robot_does_not():
    params = {
        "jt": {"type": KINDS["effort"], "joints": ["a", "b"], "gains": GAINS, "gravity": True},
        "robot_description": PENDULUM,
    }
    bench = Lab(params, compensates_gravity=False).load("jt").run(DT)
    assert bench.history[-1][2] == pytest.approx([0.0, -2 * 9.81 * 0.5])


def test_the_effort_version_refuses_gravity_on_an_arm_that_adds_it_itself():
    with pytest.raises(HricError, match="both the arm Rig and the controller jt would add g"):
        lab(gravity=True, description=PENDULUM)
