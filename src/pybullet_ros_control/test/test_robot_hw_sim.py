"""The generic simulated robot: interfaces, modes, limits, brakes, reset."""

import numpy as np
import pytest
from double_integrator_robot import DoubleIntegrator
from rigid_body_oracle import Oracle
from two_link import transmission, two_link_urdf

from hric_control.hardware_interface import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.robot_hw import ControllerInfo
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core import plugins
from hric_core.errors import CommandError, HricError
from hric_core.local.node import LocalNode

ALL = ("EffortJointInterface", "VelocityJointInterface", "PositionJointInterface")
WIDE = 'lower="-2" upper="2" effort="200" velocity="5"'


def planar(*per_joint, limit=WIDE, reduction=1.0, offset=None):
    parts = [
        transmission(f"joint{i}", *kinds, reduction=reduction, offset=offset) for i, kinds in enumerate(per_joint, 1)
    ]
    return two_link_urdf(limit=limit, transmissions="".join(parts))


def info(name, **claims):
    return ControllerInfo(
        name,
        "test/Test",
        {f"hardware_interface::{kind}JointInterface": frozenset(joints) for kind, joints in claims.items()},
    )


@pytest.fixture
def make_hw():
    robots = []

    def make(urdf, root=None, **parameters):
        node = LocalNode({"robot_description": urdf, **(root or {}), "robot": {"real_time_factor": 0.0, **parameters}})
        hw = RobotHWSim()
        hw.init(node, node.child("robot"))
        robots.append(hw)
        return hw

    yield make
    for hw in robots:
        hw.shutdown()


def run(hw, seconds, law=None):
    """Run cycles with `law(time, period)` instead of controllers."""
    left = round(seconds / hw.plant.time_step)

    def on_cycle(time, period, reset):
        nonlocal left
        left -= 1
        if law is not None:
            law(time, period)
        if left <= 0:
            hw.stop()
        return True

    hw.run(on_cycle)


def test_the_type_name_and_its_former_one_find_the_robot_and_its_plant():
    assert plugins.find(plugins.ROBOT_HW, "hric_control/RobotHWSim") is RobotHWSim
    assert plugins.find(plugins.ROBOT_HW, "pybullet_ros_control/RobotHWSim") is RobotHWSim
    assert plugins.find(plugins.PLANT, "pybullet_ros_control/PyBulletPlant").__name__ == "PyBulletPlant"


def test_interfaces_are_those_of_the_transmissions(make_hw):
    hw = make_hw(planar(("EffortJointInterface", "PositionJointInterface"), ("VelocityJointInterface",)))
    assert hw.get(JointStateInterface).names == ("joint1", "joint2")
    assert hw.get(EffortJointInterface).names == ("joint1",)
    assert hw.get(PositionJointInterface).names == ("joint1",)
    assert hw.get(VelocityJointInterface).names == ("joint2",)
    assert not hw.compensates_gravity


def test_unclaimed_joints_are_braked_and_claimed_ones_are_free(make_hw):
    hw = make_hw(planar(ALL, ALL), q_start=[0.3, 0.2])
    run(hw, 0.3)
    assert hw.states.position == pytest.approx([0.3, 0.2], abs=2e-6)
    hw.do_switch([info("one", Effort=["joint2"])], [])
    assert hw.log_row()[0] == ["none", "effort"]
    run(hw, 0.3)
    assert hw.states.position[0] == pytest.approx(0.3, abs=2e-6)
    assert hw.states.position[1] > 0.3
    hw.do_switch([], [info("one", Effort=["joint2"])])
    held = hw.plant.engine_state()[0]
    run(hw, 0.3)
    assert hw.states.position == pytest.approx(held, abs=1e-5)


def test_brakes_can_be_left_out(make_hw):
    hw = make_hw(planar(ALL, ALL), q_start=[0.3, 0.2], brake_unclaimed=False)
    run(hw, 0.3)
    assert hw.states.position[0] > 0.4


def test_effort_commands_move_as_the_second_library_says(make_hw):
    urdf = planar(ALL, ALL, limit='lower="-9" upper="9" effort="900" velocity="90"')
    hw = make_hw(urdf, q_start=[0.3, 0.2], plant={"rotor_inertia": 0.1})
    hw.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    group, oracle = hw.get(EffortJointInterface).group(), Oracle(urdf, 0.1)

    def law(time, period):
        group.command = [-20.0, -5.0]

    run(hw, 0.5, law)
    q, dq = np.array([0.3, 0.2]), np.zeros(2)
    for _ in range(499):
        q, dq = oracle.hold(q, dq, np.array([-20.0, -5.0]))
    assert np.abs(np.array(hw.states.position) - q).max() < 1e-5
    assert hw.plant.motor_effort() == pytest.approx([-20.0, -5.0])
    behind_the_rotors = [-20.0, -5.0] - 0.1 * oracle.acceleration(q, dq, np.array([-20.0, -5.0]))
    assert hw.states.effort == pytest.approx(behind_the_rotors.tolist(), abs=0.1)


