"""Cartesian impedance on the simulated arm behaves as a spring, a damper and a null-space posture."""

import itertools
import logging
import math

import numpy as np
import pytest
from arm_rig import ArmRig
from controllers_rig import DT, Lab, Rig
from geometry_msgs.msg import PoseStamped

import panda_description
from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotState
from hric_controllers.cartesian import law as cartesian_law
from hric_core import plugins
from hric_core.errors import HricError
from hric_core.geometry import Pose, quaternions
from hric_core.geometry.poses import difference

NAME = "cartesian_impedance_controller"
ARM = [f"panda_joint{i}" for i in range(1, 8)]
TIP = "panda_hand_tcp"
READY = [0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4]


def rig(**changes):
    return ArmRig(NAME, **changes)


def pose_of(state):
    return Pose.of_column_major(state.O_T_EE)


def displacement(bench, before):
    return np.array(difference(pose_of(bench.state), before))


def send(bench, position, quaternion, frame="panda_link0"):
    message = PoseStamped()
    message.header.frame_id = frame
    p, o = message.pose.position, message.pose.orientation
    p.x, p.y, p.z = position
    o.x, o.y, o.z, o.w = quaternion
    bench.publish("equilibrium_pose", message)


def push(bench, force, torque=(0.0, 0.0, 0.0)):
    bench.hw.plant.apply_wrench(TIP, force, torque, [0.0, 0.0, 0.0], -1.0)


def errors(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


def test_without_a_target_it_holds_the_end_effector_where_it_is():
    bench = rig()
    before = pose_of(bench.state)
    bench.run(1.0)
    assert np.abs(displacement(bench, before)).max() < 1e-9


def test_it_goes_to_an_equilibrium_pose_and_rests_there():
    bench = rig()
    start = pose_of(bench.state)
    goal = Pose(
        (start.position[0] + 0.1, start.position[1] - 0.05, start.position[2] + 0.1),
        quaternions.product(quaternions.from_rotation_vector((0.1, 0.2, 0.3)), start.orientation),
    )
    send(bench, goal.position, goal.orientation)
    bench.run(16.0)
    assert np.abs(displacement(bench, goal)).max() < 1e-4
    assert np.abs(bench.state.dq).max() < 2e-3  # the null space is slow: 2 sqrt(k) of damping on 0.5 N m/rad


def test_the_equilibrium_follows_a_target_with_the_filters_time_constant():
    bench = rig(filter_time=0.5, state_publish_rate=1000)
    start = pose_of(bench.state)
    send(bench, [start.position[0] + 0.1, *start.position[1:]], start.orientation)
    bench.run(0.5)
    desired = bench.messages[f"/{NAME}/desired_pose"][-1].pose.position.x - start.position[0]
    assert desired == pytest.approx(0.1 * (1.0 - math.exp(-1.0)), rel=1e-6)


@pytest.mark.parametrize("stiffness", [200.0, pytest.param(800.0, marks=pytest.mark.slow)])
def test_a_constant_wrench_displaces_it_by_the_wrench_over_the_stiffness(stiffness):
    bench = rig(translational_stiffness=stiffness, rotational_stiffness=20.0)
    before = pose_of(bench.state)
    force, torque = np.array([10.0, -5.0, 8.0]), np.array([0.5, 0.3, -0.4])
    push(bench, force, torque)
    bench.run(16.0)
    found = displacement(bench, before)
    assert found[:3] == pytest.approx(force / stiffness, rel=1e-3)
    assert found[3:] == pytest.approx(torque / 20.0, rel=1e-3)


def test_after_the_wrench_it_comes_back():
    bench = rig()
    before = pose_of(bench.state)
    push(bench, [15.0, 0.0, 0.0])  # below the arm's own threshold of collision
    bench.run(2.0)
    assert displacement(bench, before)[0] > 0.05
    bench.hw.plant.clear_wrenches()
    bench.run(12.0)
    assert np.abs(displacement(bench, before)).max() < 1e-4


@pytest.mark.slow
def test_live_stiffness_changes_the_displacement_under_the_same_wrench():
    bench = rig()
    before = pose_of(bench.state)
    push(bench, [0.0, 10.0, 0.0])
    bench.run(6.0)
    assert displacement(bench, before)[1] == pytest.approx(10.0 / 200.0, rel=5e-3)
    bench.node.set_live(f"/{NAME}", {"translational_stiffness": 400.0})
    bench.run(6.0)
    assert displacement(bench, before)[1] == pytest.approx(10.0 / 400.0, rel=5e-3)


def released(bench, force, seconds):
    """Displacement of the end effector after a constant force is taken away, shape (n, 6)."""
    before = pose_of(bench.state)
    push(bench, force)
    bench.run(12.0)
    rows = [displacement(bench, before)]
    bench.hw.plant.clear_wrenches()
    bench.run(seconds, on_cycle=lambda time: rows.append(displacement(bench, before)))
    return np.array(rows[2:])


def linear(inertia, damping, stiffness, start, n):
    """Free motion of `inertia x'' + damping x' + stiffness x = 0` from `start` at rest, one row per millisecond."""
    from scipy.linalg import expm

    inverse = np.linalg.inv(inertia)
    size = len(start)
    A = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ stiffness, -inverse @ damping]])
    step, x = expm(A * DT), np.concatenate([start, np.zeros(size)])
    rows = []
    for _ in range(n):
        rows.append(x[:size])
        x = step @ x
    return np.array(rows)


