"""Bring-up with two arms in one world: controllers of one arm and of both, one clock, one bag."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from unittest import mock

import pytest
import rosgraph
from bags import control_log, gaps_and_repeats, topics
from live_system import LiveSystem, wait_for

pytestmark = pytest.mark.alone

POSE = [-0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
"""Positions of joints 2 to 7 at the start [rad]."""
PD, BOTH = "joint_pd_controller", "position_joint_trajectory_controller"
JOINTS = [f"{arm}_joint{number}" for arm in ("left", "right") for number in range(1, 8)]


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveSystem]:
    folder = tmp_path_factory.mktemp("arms")
    system = LiveSystem(
        folder, "env:=sim", "rviz:=false", "view:=false", "record:=true", "load_gripper:=true", "arms:=left,right"
    )
    try:
        for arm in ("/left", "/right"):
            system.wait_running(PD, namespace=arm)
        system.wait_running("joint_state_controller")
        wait_for(lambda: BOTH in system.controllers("/right"), 60.0, "all controllers of the last arm are loaded")
        yield system
    finally:
        system.close()


def manager(system: LiveSystem, namespace: str, verb: str, name: str) -> str:
    """Return the output of the command-line tool of a controller manager, which may refuse the command."""
    words = ("rosrun", "controller_manager", "controller_manager", *(("--namespace", namespace) if namespace else ()))
    done = system.run(*words, verb, name)
    return done.stdout + done.stderr


def wait_at(system: LiveSystem, left: float, right: float) -> None:
    """Wait until joint 1 of each arm has arrived at a position [rad]."""
    with system.following("/joint_states/position") as positions:

        def arrived() -> bool:
            q = positions()
            assert len(q) in (0, 14)
            return bool(q) and abs(q[0] - left) < 0.05 and abs(q[7] - right) < 0.05

        wait_for(arrived, 90.0, f"joints 1 at {left} and {right} rad; output:\n{system.output}")


def test_each_arm_has_a_controller_of_its_own(arms: LiveSystem) -> None:
    with ExitStack() as stack:
        for arm, q1 in (("left", 0.5), ("right", -0.5)):
            topic, text = f"/{arm}/{PD}/command", f"{{data: {[q1, *POSE]}}}"
            stack.enter_context(arms.published(topic, "std_msgs/Float64MultiArray", text))
        wait_at(arms, 0.5, -0.5)


def test_each_arm_has_a_gripper(arms: LiveSystem) -> None:
    with ExitStack() as stack:
        widths = {"left": 0.03, "right": 0.06}
        for arm, width in widths.items():
            topic, text = f"/{arm}/franka_gripper/move/goal", f"{{goal: {{width: {width}, speed: 0.1}}}}"
            stack.enter_context(arms.published(topic, "franka_gripper/MoveActionGoal", text))
        for arm, width in widths.items():
            topic = f"/{arm}/franka_gripper/joint_states"
            with arms.following(f"{topic}/position") as positions:
                wait_for(
                    lambda: positions() == pytest.approx([width / 2.0] * 2, abs=2.5e-4),  # noqa: B023
                    90.0,
                    f"the fingers of the {arm} arm at their own width",
                )
            assert f"{arm}_finger_joint1" in arms.run("rostopic", "echo", "-n", "1", f"{topic}/name").stdout


def test_the_robot_leaves_the_parameters_of_other_nodes_of_an_arm(arms: LiveSystem) -> None:
    names = [
        rosgraph.Master("/looks_on", arms.uri).getParam(f"/{arm}/franka_gripper/arm_id") for arm in ("left", "right")
    ]
    assert names == ["left", "right"]


def test_there_is_one_clock(arms: LiveSystem) -> None:
    with mock.patch.dict(os.environ, ROS_MASTER_URI=arms.uri):
        publishers = dict(rosgraph.Master("/looks_on").getSystemState()[0])
    assert publishers["/clock"] == ["/robot"]
    assert sorted(name for name in publishers if name.endswith("/clock")) == ["/clock", "/hric/clock"]


def test_one_trajectory_moves_both_arms_and_a_conflict_is_refused(arms: LiveSystem) -> None:
    wait_for(lambda: BOTH in arms.controllers(), 60.0, "the controllers of both arms are loaded")
    refused = manager(arms, "", "start", BOTH)
    assert f"left_joint1 is claimed by both /left/{PD} and {BOTH}" in refused
    for arm in ("/left", "/right"):
        manager(arms, arm, "stop", PD)
    manager(arms, "", "start", BOTH)
    assert arms.controllers()[BOTH] == "running"
    assert f"right_joint1 is claimed by both /{BOTH} and {PD}" in manager(arms, "/right", "start", PD)
    point = f"{{positions: {[-0.3, *POSE, 0.3, *POSE]}, time_from_start: {{secs: 2}}}}"
    text = f"{{joint_names: {JOINTS}, points: [{point}]}}"
    with arms.published(f"/{BOTH}/command", "trajectory_msgs/JointTrajectory", text):
        wait_at(arms, -0.3, 0.3)


def test_one_bag_has_the_topics_of_both_arms(arms: LiveSystem) -> None:
    arms.interrupt()
    assert arms.processes() == {} and "Traceback" not in arms.output, arms.output
    (bag,) = arms.run_folder.glob("*.bag")
    common = {"/clock", "/control_log", "/joint_states", f"/{BOTH}/state"}
    each = {f"/{arm}/{topic}" for arm in ("left", "right") for topic in ("joint_states", f"{PD}/state")}
    assert common | each <= topics(bag)
    cycles, _ = control_log(bag)
    assert cycles[0] == 0 and gaps_and_repeats(cycles) == (0, 0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["arms:=left,left"], "arms:=left,left is not possible; valid: different names"),
        (["arms:=left"], "arms:=left is not possible; valid: different names"),
        (["arms:=left,right", "arm_id:=left"], "arm_id can be given for one arm only"),
        (["arms:=a,b", "experiment:=two_arms"], "this experiment has the arms left, right already"),
    ],
)
def test_impossible_arms_are_refused(start: Callable[..., LiveSystem], words: list[str], message: str) -> None:
    system = start("env:=sim", "rviz:=false", *words)
    assert system.wait(60.0) != 0
    assert message in system.output and "Traceback" not in system.output
