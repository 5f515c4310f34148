"""Motions of franka_example_controllers on every backend, against their formulas."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from driven_robot import Robot

pytestmark = pytest.mark.alone

YAML = Path(__file__).parents[2] / "src/hric_bringup/config/controllers.yaml"
SECONDS = 2.5
SWING = 1.0 - math.cos(math.pi / 5.0 * SECONDS)


def moved(connect: Callable[..., Robot], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return how far an example has moved joints, shape (7,) [rad], and end effector, shape (3,) [m], in SECONDS."""
    robot = connect()
    robot.load(name, **yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[name])
    robot.switch([name], [])
    rows: list[tuple[list[float], list[float]]] = []

    def cycle(_: float) -> None:
        rows.append((list(robot.hw.robot_state.q_d), list(robot.hw.robot_state.O_T_EE_c[12:15])))

    robot.run(SECONDS, cycle)
    assert robot.hw.error == ""
    q, p = (np.array(part) for part in zip(*rows, strict=True))
    return q[-1] - q[0], p[-1] - p[0]


def test_joint_positions_swing(connect: Callable[..., Robot]) -> None:
    expected = 0.2 * math.pi / 16.0 * SWING * np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(moved(connect, "joint_position_example_controller")[0], expected, atol=1e-3)


def test_joint_velocities_integrate_to_the_published_swing(connect: Callable[..., Robot]) -> None:
    angle = 0.05 * (SECONDS - 8.0 / (2.0 * math.pi) * math.sin(2.0 * math.pi * SECONDS / 8.0))
    np.testing.assert_allclose(moved(connect, "joint_velocity_example_controller")[0], [angle] * 7, atol=1e-3)


def test_the_pose_follows_the_arc(connect: Callable[..., Robot]) -> None:
    angle = 0.25 * math.pi * SWING
    expected = [-0.3 * math.sin(angle), 0.0, 0.3 * (1.0 - math.cos(angle))]
    np.testing.assert_allclose(moved(connect, "cartesian_pose_example_controller")[1], expected, atol=2e-3)


def test_the_twist_integrates_to_a_line(connect: Callable[..., Robot]) -> None:
    length = 0.025 * (SECONDS - 4.0 / (2.0 * math.pi) * math.sin(2.0 * math.pi * SECONDS / 4.0))
    expected = length * math.sqrt(0.5) * np.array([1.0, 0.0, -1.0])
    np.testing.assert_allclose(moved(connect, "cartesian_velocity_example_controller")[1], expected, atol=1e-3)


def test_the_elbow_moves_and_the_hand_stays(connect: Callable[..., Robot]) -> None:
    q, p = moved(connect, "elbow_example_controller")
    assert q[2] == pytest.approx(0.1 * math.pi * SWING, abs=5e-3)
    np.testing.assert_allclose(p, 0.0, atol=1e-4)