def cartesian_inertia(bench):
    """Lambda of the end effector with the plant's rotor inertia, shape (6, 6)."""
    J = bench.hw.model.zero_jacobian(FrankaFrame.END_EFFECTOR, bench.state.q)
    mass = bench.hw.model.mass(bench.state.q) + np.diag(bench.hw.rotor_inertia)
    return np.linalg.inv(J @ np.linalg.solve(mass, J.T))


@pytest.mark.parametrize("ratio", [0.2, pytest.param(1.0, marks=pytest.mark.slow)])
def test_it_swings_out_as_its_damping_ratio_says(ratio):
    bench = rig(translational_damping_ratio=ratio, rotational_damping_ratio=ratio)
    inertia = cartesian_inertia(bench)
    found = released(bench, [0.0, 0.0, 2.0], 1.0)
    K = np.diag([200.0] * 3 + [10.0] * 3)
    D = 2.0 * ratio * np.sqrt(K)
    expected = linear(inertia, D, K, found[0], len(found))
    assert np.abs(found - expected)[:, 2].max() < 0.03 * abs(found[0, 2])
    if ratio < 0.5:
        assert found[:, 2].min() < -0.3 * found[0, 2]


def test_the_posture_moves_the_elbow_and_not_the_end_effector():
    bench = rig(nullspace_stiffness=5.0, nullspace_posture=[0.4, *READY[1:]])
    before, rows = pose_of(bench.state), []
    bench.run(8.0, on_cycle=lambda time: rows.append(np.abs(displacement(bench, before))))
    worst = np.max(rows, axis=0)
    assert max(abs(q - r) for q, r in zip(bench.state.q, READY, strict=True)) > 0.2
    # Sideways and about x and z the posture's torque would act (0.6 mm and 2.5 mrad with a projector that knows no
    # inertia); in the arm's own plane only the centripetal acceleration of the elbow's motion does.
    assert max(worst[1], worst[3], worst[5]) < 5e-5
    assert max(worst) < 1e-3
    assert max(rows[-1]) < 1e-5


def test_the_null_space_accelerates_the_end_effector_by_nothing():
    model, random = (
        KdlFrankaModel(panda_description.load(arm_id="panda", meshes=False), "panda"),
        np.random.default_rng(1),
    )
    for _ in range(50):
        q = np.array(READY) + random.uniform(-0.5, 0.5, 7)
        J, mass, tau_0 = (
            model.zero_jacobian(FrankaFrame.END_EFFECTOR, q),
            model.mass(q) + 0.1 * np.eye(7),
            random.normal(size=7),
        )
        tau = cartesian_law.null_space(J, mass, tau_0)
        assert np.linalg.norm(tau) > 1e-3
        assert np.abs(J @ np.linalg.solve(mass, tau)).max() < 1e-4


