"""Options of the Cartesian impedance controller on the simulated arm: bounded error, repulsion from joint limits,
wrench feed-forward, energy tank."""

import logging
import math

import numpy as np
import pytest
from arm_rig import ArmRig

import panda_description
from franka_hw_interface.model import FrankaFrame
from hric_control.speed_scale import ScaleRequest
from hric_core.errors import HricError
from hric_core.geometry import Pose, quaternions, stamped

NAME = "cartesian_impedance_controller"
STILL = (0.0, 0.0, 0.0)


def rig(**changes):
    return ArmRig(NAME, state_publish_rate=1000.0, **changes)


def torque(bench):
    """Return the torques of the last command, without gravity, shape (7,) [N m]."""
    bench.run(0.001)
    return np.array(bench.state.tau_J_d)


def pose_of(bench):
    return Pose.of_column_major(bench.state.O_T_EE)


def send_pose(bench, position, orientation):
    bench.publish(
        "equilibrium_pose", stamped.pose_stamped(stamped.header(bench.node.now(), ""), Pose(position, orientation))
    )


def send_wrench(bench, wrench, frame="panda_link0"):
    bench.publish("feedforward_wrench", stamped.wrench_stamped(stamped.header(bench.node.now(), frame), wrench))


def moved(pose, offset):
    return tuple(a + b for a, b in zip(pose.position, offset, strict=True))


def push(bench, force, torque=STILL, seconds=-1.0):
    bench.hw.plant.apply_wrench("panda_hand_tcp", force, torque, list(STILL), seconds)


def commanded(bench):
    return bench.messages[f"/{NAME}/commanded_wrench"][-1].wrench


# -- bounded error -----------------------------------------------------------------------------------------------------


def test_beyond_the_error_limit_the_force_stays_the_same_and_keeps_its_direction():
    bench = rig(error_limit={"translation": 0.02, "rotation": 0.1}, filter_time=0.0, translational_damping_ratio=0.0)
    bench.run(0.01)
    start = pose_of(bench)
    send_pose(bench, moved(start, (0.12, 0.0, -0.16)), start.orientation)
    bench.run(0.001)
    bench.run(0.001)
    force = commanded(bench).force
    assert (force.x, force.y, force.z) == pytest.approx((2.4, 0.0, -3.2), abs=1e-3)  # 200 N/m * 0.02 m


def test_beyond_the_limit_of_rotation_the_torque_stays_the_same():
    bench = rig(error_limit={"rotation": 0.1}, filter_time=0.0, rotational_damping_ratio=0.0)
    bench.run(0.01)
    start = pose_of(bench)
    turned = quaternions.product(quaternions.from_rotation_vector((0.0, 0.0, 1.2)), start.orientation)
    send_pose(bench, start.position, turned)
    bench.run(0.002)
    assert commanded(bench).torque.z == pytest.approx(1.0, abs=1e-3)  # 10 N m/rad * 0.1 rad


def test_within_the_limit_nothing_changes():
    torques = []
    for changes in ({}, {"error_limit": {"translation": 0.2, "rotation": 1.0}}):
        bench = rig(**changes)
        bench.run(0.01)
        start = pose_of(bench)
        send_pose(bench, moved(start, (0.1, 0.0, 0.0)), start.orientation)
        torques.append(bench.run(1.0).torques)
    assert torques[0] == torques[1]


# -- repulsion from joint limits ---------------------------------------------------------------------------------------


def least_room(**repulsion):
    """Pull the hand backwards, so that joint 6 approaches its end; return the least distance from it [rad]."""
    limit = list(panda_description.joint_limits().values())[5]
    bench = rig(joint_repulsion=repulsion, largest_step=1.0, filter_time=1.0, nullspace_stiffness=0.0)
    bench.run(0.01)
    start, positions = pose_of(bench), []
    send_pose(bench, moved(start, (-0.3, 0.0, 0.3)), start.orientation)
    bench.run(6.0, on_cycle=lambda time: positions.append(bench.state.q[5]))
    assert bench.hw.error == ""
    return min(min(positions) - limit.lower, limit.upper - max(positions))


def test_the_repulsion_keeps_a_joint_away_from_the_end_of_its_range():
    free, kept = least_room(), least_room(margin=0.6, torque=20.0)
    assert kept > free + 0.1


