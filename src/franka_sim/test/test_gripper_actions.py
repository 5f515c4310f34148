"""The gripper's actions on the emulated hand, in one process and deterministic."""

import logging

import pytest

from control_msgs.msg import GripperCommandGoal
from franka_gripper.msg import GraspGoal, HomingGoal, MoveGoal, StopGoal
from franka_hw_interface.gripper_actions import GripperActions, GripperSettings
from franka_sim.gripper import emulated_hand
from hric_core.errors import HricError
from hric_core.local.node import LocalNode

DT = 0.01


class Bench:
    """Actions, hand, and the client's side; `run` advances time until the goals have ended, or for so long."""

    def __init__(self, **params):
        self.node = LocalNode({"franka_gripper": params}, "/franka_gripper")
        self.time = 0.0
        self.node.clock = lambda: self.time
        self.messages = {}
        self.node.tap(lambda topic, message, time: self.messages.setdefault(topic, []).append((time, message)))
        self.hand, self.close = emulated_hand(self.node)
        self.actions = GripperActions(self.node, self.hand, GripperSettings.read(self.node))

    def run(self, *goals, seconds=10.0):
        for _ in range(round(seconds / DT)):
            if goals and all(goal.done for goal in goals):
                break
            self.actions.update()
            self.time += DT
        return self

    def move(self, width=0.02, speed=0.1):
        return self.node.send_goal("move", MoveGoal(width=width, speed=speed))

    def grasp(self, width=0.03, inner=0.005, outer=0.005, speed=0.1, force=20.0):
        goal = GraspGoal(width=width, speed=speed, force=force)
        goal.epsilon.inner, goal.epsilon.outer = inner, outer
        return self.node.send_goal("grasp", goal)

    def command(self, position, max_effort=10.0):
        goal = GripperCommandGoal()
        goal.command.position, goal.command.max_effort = position, max_effort
        return self.node.send_goal("gripper_action", goal)

    def put(self, width):
        self.node.set_live("/franka_gripper", {"object_width": width})


def outcome(goal):
    return goal.status, goal.result.success


def test_move_takes_the_fingers_to_the_width_and_succeeds_then():
    bench = Bench()
    goal = bench.move(0.02, 0.05)
    bench.run(seconds=1.0)
    assert goal.status == "ACTIVE"
    bench.run(goal)
    assert (outcome(goal), goal.result.error, bench.hand.width) == (("SUCCEEDED", True), "", 0.02)
    assert bench.time == pytest.approx(1.2, abs=0.05)


def test_a_grasp_that_hits_succeeds():
    bench = Bench()
    bench.put(0.031)
    goal = bench.grasp()
    bench.run(goal)
    assert (outcome(goal), bench.hand.is_grasped, bench.hand.force) == (("SUCCEEDED", True), True, 20.0)


@pytest.mark.parametrize("object_width", [0.0, 0.02, 0.04])
def test_a_grasp_that_misses_succeeds_as_an_action_with_success_false_as_in_franka_ros(object_width):
    bench = Bench()
    bench.put(object_width)
    goal = bench.grasp()
    bench.run(goal)
    assert outcome(goal) == ("SUCCEEDED", False)
    assert "the fingers are at" in goal.result.error


def test_homing_and_stop_succeed():
    bench = Bench()
    bench.run(bench.move())
    homing = bench.node.send_goal("homing", HomingGoal())
    bench.run(homing)
    assert (outcome(homing), bench.hand.width) == (("SUCCEEDED", True), 0.08)
    stop = bench.node.send_goal("stop", StopGoal())
    bench.run(stop)
    assert outcome(stop) == ("SUCCEEDED", True)


def test_what_the_hand_refuses_is_aborted_with_its_reason_and_logged(caplog):
    bench = Bench()
    with caplog.at_level(logging.ERROR, "hric"):
        goal = bench.move(0.2)
        bench.run(goal)
    assert outcome(goal) == ("ABORTED", False)
    assert "width 0.2 m; valid: 0 to 0.08 m" in goal.result.error
    assert len([record for record in caplog.records if record.levelno >= logging.ERROR]) == 1


def test_the_action_stop_aborts_what_runs():
    bench = Bench()
    move = bench.move()
    bench.run(seconds=0.1)
    stop = bench.node.send_goal("stop", StopGoal())
    bench.run(move, stop)
    assert (outcome(move), outcome(stop)) == (("ABORTED", False), ("SUCCEEDED", True))
    assert 0.02 < bench.hand.width < 0.08


def test_a_cancel_stops_the_fingers_and_the_goal_ends_as_preempted():
    bench = Bench()
    move = bench.move()
    bench.run(seconds=0.2)
    move.cancel()
    bench.run(move)
    width = bench.hand.width
    bench.run(seconds=1.0)
    assert (outcome(move), bench.hand.width) == (("PREEMPTED", False), width)


def test_a_new_goal_of_any_action_replaces_the_one_that_runs():
    bench = Bench()
    bench.put(0.03)
    move = bench.move(0.07, 0.01)
    bench.run(seconds=0.2)
    grasp = bench.grasp()
    bench.run(move, grasp)
    assert (outcome(move), outcome(grasp)) == (("PREEMPTED", False), ("SUCCEEDED", True))
    assert "replaced by a goal of grasp" in move.result.error