def test_without_nullspace_stiffness_the_posture_exerts_nothing():
    bench = rig(nullspace_stiffness=0.0, nullspace_posture=[0.4, *READY[1:]])
    bench.run(0.5)
    assert bench.state.q == pytest.approx(READY, abs=1e-9)


def test_the_rate_of_torque_is_limited_from_the_first_cycle_on():
    bench = rig(filter_time=0.0, translational_stiffness=2000.0, state_publish_rate=0)
    start = pose_of(bench.state)
    bench.torques.clear()
    send(bench, [start.position[0] + 0.02, *start.position[1:]], start.orientation)
    commands = []
    handle = bench.hw.robot_state
    bench.run(0.1, on_cycle=lambda time: commands.append(list(handle.tau_J_d)))
    steps = [abs(b - a) for one, two in itertools.pairwise(commands) for a, b in zip(one, two, strict=True)]
    assert max(steps) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p, q: ([math.nan, *p[1:]], q), "position is not finite"),
        (lambda p, q: (p, [math.inf, *q[1:]]), "orientation is not finite"),
        (lambda p, q: (p, [0.0] * 4), "its norm is 0"),
        (lambda p, q: (p, [2.0 * value for value in q]), "is not a unit quaternion"),
        (lambda p, q: ([p[0] + 0.31, *p[1:]], q), "0.31 m from the present equilibrium; valid: up to 0.3 m"),
        (
            lambda p, q: (p, quaternions.product(quaternions.from_rotation_vector((0.0, 0.0, 1.7)), tuple(q))),
            "1.7 rad from the present equilibrium",
        ),
    ],
)
def test_a_bad_equilibrium_pose_gives_one_clear_error_and_the_arm_stays(caplog, change, words):
    bench = rig().run(0.01)
    before = pose_of(bench.state)
    with caplog.at_level(logging.ERROR, "hric"):
        send(bench, *change(list(before.position), list(before.orientation)))
    assert len(errors(caplog)) == 1
    assert words in errors(caplog)[0]
    assert f"/{NAME}/equilibrium_pose" in errors(caplog)[0]
    bench.run(0.5)
    assert np.abs(displacement(bench, before)).max() < 1e-9


@pytest.mark.parametrize(
    ("frame", "taken"), [("", True), ("/panda_link0", True), ("world", False), ("panda_hand", False)]
)
def test_a_pose_is_taken_in_the_base_frame_only(caplog, frame, taken):
    bench = rig().run(0.01)
    start = pose_of(bench.state)
    with caplog.at_level(logging.ERROR, "hric"):
        send(bench, [start.position[0] + 0.05, *start.position[1:]], start.orientation, frame)
    bench.run(1.5)
    assert bool(displacement(bench, start)[0] > 0.04) is taken
    assert bool(errors(caplog)) is not taken
    if not taken:
        assert "valid: panda_link0" in errors(caplog)[0]


def test_the_opposite_quaternion_is_the_same_pose():
    bench = rig().run(0.01)
    start = pose_of(bench.state)
    send(bench, start.position, [-value for value in start.orientation])
    bench.run(1.0)
    assert np.abs(displacement(bench, start)).max() < 1e-9


def test_a_pose_while_stopped_is_refused_and_not_kept(caplog):
    bench = rig(start=False)
    start = pose_of(bench.state)
    send(bench, [start.position[0] + 0.05, *start.position[1:]], start.orientation)
    assert "not running" in errors(caplog)[0]
    bench.manager.switch([NAME], [])
    bench.run(0.5)
    assert np.abs(displacement(bench, start)).max() < 1e-6