def test_the_repulsion_is_zero_at_the_border_the_stated_torque_at_the_end_and_no_more_beyond():
    from hric_controllers.cartesian.joint_repulsion import JointRepulsion
    from hric_controllers.cartesian.settings import JointRepulsionSettings

    law = JointRepulsion(JointRepulsionSettings(0.2, 8.0, 2.0), [(-1.0, 2.0)])
    rest = {x: law.torque([x], [0.0])[0] for x in (-0.8, -0.9, -1.0, -1.5, 0.0, 1.8, 1.95, 2.0, 9.0)}
    expected = {-0.8: 0.0, -0.9: 4.0, -1.0: 8.0, -1.5: 8.0, 0.0: 0.0, 1.8: 0.0, 1.95: -6.0, 2.0: -8.0, 9.0: -8.0}
    assert rest == pytest.approx(expected)
    assert law.torque([-0.9], [0.5])[0] == pytest.approx(4.0 - 0.5 * 2.0 * 0.5)
    assert law.torque([0.0], [5.0])[0] == 0.0
    grid = np.linspace(-1.6, 2.6, 42001)
    energy = np.array([law.energy([x]) for x in grid])
    spring = np.array([law.torque([x], [0.0])[0] for x in grid])
    np.testing.assert_allclose(-np.gradient(energy, grid)[1:-1], spring[1:-1], atol=5e-3)


# -- wrench feed-forward -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["panda_link0", "panda_EE"])
def test_a_wrench_in_base_or_hand_axes_balances_the_same_push(frame):
    bench = rig(feedforward={"timeout": 0.1})
    bench.run(0.01)
    before, force, moment = pose_of(bench), (6.0, -3.0, 5.0), (0.4, 0.2, -0.3)
    push(bench, force, moment)
    opposite = [tuple(-x for x in part) for part in (force, moment)]
    for _ in range(40):
        back = quaternions.inverse(pose_of(bench).orientation)
        parts = opposite if frame == "panda_link0" else [quaternions.rotated(back, part) for part in opposite]
        send_wrench(bench, [*parts[0], *parts[1]], frame)
        bench.run(0.05)
    assert np.abs(np.subtract(pose_of(bench).position, before.position)).max() < 1e-3
    J = bench.hw.model.zero_jacobian(FrankaFrame.END_EFFECTOR, bench.state.q)
    expected = J.T @ np.concatenate(opposite)
    np.testing.assert_allclose(torque(bench), expected, atol=0.1)


