"""The end effector follows a marker and stays compliant, on the simulated arm."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from marker_rig import MarkerRig, sinusoid

NAME = "cartesian_pose_impedance_controller"
STATE = f"/{NAME}/state"


def desired(bench):
    """Setpoints of the states, shape (n, 3) [m]."""
    return np.array([[m.desired.position.x, m.desired.position.y, m.desired.position.z] for m in bench.messages[STATE]])


def measured(bench):
    return np.array(
        [[m.measured.position.x, m.measured.position.y, m.measured.position.z] for m in bench.messages[STATE]]
    )


def still(time):
    return np.zeros(3)


def test_a_noisy_marker_is_followed_from_its_first_sample_on():
    bench = MarkerRig(NAME).follow(5.0)
    lag, rms, shaking = bench.figures(bench.measured)
    assert lag <= 0.15
    assert rms <= 3e-3
    assert shaking <= 1.5
    assert not bench.hw.error


@pytest.mark.slow
def test_the_damper_knows_the_velocity_of_the_motion_so_that_the_arm_does_not_trail():
    """Without it the spring would be stretched by D v / K = 2 * 1.5 * sqrt(800) * 0.157 / 800 = 17 mm."""
    bench = MarkerRig(NAME, noise=0.0).follow(4.0)
    assert np.abs(desired(bench) - measured(bench)).max() < 6e-3
    assert bench.messages[STATE][-1].desired_twist.linear.y == pytest.approx(
        (desired(bench)[-1] - desired(bench)[-2])[1] / 0.01, abs=5e-3
    )


def test_it_yields_to_a_push_by_the_force_over_the_stiffness():
    bench = MarkerRig(NAME, still, noise=0.0).follow(0.5)
    before = bench.measured[-1]
    bench.hw.plant.apply_wrench("panda_hand_tcp", [0.0, 8.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], -1.0)
    bench.follow(2.0)
    assert (bench.measured[-1] - before)[1] == pytest.approx(8.0 / 800.0, rel=1e-2)
    assert bench.messages[STATE][-1].tracking == "following" and not bench.hw.error


def test_in_an_occlusion_it_comes_to_rest_and_goes_on_from_there():
    bench = MarkerRig(NAME, seen=lambda time: not 1.0 <= time < 1.5, noise=0.0).follow(2.5)
    stamps = np.array([message.header.stamp.to_sec() for message in bench.messages[STATE]])
    resting = desired(bench)[(stamps > 1.3) & (stamps < 1.5)]
    assert np.ptp(resting, axis=0).max() == 0.0
    assert (desired(bench)[-1] - resting[-1])[1] == pytest.approx(sinusoid(2.5 - 0.113)[1] - sinusoid(1.5)[1], abs=3e-3)
    assert (
        np.linalg.norm(np.diff(bench.measured, n=2, axis=0), axis=1).max() / 1e-6 < 4.0
    )  # the spring smooths what the motion left [m/s^2]
    assert [message.tracking for message in bench.messages[STATE]].count("lost") > 30 and not bench.hw.error


def test_before_the_first_marker_nothing_pulls():
    bench = MarkerRig(NAME, seen=lambda time: False).follow(0.3)
    assert np.ptp(bench.measured, axis=0).max() < 1e-6


def test_the_equilibrium_has_no_topic_of_its_own():
    bench = MarkerRig(NAME, still)

    def listeners(topic):
        return bench.node.advertise(f"/{NAME}/{topic}", PoseStamped).subscribers()

    assert listeners("command") == listeners("equilibrium_pose") + 1