def test_after_a_restart_it_holds_where_it_is_and_forgets_the_target():
    bench = rig()
    start = pose_of(bench.state)
    send(bench, [start.position[0] + 0.1, *start.position[1:]], start.orientation)
    bench.run(0.3)
    bench.hw.set_configuration(READY)
    bench.run(1.0, reset=True)
    assert np.abs(displacement(bench, start)).max() < 1e-6


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("translational_stiffness", -1.0),
        ("rotational_stiffness", 301.0),
        ("nullspace_stiffness", math.nan),
        ("translational_damping_ratio", 2.5),
    ],
)
def test_a_live_gain_out_of_range_is_refused_and_the_one_before_stays(name, value):
    bench = rig()
    before = bench.node.param(f"{NAME}/{name}")
    with pytest.raises(HricError, match=name):
        bench.node.set_live(f"/{NAME}", {name: value})
    assert bench.node.param(f"{NAME}/{name}") == before


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"arm_id": "left"}, "joint_names is"),
        ({"arm_id": ""}, "valid: the arm's name"),
        ({"joint_names": list(reversed(ARM))}, "valid: the arm's joints in order, panda_joint1"),
        ({"translational_stiffness": -1.0}, "translational_stiffness is -1.0; valid: a finite number from 0 to 3000"),
        ({"rotational_damping_ratio": "high"}, "rotational_damping_ratio is 'high'"),
        ({"filter_time": -1.0}, "filter_time is -1.0"),
        ({"largest_step": 0.0}, "largest_step is 0.0"),
        ({"nullspace_posture": [9.0] * 7}, "nullspace_posture: panda_joint1 9 is outside"),
        ({"nullspace_posture": [0.0]}, "nullspace_posture is [0.0]; valid: 7 values"),
        ({"gravity": True}, "both the arm FrankaHWSim and the controller cartesian_impedance_controller would add g"),
    ],
)
def test_a_bad_parameter_is_refused_at_load_by_name(changes, words):
    with pytest.raises(HricError) as caught:
        rig(**changes)
    assert words in str(caught.value)


def test_an_arm_that_does_not_carry_itself_gets_the_gravity_torque_from_the_first_cycle_on():
    hw = Rig(ARM, compensates_gravity=False)
    model, state = KdlFrankaModel(panda_description.load(arm_id="panda", meshes=False), "panda"), RobotState()
    hw.states.position[:] = state.q[:] = READY
    T = model.pose(FrankaFrame.END_EFFECTOR, READY)
    state.O_T_EE[:] = T.T.ravel().tolist()
    hw.register_interface(FrankaStateInterface("panda", state))
    hw.register_interface(FrankaModelInterface("panda", model, state))
    kind = {
        "type": "hric_controllers/CartesianImpedanceController",
        "arm_id": "panda",
        "joint_names": ARM,
        "gravity": True,
    }
    bench = Lab({"ci": kind}, hw=hw).load("ci").run(DT)
    assert bench.history[0][2] == pytest.approx(model.gravity_list(READY), abs=1e-9)


def test_it_publishes_where_it_shall_be_where_it_is_and_the_wrench_it_exerts():
    bench = rig()
    push(bench, [10.0, 0.0, 0.0])
    bench.run(6.0)
    desired, measured, wrench = (
        bench.messages[f"/{NAME}/{topic}"][-1] for topic in ("desired_pose", "measured_pose", "commanded_wrench")
    )
    assert {message.header.frame_id for message in (desired, measured, wrench)} == {"panda_link0"}
    assert measured.pose.position.x - desired.pose.position.x == pytest.approx(10.0 / 200.0, rel=5e-3)
    assert wrench.wrench.force.x == pytest.approx(-10.0, rel=5e-3)
    assert len(bench.messages[f"/{NAME}/measured_pose"]) == pytest.approx(600, abs=1)


def test_unloading_takes_all_topics_back():
    bench = rig()
    bench.manager.switch([], [NAME])
    bench.manager.unload(NAME)
    assert not [topic for topic in bench.node.topics() if topic.startswith(f"/{NAME}/")]


def test_the_type_name_of_franka_ros_finds_it():
    names = (
        "franka_example_controllers/CartesianImpedanceExampleController",
        "hric_controllers/CartesianImpedanceController",
    )
    assert plugins.find(plugins.CONTROLLER, names[0]) is plugins.find(plugins.CONTROLLER, names[1])
