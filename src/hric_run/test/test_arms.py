"""Experiments with several arms in one world: each arm as alone, one clock and one log, and refusals by name."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
import yaml
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_msgs.msg import FollowJointTrajectoryGoal
from franka_msgs.msg import ErrorRecoveryGoal
from hric_core.errors import HricError
from hric_msgs.msg import MocapData, SafetyEvent
from hric_run.definition import experiment, parameters
from hric_run.simulation import Simulation

ENGINES = ("mujoco", "pybullet", "opensim")
BROADCASTERS = ["joint_state_controller", "franka_state_controller"]
MOST = 2.1
"""Largest cost of two arms beside one."""


def two_arms(**changes: Any) -> dict[str, Any]:
    """Return the contents of an experiment file with two arms that move in opposite directions."""
    arms = {}
    for name, side in (("left", 1.0), ("right", -1.0)):
        positions = [0.3 * side, "-pi/4", 0, "-3*pi/4", 0, "pi/2", "pi/4"]
        arms[name] = {
            "robot": {"description": {"xyz": [0.0, 0.5 * side, 0.0]}},
            "controllers": [*BROADCASTERS, "joint_pd_controller"],
            "parameters": {"joint_pd_controller": {"kp": 100.0, "kd": 20.0}},
            "setpoints": [{"time": 0.1, "controller": "joint_pd_controller", "positions": positions}],
        }
    common = {"hw": "franka_sim/FrankaHWSim", "plant_type": "mujoco_ros_control/MujocoPlant"}
    return {"robot": common, "controllers": ["joint_state_controller"], "arms": arms, "duration": 0.6, **changes}


def one_arm(name: str, both: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the contents of an experiment file with one arm of `both` (default: `two_arms`) alone."""
    raw = dict(both or two_arms())
    arm = raw.pop("arms")[name]
    return raw | arm | {"robot": raw["robot"] | arm["robot"] | {"arm_id": name}}


def simulation(raw: dict[str, Any], **options: Any) -> Simulation:
    return Simulation(experiment.parse("arms", raw), **options)


@pytest.mark.parametrize("engine", ENGINES)
def test_each_arm_moves_with_its_payload_as_it_does_alone(engine: str) -> None:
    raw = two_arms()
    raw["robot"]["plant_type"] = f"{engine}_ros_control/{PLANTS[engine]}"
    raw["arms"]["left"]["robot"]["plant"] = {"payload": {"mass": 1.0, "com": [0.02, 0.0, 0.1], "link": "left_link8"}}
    raw["arms"]["right"]["robot"]["plant"] = {"payload": [{"mass": 0.5}, {"mass": 0.8, "link": "right_link5"}]}
    with simulation(raw) as both:
        both.run()
    signals = both.signals
    assert signals.joint_names == tuple(f"{arm}_joint{k}" for arm in ("left", "right") for k in range(1, 8))
    assert set(signals.interfaces) == {"effort"} and not signals.gaps
    for index, name in enumerate(("left", "right")):
        with simulation(one_arm(name, raw)) as alone:
            alone.run()
        columns = slice(7 * index, 7 * index + 7)
        assert abs(alone.signals.position[-1, 0] - alone.signals.position[0, 0]) > 0.1
        np.testing.assert_allclose(signals.position[:, columns], alone.signals.position, atol=1e-9)
        np.testing.assert_allclose(signals.command[:, columns], alone.signals.command, atol=1e-6)


PLANTS = {"mujoco": "MujocoPlant", "pybullet": "PyBulletPlant", "opensim": "OpenSimPlant"}