@pytest.mark.parametrize("gains", [None, {"p": 4000.0, "i": 2000.0, "d": 80.0, "i_clamp": 50.0}])
def test_position_commands_are_reached_by_the_drive_or_by_gains(make_hw, gains):
    root = None if gains is None else {"gazebo_ros_control": {"pid_gains": {"joint1": gains, "joint2": gains}}}
    hw = make_hw(planar(ALL, ALL), root)
    hw.do_switch([info("one", Position=["joint1", "joint2"])], [])
    group = hw.get(PositionJointInterface).group()

    def law(time, period):
        group.command = [min(0.5 * time, 0.4), -min(time, 0.8)]

    run(hw, 0.5, law)
    assert hw.states.position == pytest.approx([0.25, -0.5], abs=1e-2)
    run(hw, 1.5, law)
    assert hw.states.position == pytest.approx([0.4, -0.8], abs=1e-4 if gains is None else 2e-3)


@pytest.mark.parametrize("gains", [None, {"p": 60.0, "i": 600.0, "i_clamp": 100.0}])
def test_velocity_commands_are_reached_by_the_drive_or_by_gains(make_hw, gains):
    root = None if gains is None else {"gazebo_ros_control": {"pid_gains": {"joint1": gains, "joint2": gains}}}
    hw = make_hw(planar(ALL, ALL), root)
    hw.do_switch([info("one", Velocity=["joint1", "joint2"])], [])
    group = hw.get(VelocityJointInterface).group()

    def law(time, period):
        group.command = [0.4, -0.6]

    run(hw, 1.0, law)
    assert hw.states.velocity == pytest.approx([0.4, -0.6], abs=1e-3 if gains is None else 0.02)


def test_joints_may_be_commanded_through_different_interfaces_at_once(make_hw):
    hw = make_hw(planar(ALL, ALL), q_start=[0.1, 0.2])
    hw.do_switch([info("one", Effort=["joint1"]), info("two", Position=["joint2"])], [])
    effort, position = hw.get(EffortJointInterface).group(["joint1"]), hw.get(PositionJointInterface).group(["joint2"])

    def law(time, period):
        q, dq = hw.states.position[0], hw.states.velocity[0]
        effort.command = [300.0 * (0.1 - q) - 30.0 * dq - 20.0]
        position.command = [0.2 - 0.3 * min(time, 1.0)]

    run(hw, 1.5, law)
    assert hw.states.position[1] == pytest.approx(-0.1, abs=1e-4)
    assert hw.states.velocity == pytest.approx([0.0, 0.0], abs=1e-3)
    assert hw.log_row()[0] == ["effort", "position"]
    assert hw.limiter_counts().cycles == 1500


def test_a_controller_that_starts_in_position_mode_stays_where_the_joint_is(make_hw):
    hw = make_hw(planar(ALL, ALL), q_start=[0.3, 0.2])
    run(hw, 0.1)
    hw.do_switch([info("one", Position=["joint1", "joint2"])], [])
    run(hw, 0.1)
    assert hw.states.position == pytest.approx([0.3, 0.2], abs=1e-5)


def test_limits_cut_and_are_counted(make_hw):
    hw = make_hw(planar(ALL, ALL, limit='lower="-2" upper="2" effort="3" velocity="5"'))
    hw.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    group = hw.get(EffortJointInterface).group()

    def law(time, period):
        group.command = [7.0, -1.0]

    run(hw, 0.02, law)
    kinds, raw, sent = hw.log_row()
    assert (kinds, raw, list(sent)) == (["effort", "effort"], [7.0, -1.0], [3.0, -1.0])
    assert hw.limiter_counts().effort == [20, 0]
    free = make_hw(planar(ALL, ALL, limit='lower="-2" upper="2" effort="3" velocity="5"'), enforce_limits=["position"])
    free.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    group = free.get(EffortJointInterface).group()
    run(free, 0.02, law)
    assert list(free.log_row()[2]) == [7.0, -1.0]


def test_a_start_outside_the_range_is_said_once_and_only_inward_effort_passes(make_hw, caplog):
    hw = make_hw(
        planar(ALL, ALL, limit='lower="-2" upper="-0.1" effort="30" velocity="5"'),
        q_start=[0.0, -0.5],
        plant={"gravity": [0, 0, 0]},
    )
    hw.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    group = hw.get(EffortJointInterface).group()

    def law(time, period):
        group.command = [2.0, 0.0]

    run(hw, 0.05, law)
    assert list(hw.log_row()[2]) == [0.0, 0.0]
    assert hw.states.position[0] == pytest.approx(0.0, abs=1e-9)
    assert len([r for r in caplog.records if "joint1 starts at" in r.getMessage()]) == 1
    assert not [r for r in caplog.records if "joint2 starts at" in r.getMessage()]