def test_a_goal_that_the_hand_refuses_replaces_nothing():
    bench = Bench()
    move = bench.move()
    bench.run(seconds=0.1)
    bad = bench.move(9.0)
    bench.run(move, bad)
    assert (outcome(move), outcome(bad)) == (("SUCCEEDED", True), ("ABORTED", False))


def test_gripper_action_takes_the_position_of_one_finger_and_returns_the_opening():
    bench = Bench()
    bench.run(bench.move(0.0))
    goal = bench.command(0.03)
    bench.run(goal)
    assert (goal.status, goal.result.reached_goal, goal.result.stalled) == ("SUCCEEDED", True, False)
    assert (bench.hand.width, goal.result.position) == (0.06, 0.06)


def test_gripper_action_grasps_when_it_closes_with_the_effort_as_force():
    bench = Bench()
    bench.put(0.032)
    goal = bench.command(0.015, 12.0)
    bench.run(goal)
    assert (goal.status, bench.hand.is_grasped, bench.hand.force) == ("SUCCEEDED", True, 12.0)


def test_gripper_action_that_closes_on_nothing_is_aborted():
    bench = Bench()
    goal = bench.command(0.015)
    bench.run(goal)
    assert (goal.status, goal.result.reached_goal, goal.result.position) == ("ABORTED", False, 0.0)


def test_gripper_action_to_where_the_fingers_are_succeeds_at_once():
    bench = Bench()
    goal = bench.command(0.04)
    bench.run(goal)
    assert (goal.status, bench.time) == ("SUCCEEDED", pytest.approx(DT))


@pytest.mark.parametrize("position", [-0.001, 0.041, float("nan")])
def test_gripper_action_out_of_range_is_aborted(position):
    bench = Bench()
    goal = bench.command(position)
    bench.run(goal)
    assert goal.status == "ABORTED"
    assert bench.hand.width == 0.08


def test_the_epsilons_and_the_speed_of_gripper_action_are_parameters():
    bench = Bench(default_speed=0.01, default_grasp_epsilon={"inner": 0.05, "outer": 0.001})
    goal = bench.command(0.02)
    bench.run(goal)
    assert goal.status == "SUCCEEDED"  # the fingers met at 0, within the inner tolerance
    assert bench.time == pytest.approx(8.0, abs=0.1)


def test_joint_states_carry_half_the_opening_for_each_finger_at_the_rate():
    bench = Bench(publish_rate=20, arm_id="left")
    bench.run(bench.move(0.03))
    bench.messages.clear()
    bench.run(seconds=2.0)
    messages = bench.messages["/franka_gripper/joint_states"]
    assert len(messages) == pytest.approx(40, abs=1)
    time, message = messages[-1]
    assert message.name == ["left_finger_joint1", "left_finger_joint2"]
    assert message.position == [0.015, 0.015]
    assert message.header.stamp.to_sec() == pytest.approx(time)


def test_the_robots_joint_states_get_the_fingers_where_requested():
    bench = Bench(robot_joint_states="/joint_states")
    bench.run(seconds=1.0)
    own, robots = bench.messages["/franka_gripper/joint_states"], bench.messages["/joint_states"]
    assert len(robots) == len(own) == pytest.approx(30, abs=1)
    assert robots[-1][1].name == ["panda_finger_joint1", "panda_finger_joint2"]
    assert "/joint_states" not in Bench().node.topics()


def test_joint_states_go_on_after_time_went_back():
    bench = Bench()
    bench.run(seconds=5.0)
    bench.time = 0.0
    bench.messages.clear()
    bench.run(seconds=1.0)
    assert len(bench.messages["/franka_gripper/joint_states"]) >= 25


def test_shutdown_stops_the_fingers_ends_the_goals_and_takes_all_back():
    bench = Bench()
    goal = bench.move()
    bench.run(seconds=0.1)
    bench.actions.shutdown()
    bench.close()
    assert goal.status == "PREEMPTED"
    assert not bench.node.topics()


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"publish_rate": 0}, "/franka_gripper/publish_rate is 0; valid: a finite number above 0"),
        ({"default_speed": "fast"}, "default_speed is 'fast'"),
        ({"default_grasp_epsilon": {"inner": -0.1}}, "default_grasp_epsilon/inner is -0.1"),
        ({"joint_names": ["one"]}, "joint_names is ['one']; valid: a list of 2 names"),
        ({"arm_id": ""}, "arm_id is ''"),
        ({"robot_joint_states": 5}, "robot_joint_states is 5; valid: a topic"),
    ],
)
def test_a_bad_parameter_is_refused_by_name(params, words):
    with pytest.raises(HricError) as caught:
        Bench(**params)
    assert words in str(caught.value)


def test_an_object_that_does_not_fit_is_refused_and_the_one_before_stays():
    bench = Bench()
    bench.put(0.03)
    with pytest.raises(HricError, match="object_width"):
        bench.put(0.09)
    assert bench.hand.object_width == 0.03
    bench.put(0.0)
    assert bench.hand.object_width is None