def test_a_wrench_ends_when_its_topic_is_silent_and_a_warning_says_so(caplog):
    bench = rig(feedforward={"timeout": 0.1})
    bench.run(0.01)
    send_wrench(bench, [5.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    bench.run(0.09)
    held = np.abs(torque(bench)).max()
    with caplog.at_level(logging.WARNING, "hric"):
        bench.run(3.0)
    assert held > 1.0 and np.abs(torque(bench)).max() < 0.05
    assert [record.getMessage() for record in caplog.records if "feed-forward wrench ended" in record.getMessage()]


def test_a_wrench_changes_the_torque_by_no_more_than_the_rate_limit():
    bench = rig(feedforward={"timeout": 1.0})
    bench.run(0.01)
    send_wrench(bench, [0.0, 0.0, 25.0, 0.0, 0.0, 0.0])
    commands = []
    bench.run(0.05, on_cycle=lambda time: commands.append(list(bench.state.tau_J_d)))
    assert np.abs(np.diff(commands, axis=0)).max() == pytest.approx(1.0)


def test_the_supervisors_limit_of_force_bounds_the_wrench():
    bench = rig(feedforward={"timeout": 1.0})
    bench.run(0.01)
    bench.hw.speed_scale.request(ScaleRequest(scale=1.0, force=2.0))
    bench.hw.speed_scale.advance(bench.hw.loop.time, 1e-3)
    J = bench.hw.model.zero_jacobian(FrankaFrame.END_EFFECTOR, bench.state.q)
    send_wrench(bench, [0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    bench.run(0.005)
    np.testing.assert_allclose(torque(bench), J.T @ [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], atol=0.1)


@pytest.mark.parametrize(
    ("wrench", "frame", "words"),
    [
        ([40.0, 0, 0, 0, 0, 0], "panda_link0", "40 N, 0 N m; valid: up to 30 N (feedforward/largest_force)"),
        ([0, 0, 0, 0, 9.0, 0], "panda_link0", "9 N m; valid: up to 30 N"),
        ([math.nan, 0, 0, 0, 0, 0], "panda_link0", "wrench is not finite"),
        ([1.0, 0, 0, 0, 0, 0], "", "the frame ''; valid: panda_link0, panda_EE"),
        ([1.0, 0, 0, 0, 0, 0], "world", "the frame 'world'"),
    ],
)
def test_a_bad_wrench_is_refused_in_one_sentence(wrench, frame, words, caplog):
    bench = rig(feedforward={"timeout": 0.1})
    bench.run(0.01)
    with caplog.at_level(logging.ERROR, "hric"):
        send_wrench(bench, wrench, frame)
    assert len(caplog.records) == 1 and words in caplog.records[0].getMessage()
    bench.run(0.05)
    assert np.abs(torque(bench)).max() < 1e-3


def test_without_a_timeout_there_is_no_topic():
    assert not [topic for topic in rig().node.topics() if "feedforward" in topic or "tank" in topic]


# -- energy tank -------------------------------------------------------------------------------------------------------


def test_an_equilibrium_beyond_the_energy_of_the_tank_is_approached_with_that_energy():
    bench = rig(energy_tank={"initial": 0.3, "largest": 2.0}, filter_time=0.0)
    bench.run(0.01)
    start, energies = pose_of(bench), []
    goal = moved(start, (0.15, 0.0, 0.0))  # 2.25 J at 200 N/m
    send_pose(bench, goal, start.orientation)

    def note(time):
        q, dq = bench.state.q, np.array(bench.state.dq)
        inertia = bench.hw.model.mass(q) + np.diag(bench.hw.rotor_inertia)
        energies.append(0.5 * float(dq @ inertia @ dq))

    bench.run(8.0, on_cycle=note)
    assert max(energies) < 0.3
    assert np.abs(np.subtract(pose_of(bench).position, goal)).max() < 2e-3
    levels = [message.data for message in bench.messages[f"/{NAME}/tank_energy"]]
    assert 0.0 < min(levels) < 0.02 and max(levels) <= 0.31


def test_a_live_stiffness_that_the_tank_cannot_pay_for_waits():
    bench = rig(energy_tank={"initial": 0.2, "largest": 0.2}, filter_time=0.0)
    push(bench, [15.0, 0.0, 0.0])
    bench.run(4.0)  # 75 mm at 200 N/m: 0.56 J
    bench.node.set_live(f"/{NAME}", {"translational_stiffness": 2000.0})
    bench.run(0.004)
    assert commanded(bench).force.x == pytest.approx(-15.0 * (0.5625 + 0.19) / 0.5625, rel=0.03)  # not -150 N
    bench.hw.plant.clear_wrenches()
    bench.run(6.0)
    assert bench.messages[f"/{NAME}/tank_energy"][-1].data == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"energy_tank": {"initial": 3.0, "largest": 2.0}}, "energy_tank/initial is 3.0; valid: up to 2 J"),
        ({"energy_tank": {"initial": -1.0}}, "energy_tank/initial is -1.0"),
        ({"joint_repulsion": {"margin": 1.0, "torque": 0.0}}, "joint_repulsion/torque is 0.0"),
        ({"error_limit": {"translation": -0.1}}, "error_limit/translation is -0.1"),
        ({"feedforward": {"timeout": 2.0}}, "feedforward/timeout is 2.0"),
        ({"feedforward": {"time": 2.0}}, "no parameter 'time'"),
    ],
)
def test_a_bad_option_is_refused_at_load_by_name(changes, words):
    with pytest.raises(HricError) as caught:
        rig(**changes)
    assert words in str(caught.value)


def test_a_margin_without_known_ranges_or_without_room_is_refused():
    from hric_controllers.cartesian.settings import JointRepulsionSettings

    settings = JointRepulsionSettings(0.4, 5.0, 1.0)
    with pytest.raises(HricError, match=r"margin is 0\.4; valid: 0, as robot_description gives no position range"):
        settings.check_ranges("margin", ["a"], [(-math.inf, math.inf)])
    with pytest.raises(HricError, match=r"below 0\.3 rad, half of the range of b"):
        settings.check_ranges("margin", ["a", "b"], [(-math.inf, math.inf), (0.0, 0.6)])


def test_the_force_controller_refuses_a_tank():
    with pytest.raises(HricError, match=r"energy_tank/initial is 1\.0; valid: 0, as the work of a regulated force"):
        ArmRig("force_controller", energy_tank={"initial": 1.0})


def test_a_planned_motion_of_the_subclass_is_slowed_by_its_tank_and_arrives():
    name = "cartesian_pose_impedance_controller"
    tank = {"initial": 0.05, "largest": 0.5}
    bench = ArmRig(name, source="none", state_publish_rate=1000.0, energy_tank=tank, error_limit={"translation": 0.1})
    bench.run(0.01)
    start = pose_of(bench)
    goal = Pose(moved(start, (0.1, 0.0, 0.0)), start.orientation)
    bench.publish("command", stamped.pose_stamped(stamped.header(bench.node.now(), ""), goal))
    bench.run(0.6)
    behind = goal.position[0] - pose_of(bench).position[0]
    bench.run(8.0)
    assert behind > 0.05  # the planned motion alone ends after 0.5 s
    assert np.abs(np.subtract(pose_of(bench).position, goal.position)).max() < 3e-3
    levels = [message.data for message in bench.messages[f"/{name}/tank_energy"]]
    assert -1e-3 < min(levels) < 0.02