@pytest.mark.parametrize("changes", [{}, {"arms.left.robot.parameters.realism": "measured"}])
def test_a_reset_in_place_has_the_bits_of_a_new_simulation(changes: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "arms.yaml"
    path.write_text(yaml.safe_dump(two_arms(duration=0.3)))
    with Simulation(str(path), seed=3, **changes) as first:
        first.run()
        bits = first.state_sha256
    with Simulation(str(path), seed=1, **changes) as again:
        again.run()
        assert (again.state_sha256 == bits) != bool(changes)
        again.reset(seed=3, in_place=True)
        again.run()
        assert again.state_sha256 == bits


def test_noise_of_two_arms_differs() -> None:
    raw = two_arms(duration=0.2)
    raw["robot"]["parameters"] = {"realism": {"preset": "ideal", "q_noise": 1e-5}}
    with simulation(raw) as both:
        both.run()
    noise = np.diff(both.signals.position[:100], axis=0)
    assert noise[:, [1, 8]].std(axis=0) == pytest.approx([2**0.5 * 1e-5] * 2, rel=0.3)
    assert abs(np.corrcoef(noise[:, 1], noise[:, 8])[0, 1]) < 0.4


def test_topics_of_an_arm_are_below_its_name_and_those_of_the_world_are_not() -> None:
    with simulation(two_arms()) as both:
        topics = set(both.node.topics())
        services = set(both.node.services())
    for name in ("left", "right"):
        assert {f"/{name}/joint_states", f"/{name}/franka_state_controller/franka_states"} <= topics
        assert f"/{name}/controller_manager/switch_controller" in services
        assert f"/{name}/franka_control/set_load" in services
    assert {"/clock", "/control_log", "/joint_states", "/sim/contacts", "/limit_counts"} <= topics
    assert not {"/left/control_log", "/left/sim/contacts", "/left/clock"} & topics


def test_a_reflex_of_one_arm_leaves_the_other_moving() -> None:
    raw = two_arms()
    raw["arms"]["right"]["robot"]["parameters"] = {"rate_limiting": False}
    with simulation(raw) as both:
        both.run(0.3)
        hw = both.app.hw
        hw.plant.apply_wrench("right_hand", (0.0, 0.0, 150.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.05)
        both.run(0.3)
        assert "right: the motion was aborted: cartesian_reflex" in hw.error and "left" not in hw.error
        assert both.signals.interfaces[:7] == ("effort",) * 7 and both.signals.interfaces[7:] == ("none",) * 7


def test_a_setpoint_is_sent_to_the_controller_of_an_arm() -> None:
    with simulation(two_arms()) as both:
        heard: list[Any] = []
        both.node.subscribe("right/joint_pd_controller/command", Float64MultiArray, heard.append)
        both.run()
        both.command("left/joint_pd_controller", [0.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7])
        with pytest.raises(HricError, match=r"nothing subscribes to joint_pd_controller/command.*right/joint_pd"):
            both.command("joint_pd_controller", [0.0] * 7)
    assert [message.data[0] for message in heard] == [-0.3]


def test_one_experiment_with_one_robot_runs_with_several_arms() -> None:
    changes: dict[str, Any] = {"arms": "a,b,c", "kp": 150, "arms.c.robot.description.inertials": "fr3", "duration": 0.1}
    with Simulation("pd_step", **changes) as arms:
        arms.run()
        bases = [arms.app.hw.plant.link_state(f"{name}_link0")[0][1, 3] for name in "abc"]
        assert arms.node.param("b/joint_pd_controller/kp") == 150
    assert bases == pytest.approx([1.0, 0.0, -1.0])
    assert arms.signals.position.shape == (100, 21)


def refused(match: str, **arms: Any) -> None:
    raw = two_arms()
    for name, values in arms.items():
        raw["arms"].setdefault(name, {})
        for key, value in values.items():
            raw["arms"][name][key] = {**raw["arms"][name].get(key, {}), **value} if isinstance(value, dict) else value
    with pytest.raises(HricError, match=match):
        simulation(raw).close()


def test_a_supervisor_stops_the_controller_of_an_arm_that_does_not_obey() -> None:
    raw = two_arms(human={"position": [0.62, 0.1]}, supervisor={"mode": "speed_and_separation"})
    raw["arms"]["left"]["parameters"]["joint_pd_controller"]["profile"] = {"enabled": False}
    events: list[SafetyEvent] = []
    with simulation(raw) as both:
        both.node.subscribe("hric/safety/events", SafetyEvent, events.append)
        both.run()
        states = {name: [one.state for one in app.manager.list()] for name, app in both.app.hw.apps.items()}
    (stopped,) = [event.text for event in events if event.kind == "controller_stopped"]
    assert stopped.startswith("controller left/joint_pd_controller commands the arm and does not obey")
    assert states == {"left": ["running", "running", "stopped"], "right": ["running"] * 3}


def test_what_cannot_be_one_world_is_refused_by_name() -> None:
    refused(
        "plant/time_step is None for left, 0.002 for right; valid: the same",
        right={"robot": {"plant": {"time_step": 0.002}}},
    )
    refused("left and right both have a link left_link0", right={"robot": {"arm_id": "left"}})
    refused(
        r"plant_type is '.*MujocoPlant' for left, '.*PyBullet",
        right={"robot": {"plant_type": "pybullet_ros_control/PyBulletPlant"}},
    )
    for wrong, said in (
        ({"com": [0.0, 0.0, 0.1]}, r"plant/payload\[0\] has no mass"),
        ({"mass_kg": 1.0}, "no parameter 'mass_kg'"),
    ):
        refused(said, left={"robot": {"plant": {"payload": wrong}}})
    refused(r"arms\.left: robot\.load is 2\.0; valid: a mapping", left={"robot": {"load": 2.0}})
    refused(
        r"2 mistakes\s+arms.right: setpoints.*not started.*\s+arms.right: parameters for",
        right={"controllers": ["joint_state_controller"]},
    )
    refused(r"arms: '3rd' is no name", **{"3rd": {"controllers": ["joint_state_controller"]}})
    refused("arms: robot is also the name of other parameters; valid: another", robot={"controllers": BROADCASTERS})
    refused(r"arms\.right: .*xyz is .*500 mm would be", right={"robot": {"description": {"xyz": [0.0, 500.0, 0.0]}}})
    others = {"joint_pd_controller": {"joints": [f"left_joint{number}" for number in range(1, 8)]}}
    refused(
        "controller right/joint_pd_controller cannot be loaded: no joint 'left_joint1'", right={"parameters": others}
    )
    with pytest.raises(HricError, match="arms has only left; valid: two arms or more"):
        experiment.parse("arms", two_arms(arms={"left": two_arms()["arms"]["left"]}))
    with pytest.raises(HricError, match=r"mocap\.arm is not given; valid: one of left, right"):
        experiment.parse("arms", two_arms(mocap={}))
    with pytest.raises(HricError, match=r"mocap\.arm is mid; valid: one of left, right"):
        experiment.parse("arms", two_arms(mocap={"arm": "mid"}))
    with pytest.raises(HricError, match=r"mocap\.arm is left; valid: no mocap.arm, as there is one robot"):
        experiment.parse("arms", one_arm("left") | {"mocap": {"arm": "left"}})


def test_overrides_that_have_no_single_meaning_are_refused() -> None:
    with pytest.raises(HricError, match=r"several arms; valid: for example arms\.left\.parameters\.CONTROLLER\.kp"):
        Simulation("two_arms", kp=100)
    with pytest.raises(HricError, match="has the arms left, right already"):
        Simulation("two_arms", arms="a,b")
    with pytest.raises(HricError, match="valid: different names, for example arms:=left,right"):
        Simulation("pd_step", arms="a,a")
    with pytest.raises(
        HricError,
        match=r"no override 'arms:=a,b': several arms cannot use one robot.urdf.*valid: a file with the section",
    ):
        Simulation("ur5e_step", arms="a,b")
    with pytest.raises(HricError, match="'mid' is not one of left, right"):
        Simulation("two_arms", **{"arms.mid.robot.q_start": [0.0] * 7})


def test_two_arms_cost_at_most_a_little_more_than_twice_one() -> None:
    assert cost_beside_one(two_arms(duration=100.0)) <= MOST


def test_a_controller_of_both_arms_costs_no_more_than_one_each() -> None:
    assert cost_beside_one(one_controller("joint_pd_controller", duration=100.0)) <= MOST


def cost_beside_one(raw: dict[str, Any]) -> float:
    """Return the processor time per cycle, as a ratio to one arm, in alternating pieces of one process.

    The smallest ratio counts, as load only adds."""
    with simulation(raw) as both, simulation(one_arm("left")) as one:

        def cost(run: Simulation) -> float:
            began = time.process_time()
            run.advance(500)
            return time.process_time() - began

        cost(both), cost(one)
        ratios = [cost(both) / cost(one) for _ in range(8)]
    return min(ratios)


JOINTS = [f"{arm}_joint{number}" for arm in ("left", "right") for number in range(1, 8)]
UR5E = {
    "hw": "hric_control/RobotHWSim",
    "urdf": "package://hric_experiments/robots/ur5e.urdf.xacro",
    "q_start": ["pi", "-pi/2", "pi/2", "-pi/2", "-pi/2", 0],
}
POSE = ["-pi/4", 0, "-3*pi/4", 0, "pi/2", "pi/4"]


def one_controller(name: str, **changes: Any) -> dict[str, Any]:
    """Return the experiment of `two_arms` with one controller of both arms in place of one each."""
    raw = two_arms(**changes)
    for arm in raw["arms"].values():
        arm["controllers"] = BROADCASTERS
        own, _ = arm.pop("parameters"), arm.pop("setpoints")
    parameters = own if name in own else {}
    return raw | {"controllers": ["joint_state_controller", name], "parameters": parameters}


def test_a_controller_of_both_arms_moves_them_as_one_controller_each(tmp_path: Path) -> None:
    raw = one_controller("joint_pd_controller")
    raw["setpoints"] = [{"time": 0.1, "controller": "joint_pd_controller", "positions": [0.3, *POSE, -0.3, *POSE]}]
    path = tmp_path / "both.yaml"
    path.write_text(yaml.safe_dump(raw))
    with Simulation(str(path)) as both, simulation(two_arms()) as each:
        assert both.node.param("joint_pd_controller/joints") == JOINTS
        both.run()
        each.run()
        np.testing.assert_array_equal(both.signals.position, each.signals.position)
        np.testing.assert_array_equal(both.signals.command, each.signals.command)
        both.reset(in_place=True)
        both.run()
        np.testing.assert_array_equal(both.signals.position, each.signals.position)


@pytest.mark.parametrize("controller", ["position_joint_trajectory_controller", "effort_joint_trajectory_controller"])
def test_one_trajectory_moves_both_arms(controller: str) -> None:
    with simulation(one_controller(controller, duration=2.0)) as both:
        both.run(0.1)
        start = list(both.app.hw.states.position)
        goal = [q + 0.2 * (-1.0) ** i for i, q in enumerate(start)]
        point = JointTrajectoryPoint(positions=goal, time_from_start=rospy.Duration(1.0))
        trajectory = JointTrajectory(joint_names=JOINTS, points=[point])
        message = FollowJointTrajectoryGoal(trajectory=trajectory)
        handle = both.node.send_goal(f"{controller}/follow_joint_trajectory", message)
        both.run(1.5)
        assert handle.status == "SUCCEEDED"
    np.testing.assert_allclose(both.signals.position[-1], goal, atol=0.01)


def switch(both: Simulation, arm: str, start: list[str], stop: list[str]) -> None:
    app = both.app.hw.apps[arm] if arm else both.app
    app.manager.switch(start, stop)


def test_a_joint_of_an_arm_has_one_controller_over_all_managers() -> None:
    raw = one_controller("joint_pd_controller")
    raw["arms"]["left"]["controllers"] = [*BROADCASTERS, "joint_pd_controller"]
    with pytest.raises(HricError, match="left_joint1 is claimed by both /joint_pd_controller and joint_pd_contr"):
        simulation(raw).close()
    raw["controllers"] = ["joint_state_controller", "position_joint_trajectory_controller"]
    raw["arms"]["left"]["controllers"] = BROADCASTERS
    with simulation(raw | {"parameters": {}}) as both:
        left, common = both.app.hw.apps["left"].manager, "position_joint_trajectory_controller"
        for key, value in parameters.defaults("left")["joint_pd_controller"].items():
            both.node.set_param(f"left/joint_pd_controller/{key}", value)
        left.load("joint_pd_controller")
        both.run(0.1)
        assert both.signals.interfaces == ("position",) * 14
        with pytest.raises(HricError, match=f"left_joint1 is claimed by both /{common} and joint_pd_controller"):
            switch(both, "left", ["joint_pd_controller"], [])
        switch(both, "", [], [common])
        switch(both, "left", ["joint_pd_controller"], [])
        both.run(0.1)
        with pytest.raises(HricError, match=f"left_joint1 is claimed by both /left/joint_pd_controller and {common}"):
            switch(both, "", [common], [])
        assert both.signals.interfaces == ("effort",) * 7 + ("none",) * 7
        switch(both, "left", [], ["joint_pd_controller"])
        switch(both, "", [common], [])
        both.run(0.1)
        assert both.signals.interfaces == ("position",) * 14


def test_a_controller_of_both_arms_must_claim_all_joints_of_an_arm() -> None:
    raw = one_controller("joint_pd_controller")
    raw["parameters"]["joint_pd_controller"] |= {"joints": JOINTS[:10]}
    with pytest.raises(HricError, match=r"claims 3 of the arm's 7 joints; .* missing right_joint4"):
        simulation(raw).close()


def test_torques_for_both_arms_need_arms_that_agree_on_gravity() -> None:
    raw = one_controller("joint_pd_controller")
    raw["arms"]["right"] = {"robot": UR5E, "controllers": ["joint_state_controller"]}
    with pytest.raises(HricError, match="no hardware interface 'EffortJointInterface' in CombinedHWSim"):
        simulation(raw).close()
    raw |= {"controllers": ["joint_state_controller", "position_joint_trajectory_controller"], "parameters": {}}
    with simulation(raw) as both:
        both.run()
    assert abs(both.signals.position[-1] - both.signals.position[0]).max() < 0.01


def test_after_a_reflex_of_one_arm_both_stop_and_recover() -> None:
    raw = one_controller("joint_pd_controller", duration=3.0)
    for arm in raw["arms"].values():
        arm["robot"]["parameters"] = {"rate_limiting": False}
    with simulation(raw) as both:
        both.run(0.1)
        hw = both.app.hw
        both.command("joint_pd_controller", [1.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7] * 2)
        hw.plant.apply_wrench("right_hand", (0.0, 0.0, 150.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.05)
        both.run(0.5)
        assert hw.error == "right: the motion was aborted: cartesian_reflex"
        assert both.signals.interfaces == ("none",) * 14
        stopped = both.signals.position[-1]
        both.node.send_goal("right/franka_control/error_recovery", ErrorRecoveryGoal())
        both.run(0.1)
        assert hw.error == "" and both.signals.interfaces == ("effort",) * 14
        np.testing.assert_allclose(both.signals.position[-1], stopped, atol=0.02)
        both.command("joint_pd_controller", [0.3, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7] * 2)
        both.run(1.0)
        assert np.abs(both.signals.position[-1] - stopped)[[0, 7]].min() > 0.05


def following(arm: str, **human: Any) -> dict[str, Any]:
    """Return an experiment in which an arm follows the marker of motion capture in its base."""
    raw = two_arms(duration=3.0)
    for values in raw["arms"].values():
        values.pop("parameters"), values.pop("setpoints")
        values["controllers"] = BROADCASTERS
    raw["arms"][arm]["controllers"] = [*BROADCASTERS, "cartesian_pose_controller"]
    moving = {"program": "sinusoid", "begin": 0.2, "centre": [0.7, 0.0, 0.5], "amplitude": [0.0, 0.1, 0.0]}
    moving |= {"frequency": 0.5, "cycles": 1, "ramp": 0.5} | human
    base = {"xyz": [0, 0, 0], "xyzw": [0, 0, 0, 1]}
    return raw | {"mocap": {"arm": arm, "human": moving, "base_from_mocap": base}}


@pytest.mark.parametrize("arm", ["left", "right"])
def test_an_arm_follows_a_marker_in_its_own_base(arm: str) -> None:
    with simulation(following(arm)) as both:
        frames: list[Any] = []
        assert both.node.param("emulated_human/state_topic") == f"{arm}/franka_state_controller/franka_states"
        both.node.subscribe("hric/perception/mocap", MocapData, frames.append)
        both.run()
    assert {frame.header.frame_id for frame in frames} == {f"{arm}_link0"}
    moved = np.ptp(both.signals.position, axis=0)
    first, second = moved[:7].max(), moved[7:].max()
    assert (first > 0.1, second > 0.1) == (arm == "left", arm == "right")


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_follower_stays_within_a_hundredth_of_a_radian_of_its_leader(engine: str) -> None:
    with Simulation("leader_follower", simulator=engine) as arms:
        arms.run()
    position = arms.signals.position
    leader, follower = position[:, :7], position[:, 7:]
    assert np.ptp(leader, axis=0).max() > 0.5
    assert np.abs(leader - follower).max() < 0.015
    np.testing.assert_allclose(follower[-1], leader[-1], atol=1e-4)


def test_both_arms_touch_the_person_and_each_other() -> None:
    with Simulation("two_arms_contact", simulator="mujoco") as arms:
        pairs = set()
        while arms.time < 4.4:
            arms.advance(10)
            pairs |= {(c.body_a, c.body_b, c.kind) for c in arms.app.hw.plant.contacts()}
    assert ("arms::left_hand", "arms::right_hand", "penalty") in pairs
    touched = {(a if a.startswith("arms") else b) for a, b, _ in pairs if "human::r_elbow" in (a, b)}
    assert {"arms::left_hand", "arms::right_hand"} <= touched
