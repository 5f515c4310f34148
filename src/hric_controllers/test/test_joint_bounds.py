"""Bounds of the joints for a stream of poses: limits that hold for any target, the box's own motion, and the log."""

import logging
import math

import genpy
import numpy as np
import pytest
from arm_rig import ArmRig
from std_msgs.msg import Header

from franka_hw_interface.limits import franka_limits
from hric_control.limits import JointLimits
from hric_core.geometry import Pose, quaternions, stamped

NAME = "cartesian_streaming_controller"
LIMITS = franka_limits()


class Streamed:
    """Arm whose end effector follows a path that is sent at 20 Hz.

    Attributes:
        joints: desired joint positions of each millisecond, shape (n, 7) [rad].
        poses: desired positions of the end effector, shape (n, 3) [m].
        predicted: joint positions that the controller predicts for the next millisecond, as lists [rad].
        shares: share of each step that was possible.
        error: error of the robot.
        bounds: bounds of the controller.
    """

    def __init__(self, path, seconds, rest=3.0, **changes):
        rig = ArmRig(NAME, **{"workspace": {"lower": [-2.0] * 3, "upper": [2.0] * 3}, **changes})
        rig.run(0.05)
        self.start = Pose.of_column_major(rig.state.O_T_EE_c)
        self.bounds = rig.manager._loaded[NAME].controller._bounds
        self.predicted, self.shares, joints, poses = [], [], [], []

        def cycle(time):
            cycles = len(joints)
            if cycles % 50 == 0 and cycles <= 1000 * seconds:
                offset, rotation = path(cycles / 1000)
                x, y, z = np.add(self.start.position, offset).tolist()
                turned = quaternions.product(quaternions.from_rotation_vector(rotation), self.start.orientation)
                header = Header(stamp=genpy.Time.from_sec(1000.0 + cycles / 1000))
                rig.publish("command", stamped.pose_stamped(header, Pose((x, y, z), turned)))
            joints.append(list(rig.state.q_d))
            poses.append(list(rig.state.O_T_EE_c[12:15]))
            self.predicted.append(self.bounds._last.q)
            self.shares.append(self.bounds.share)

        rig.run(seconds + rest, cycle)
        self.joints, self.poses, self.error = np.array(joints), np.array(poses), rig.hw.error

    def assert_within_limits(self):
        velocity, acceleration = (np.abs(np.diff(self.joints, k, axis=0)).max(axis=0) * 1e3**k for k in (1, 2))
        assert self.error == ""
        assert np.all(velocity <= LIMITS.velocity) and np.all(acceleration <= LIMITS.acceleration)
        assert np.all(self.joints >= LIMITS.lower) and np.all(self.joints <= LIMITS.upper)


def warnings(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def jumps(seed):
    """Return a path of setpoints in front of the base, many of them out of reach, and then back at the start."""
    random = np.random.default_rng(seed)
    points = [(random.uniform([-0.1, -0.7, 0.0], [0.7, 0.7, 0.6]), random.uniform(-1.2, 1.2, 3)) for _ in range(8)]
    return lambda time: points[int(time)] if time < 8.0 else (np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=pytest.mark.slow if seed else []) for seed in range(6)])
def test_poses_that_jump_at_random_never_exceed_a_limit_and_the_last_one_is_reached(seed):
    run = Streamed(jumps(seed), 9.0, rest=5.0)
    run.assert_within_limits()
    assert math.dist(run.poses[-1], run.start.position) <= 1e-3


def test_the_predicted_joint_motion_is_that_of_the_box():
    path = lambda time: ((-0.3 * min(1.0, time), 0.15 * math.sin(3.0 * time), 0.0), (0.0, 0.0, 0.0))  # noqa: E731
    run = Streamed(path, 4.0, rest=0.0)
    assert np.abs(run.joints[1:] - np.array(run.predicted[:-1])).max() <= 1e-7
    assert np.abs(np.diff(run.joints, axis=0)).max() > 1e-3  # a joint turned at more than 1 rad/s


def test_a_stream_that_the_joints_can_follow_is_not_changed(caplog):
    with caplog.at_level(logging.WARNING, "hric"):
        run = Streamed(lambda time: ((0.0, 0.08 * math.sin(2.0 * time), 0.0), (0.0, 0.0, 0.0)), 3.0, rest=0.0)
    assert min(run.shares) == 1.0 and run.bounds.reason == "" and warnings(caplog) == []
    assert np.ptp(run.poses[:, 1]) > 0.15


def test_the_end_effector_slows_down_on_its_path_and_the_log_says_why_once(caplog):
    with caplog.at_level(logging.WARNING, "hric"):
        run = Streamed(lambda time: ((0.25 * (1.0 - math.cos(math.pi * time / 3.0)), 0.0, 0.0), (0.0, 0.0, 0.0)), 6.0)
    run.assert_within_limits()
    off = np.abs(run.poses[:, 1:] - np.array(run.start.position)[1:]).max()
    assert off <= 1e-3  # the path is a line along x
    assert 0.3 < np.ptp(run.poses[:, 0]) < 0.45 and math.dist(run.poses[-1], run.start.position) <= 1e-3
    texts = warnings(caplog)
    assert any("panda_joint4 would move too fast" in text for text in texts)
    assert sum("leads to a singular pose" in text for text in texts) == 1


def test_a_joint_stops_before_the_end_of_its_range_and_the_log_names_it(caplog):
    with caplog.at_level(logging.WARNING, "hric"):
        run = Streamed(lambda time: ((0.0, 0.0, 0.0), (0.0, 0.0, -min(2.4, 0.28 * time))), 9.0, rest=1.0)
    run.assert_within_limits()
    assert 0.049 <= np.min(np.minimum(run.joints - LIMITS.lower, LIMITS.upper - run.joints)) <= 0.06
    assert any("panda_joint7 is near the end of its range, 2.897 rad" in text for text in warnings(caplog))


def test_lower_limits_of_the_robot_description_count():
    rows = [JointLimits(f"j{k}", lower=-1.0, upper=9.0, velocity=1.0 if k == 2 else math.inf) for k in range(7)]
    within = LIMITS.within(rows)
    assert within.lower == tuple(max(-1.0, x) for x in LIMITS.lower) and within.upper == LIMITS.upper
    assert within.velocity == tuple(1.0 if k == 2 else v for k, v in enumerate(LIMITS.velocity))
    assert within.acceleration == LIMITS.acceleration
