"""Poses as lists, against pinocchio."""

import numpy as np
import pinocchio
import pytest

from franka_hw_interface.transforms import is_pose
from franka_sim.box.kinematics import moved, twist_between

DT = 0.001


def test_the_twist_between_two_poses_is_pinocchios_logarithm_and_leads_there() -> None:
    rng = np.random.default_rng(0)
    for angle in (0.0, 1e-9, 1e-5, 1e-3, 0.3, 1.5):
        R, rotation = pinocchio.exp3(rng.normal(size=3)), rng.normal(size=3)
        rotation *= angle / np.linalg.norm(rotation)
        T, goal = np.eye(4), np.eye(4)
        T[:3, :3], goal[:3, :3], goal[:3, 3] = R, pinocchio.exp3(rotation) @ R, rng.normal(size=3)
        a, b = T.T.ravel().tolist(), goal.T.ravel().tolist()
        twist = twist_between(a, b, DT)
        np.testing.assert_allclose(twist[3:], pinocchio.log3(goal[:3, :3] @ R.T) / DT, atol=1e-12)
        np.testing.assert_allclose(moved(a, twist, DT), b, atol=1e-14)


def test_turns_beyond_a_right_angle_are_not_taken_for_small_ones() -> None:
    T = np.eye(4)
    for angle in (2.0, np.pi):
        T[:3, :3] = pinocchio.exp3(np.array([0.0, 0.0, angle]))
        assert np.linalg.norm(
            twist_between(np.eye(4).ravel().tolist(), T.T.ravel().tolist(), 1.0)[3:]
        ) == pytest.approx(angle)


def test_only_a_rigid_displacement_is_a_pose() -> None:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pinocchio.exp3(np.array([0.3, -0.2, 0.9])), (1.0, 2.0, 3.0)
    assert is_pose(T.T.ravel().tolist(), 1e-5)
    assert is_pose(T.astype(np.float32).T.ravel().tolist(), 1e-5)
    for row, column, change in ((0, 0, 1e-4), (3, 0, 1e-4), (3, 3, 1e-4), (1, 2, float("nan")), (0, 3, float("inf"))):
        other = T.copy()
        other[row, column] += change
        assert not is_pose(other.T.ravel().tolist(), 1e-5)
    assert not is_pose((T @ np.diag([1.0, 1.0, -1.0, 1.0])).T.ravel().tolist(), 1e-5)
