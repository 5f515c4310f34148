import itertools
import logging
import math

import pytest
from controllers_rig import DT, Lab
from std_msgs.msg import Float64MultiArray

from control_msgs.msg import JointTrajectoryControllerState
from hric_core.errors import HricError

URDF = """<robot name="two"><link name="base"/>
<link name="upper"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1.5" velocity="2" effort="50"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="2" effort="50"/></joint></robot>"""  # noqa: E501


def lab(start=True, description="", joints=("a", "b"), rig=None, **extra):
    params = {
        "pd": {"type": "hric_controllers/JointPDController", "joints": list(joints), "kp": 100.0, "kd": 20.0, **extra}
    }
    if description:
        params["robot_description"] = description
    return Lab(params, **(rig or {})).load("pd", start)


def command(bench, *values):
    bench.send("pd/command", Float64MultiArray(data=list(values)))


def refusal(**extra):
    with pytest.raises(HricError) as caught:
        lab(**extra)
    return str(caught.value)


def errors(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


def test_before_any_setpoint_it_holds_the_position_at_the_start():
    bench = lab(start=False)
    bench.hw.states.position[:] = [0.3, -0.4]
    bench.manager.switch(["pd"], [])
    bench.run(1.0)
    assert bench.hw.states.position == pytest.approx([0.3, -0.4])


def test_it_reaches_a_setpoint_and_rests_there():
    bench = lab().run(0.1)
    command(bench, 0.5, -0.5)
    bench.run(4.0)
    assert bench.hw.states.position == pytest.approx([0.5, -0.5], abs=1e-5)


def test_the_torque_is_equation_3():
    bench = lab(rotatum_limit=0, profile={"enabled": False}).run(0.01)
    bench.hw.states.position[:], bench.hw.states.velocity[:] = [0.1, 0.2], [0.3, -0.1]
    command(bench, 0.5, -0.5)
    bench.run(DT)
    assert bench.history[-1][2] == pytest.approx([100 * 0.4 - 20 * 0.3, 100 * -0.7 + 20 * 0.1])


def test_the_rate_of_torque_is_limited_from_the_first_cycle_on():
    bench = lab(profile={"enabled": False})
    command(bench, 1.0, -1.0)
    bench.run(0.5)
    torques = [[0.0, 0.0], *(row[2] for row in bench.history)]
    rates = [
        abs(now - before) / DT for one, two in itertools.pairwise(torques) for before, now in zip(one, two, strict=True)
    ]
    assert max(rates) == pytest.approx(1000.0)


def test_a_rotatum_limit_of_zero_means_no_limit():
    bench = lab(rotatum_limit=0, profile={"enabled": False})
    command(bench, 1.0, -1.0)
    bench.run(DT)
    assert bench.history[-1][2] == pytest.approx([100.0, -100.0])


def test_a_profile_leads_the_setpoint_within_its_velocity():
    bench = lab(profile={"velocity": 0.5, "acceleration": 2.0}).run(0.1)
    command(bench, 1.0, 0.5)
    bench.run(3.0)
    desired = [message.desired.velocities[0] for message in bench.published("/pd/state")]
    assert max(desired) == pytest.approx(0.5)
    assert bench.published("/pd/state")[-1].desired.positions == pytest.approx([1.0, 0.5])


def test_a_new_setpoint_in_motion_leaves_the_desired_state_continuous():
    bench = lab(state_publish_rate=1000, profile={"velocity": 1.0, "acceleration": 5.0})
    command(bench, 1.0, 0.5)
    bench.run(0.5)
    command(bench, -1.0, 0.7)
    bench.run(1.0)
    points = [message.desired for message in bench.published("/pd/state")]
    for before, now in itertools.pairwise(points):
        for i in range(2):
            assert abs(now.velocities[i] - before.velocities[i]) <= 5.0 * DT + 1e-9
            assert abs(now.positions[i] - before.positions[i]) <= 1.0 * DT + 1e-9


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([0.1], "the present one is kept: 1 values; valid: 2, for a, b"),
        ([0.1, math.nan], "b nan is not a finite number"),
        ([0.1, math.inf], "b inf is not a finite number"),
        ([1.6, 0.0], "a 1.6 is outside -1 to 1.5"),
    ],
)
def test_a_bad_setpoint_gives_one_clear_error_and_the_arm_stays(caplog, values, words):
    bench = lab(description=URDF, kd=0.001).run(0.1)
    with caplog.at_level(logging.ERROR, "hric"):
        command(bench, *values)
    assert len(errors(caplog)) == 1
    assert words in errors(caplog)[0]
    assert "/pd/command" in errors(caplog)[0]
    bench.run(0.5)
    assert bench.hw.states.position == [0.0, 0.0]
    assert bench.state("pd") == "running"