def test_transmissions_give_the_actuators_state(make_hw):
    hw = make_hw(planar(ALL, ALL, reduction=50.0, offset=0.1), q_start=[0.3, 0.2])
    hw.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    group = hw.get(EffortJointInterface).group()

    def law(time, period):
        group.command = [-20.0, -5.0]

    run(hw, 0.1, law)
    position, velocity, effort = hw.actuator_states()["joint1_motor"]
    assert position == pytest.approx(50.0 * (hw.states.position[0] - 0.1))
    assert velocity == pytest.approx(50.0 * hw.states.velocity[0])
    assert effort == pytest.approx(-20.0 / 50.0)


def test_reset_puts_the_robot_back_and_robot_time_goes_on(make_hw):
    hw = make_hw(planar(ALL, ALL), q_start={"joint2": 0.2})
    hw.do_switch([info("one", Effort=["joint1", "joint2"])], [])
    run(hw, 0.2)
    first = hw.states.position[:]
    hw.reset()
    assert hw.states.position == pytest.approx([0.0, 0.2])
    assert hw.loop.time == pytest.approx(0.2)
    flags = []

    def on_cycle(time, period, reset):
        flags.append(reset)
        if len(flags) == 200:
            hw.stop()
        return True

    hw.run(on_cycle)
    assert flags[0] and not any(flags[1:])
    assert hw.states.position == first
    hw.set_configuration([0.5, -0.5])
    assert hw.states.position == [0.5, -0.5]
    with pytest.raises(CommandError, match="2 finite numbers"):
        hw.set_configuration([0.5])


def test_a_controller_that_claims_a_joint_twice_is_refused(make_hw):
    hw = make_hw(planar(ALL, ALL))
    with pytest.raises(HricError, match="one claims joint1 through both"):
        hw.prepare_switch([info("one", Effort=["joint1"], Position=["joint1"])], [])


@pytest.mark.parametrize(
    ("root", "parameters", "message"),
    [
        ({}, {"q_start": [0.0]}, r"q_start is \[0.0\]; valid: 2 values, for joint1, joint2"),
        ({}, {"q_start": {"joint9": 0.0}}, "no joint 'joint9'.*valid: joint1, joint2"),
        ({}, {"enforce_limits": ["speed"]}, r"enforce_limits\[0\] is 'speed'; valid: position, velocity"),
        ({}, {"brake_unclaimed": 1}, "brake_unclaimed is 1; valid: true or false"),
        ({}, {"plant": {"rotor": 1}}, "no parameter 'rotor' in plant; valid: .*rotor_inertia"),
        ({}, {"plant": 3}, "plant is 3; valid: a mapping"),
        ({}, {"plant_type": "nobody/NoPlant"}, "pybullet_ros_control/PyBulletPlant"),
        (
            {"gazebo_ros_control": {"pid_gains": {"joint1": {"p": 1.0, "q": 2.0}}}},
            {},
            "no parameter 'q' in .*joint1; valid: .*antiwindup, d, i",
        ),
        (
            {"gazebo_ros_control": {"pid_gains": {"joint1": {"d": 1.0}}}},
            {},
            "joint1/p is not set; valid: a finite",
        ),
    ],
)
def test_wrong_parameters_are_refused_with_the_valid_ones(make_hw, root, parameters, message):
    with pytest.raises(HricError, match=message):
        make_hw(planar(ALL, ALL), root, **parameters)


def test_a_description_without_transmissions_is_refused(make_hw):
    with pytest.raises(HricError, match="no <transmission>"):
        make_hw(two_link_urdf())


def test_velocity_interfaces_need_a_plant_with_drives_or_gains(make_hw, monkeypatch):
    monkeypatch.setattr(plugins, "find", lambda base, name: lambda urdf, names, config: DoubleIntegrator(names, 0.001))
    with pytest.raises(
        HricError, match="joint1 offers VelocityJointInterface, but DoubleIntegrator has no velocity or position drives"
    ):
        make_hw(planar(("VelocityJointInterface",), ("EffortJointInterface",)))
    gains = {"gazebo_ros_control": {"pid_gains": {"joint1": {"p": 1.0}}}}
    make_hw(planar(("VelocityJointInterface",), ("EffortJointInterface",)), gains)


def test_the_whole_panda_runs_on_it_and_two_runs_are_bit_identical(make_hw, panda_urdf):
    ends = []
    for _ in range(2):
        hw = make_hw(panda_urdf, q_start={"panda_joint4": -1.5, "panda_joint6": 1.0})
        hw.do_switch([info("one", Effort=list(hw.states.names))], [])
        group = hw.get(EffortJointInterface).group()

        def law(time, period, group=group):
            group.set_command([-2.0 * v for v in group.velocities()])

        run(hw, 0.3, law)
        ends.append((hw.states.position[:], hw.states.velocity[:]))
    assert ends[0] == ends[1]
    assert max(map(abs, ends[0][1])) > 0.1