def test_a_setpoint_while_stopped_is_refused_and_not_kept(caplog):
    bench = lab(start=False)
    command(bench, 0.5, 0.5)
    assert "not running" in errors(caplog)[0]
    bench.manager.switch(["pd"], [])
    bench.run(0.5)
    assert bench.hw.states.position == [0.0, 0.0]


def test_after_a_restart_it_holds_where_it_is_and_forgets_the_setpoint():
    bench = lab()
    command(bench, 0.5, 0.5)
    bench.run(3.0)
    bench.hw.states.position[:], bench.hw.states.velocity[:] = [0.1, 0.1], [0.0, 0.0]
    bench.run(1.0, reset=True)
    assert bench.hw.states.position == pytest.approx([0.1, 0.1])


def test_the_parameter_setpoint_is_where_it_goes_at_the_start():
    assert lab(setpoint={"a": 0.2, "b": 0.1}).run(3.0).hw.states.position == pytest.approx([0.2, 0.1], abs=1e-4)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ({"kp": -1.0}, "/pd/kp is -1.0; valid: a finite number of 0 or more"),
        ({"kp": [1.0, -2.0]}, "/pd/kp/b is -2.0"),
        ({"kd": math.nan}, "/pd/kd is nan"),
        ({"kd": [1.0]}, "/pd/kd is [1.0]; valid: 2 values, for a, b"),
        ({"kp": {"a": 1.0}}, "/pd/kp has no value for b"),
        ({"kp": {"a": 1.0, "b": 1.0, "c": 1.0}}, "no joint 'c' in /pd/kp"),
        ({"kp": "high"}, "'high'"),
        ({"joints": ["a", "z"]}, "no joint 'z' in EffortJointInterface; valid: a, b"),
        ({"joints": []}, "valid: a list of names, all different"),
        ({"rotatum_limit": -5}, "/pd/rotatum_limit is -5"),
        ({"profile": {"velocity": 0}}, "/pd/profile/velocity is 0; valid: a finite number above 0"),
        ({"setpoint": [9.0, 0.0]}, "a 9 is outside -1 to 1.5"),
        ({"gravity": "yes"}, "valid: true or false"),
    ],
)
def test_a_bad_parameter_is_refused_at_load_by_name(extra, words):
    joints = extra.pop("joints", ("a", "b"))
    assert words in refusal(joints=joints, description=URDF, **extra)


def test_gains_may_be_a_number_a_list_or_a_dict():
    for kp in (100.0, [100.0, 100.0], {"b": 100.0, "a": 100.0}):
        bench = lab(kp=kp, rotatum_limit=0, profile={"enabled": False})
        command(bench, 1.0, 1.0)
        assert bench.run(DT).history[-1][2] == pytest.approx([100.0, 100.0])


def test_live_gains_take_over_linearly_within_the_ramp():
    bench = lab(rotatum_limit=0, kd=0.0, gain_ramp=1.0, profile={"enabled": False})
    bench.hw.blocked = True
    command(bench, 1.0, 1.0)
    bench.run(0.1)
    bench.node.set_live("/pd", {"kp_a": 200.0})
    bench.run(1.5)
    torque = {round(row[0], 3): row[2] for row in bench.history}
    assert torque[0.1] == pytest.approx([100.0, 100.0])
    assert torque[0.6] == pytest.approx([150.0, 100.0])
    assert torque[1.2] == pytest.approx([200.0, 100.0])


def test_kp_all_sets_every_joint():
    bench = lab()
    values = bench.node.set_live("/pd", {"kp_all": 30.0})
    assert (values["kp_a"], values["kp_b"]) == (30.0, 30.0)


@pytest.mark.parametrize("name", ["kp_a", "kd_b", "kp_all"])
def test_a_live_gain_below_zero_is_refused_and_the_one_before_stays(name):
    bench = lab()
    with pytest.raises(HricError, match=name):
        bench.node.set_live("/pd", {name: -1.0})
    assert bench.node.param(f"pd/{name}") == (20.0 if name.startswith("kd") else 100.0)


def test_the_yaml_wins_over_live_gains_of_an_earlier_run():
    bench = lab()
    bench.node.set_live("/pd", {"kp_a": 5.0})
    bench.manager.switch([], ["pd"])
    bench.manager.unload("pd")
    bench.load("pd")
    assert bench.node.param("pd/kp_a") == 100.0


@pytest.mark.parametrize("name", ["kp_all", "kd_all", "kp_a", "kd_b"])
def test_a_live_gain_given_before_the_start_is_refused_with_the_keys_that_act(name):
    text = refusal(**{name: 50.0})
    assert f"/pd/{name} cannot be given before the start; valid: kp and kd" in text


def test_an_arm_and_a_controller_that_both_add_gravity_are_refused_by_name():
    text = refusal(gravity=True, description=URDF)
    assert "both the arm Rig and the controller pd would add g(q)" in text


def test_with_gravity_it_starts_from_the_gravity_torque_and_carries_the_arm_at_once():
    bench = lab(gravity=True, description=URDF, kd=0.0, rig={"compensates_gravity": False})
    bench.run(DT)
    assert bench.history[-1][2] == pytest.approx([0.0, -2 * 9.81 * 0.5])


def test_gravity_follows_the_order_of_the_joints():
    bench = lab(gravity=True, description=URDF, kd=0.0, joints=("b", "a"), rig={"compensates_gravity": False})
    assert bench.run(DT).history[-1][2] == pytest.approx([0.0, -2 * 9.81 * 0.5])


def test_gravity_without_a_description_is_refused_by_name():
    assert "robot_description" in refusal(gravity=True, rig={"compensates_gravity": False})


BOUND_B = 2 / 0.001 * (0.1 + 2 * 0.25)  # 2/dt (Iyy + m c^2): joint b alone, since a turns about another axis


def test_a_damping_beyond_the_bound_of_the_sampled_loop_is_warned_of(caplog):
    with caplog.at_level(logging.WARNING, "hric"):
        lab(description=URDF, kd=BOUND_B * 1.01)
    text = "\n".join(record.getMessage() for record in caplog.records)
    assert "b 1212 (at most 1.2e+03)" in text
    assert "rotor inertia B taken as 0" in text


def test_a_damping_within_the_bound_gives_no_warning(caplog):
    lab(description=URDF, kd={"a": 0.0, "b": BOUND_B * 0.99})
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_strict_gains_refuse_what_would_be_warned_of():
    assert "refused because the parameter strict_gains is true" in refusal(
        description=URDF, kd=BOUND_B * 1.01, strict_gains=True
    )


def test_rotor_inertia_raises_the_bound(caplog):
    lab(description=URDF, kd={"a": 0.0, "b": BOUND_B * 1.1}, rotor_inertia=0.1, strict_gains=True)
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_a_live_damping_beyond_the_bound_is_refused_when_strict():
    bench = lab(description=URDF, strict_gains=True)
    with pytest.raises(HricError, match="refused because the parameter strict_gains is true"):
        bench.node.set_live("/pd", {"kd_b": BOUND_B * 2})
    assert bench.node.param("pd/kd_b") == 20.0


def test_the_state_is_published_at_100_hz_with_desired_actual_and_error():
    bench = lab().run(0.05)
    command(bench, 0.5, 0.0)
    bench.run(0.95)
    states = bench.published("/pd/state")
    assert len(states) == 100
    last = states[-1]
    assert isinstance(last, JointTrajectoryControllerState)
    assert last.joint_names == ["a", "b"]
    assert last.error.positions[0] == pytest.approx(last.desired.positions[0] - last.actual.positions[0])
    assert last.header.stamp.to_sec() == pytest.approx(0.99)


def test_unloading_takes_all_topics_back():
    bench = lab()
    bench.manager.switch([], ["pd"])
    bench.manager.unload("pd")
    assert "/pd/state" not in bench.node.topics()
    assert "/pd/command" not in bench.node.topics()
