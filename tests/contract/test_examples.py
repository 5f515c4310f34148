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
SWING = 2.0
"""Factor 1 - cos(pi t / 5) of the swinging motions after 5 s, when they turn [1]."""


def moved(connect: Callable[..., Robot], name: str, seconds: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """Return how far an example has moved joints, shape (7,) [rad], and end effector, shape (3,) [m], until it turns.

    It runs until it is back: the next test begins there, and libfranka ends no motion while the arm moves.
    """
    robot = connect()
    robot.load(name, **yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[name])
    robot.switch([name], [])
    rows: list[tuple[list[float], list[float]]] = []

    def cycle(_: float) -> None:
        rows.append((list(robot.hw.robot_state.q_d), list(robot.hw.robot_state.O_T_EE_c[12:15])))

    robot.run(2.0 * seconds, cycle)
    assert robot.hw.error == ""
    q, p = (np.array(part) for part in zip(*rows, strict=True))
    assert np.abs(q[-1] - q[0]).max() < 1e-3
    return q[len(q) // 2] - q[0], p[len(p) // 2] - p[0]


def test_joint_positions_swing(connect: Callable[..., Robot]) -> None:
    expected = 0.2 * math.pi / 16.0 * SWING * np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(moved(connect, "joint_position_example_controller")[0], expected, atol=1e-3)


def test_joint_velocities_integrate_to_the_published_swing(connect: Callable[..., Robot]) -> None:
    np.testing.assert_allclose(moved(connect, "joint_velocity_example_controller", 8.0)[0], [0.4] * 7, atol=1e-3)


def test_the_pose_follows_the_arc(connect: Callable[..., Robot], backend: str) -> None:
    if backend == "fr3":
        pytest.skip("the arc leaves the range of the FR3's joints")
    angle = 0.25 * math.pi * SWING
    expected = [-0.3 * math.sin(angle), 0.0, 0.3 * (1.0 - math.cos(angle))]
    np.testing.assert_allclose(moved(connect, "cartesian_pose_example_controller")[1], expected, atol=2e-3)


def test_the_twist_integrates_to_a_line(connect: Callable[..., Robot]) -> None:
    expected = 0.1 * math.sqrt(0.5) * np.array([1.0, 0.0, -1.0])
    np.testing.assert_allclose(moved(connect, "cartesian_velocity_example_controller", 4.0)[1], expected, atol=1e-3)


def test_the_elbow_moves_and_the_hand_stays(connect: Callable[..., Robot], backend: str) -> None:
    name = "elbow_example_controller"
    if backend == "fr3":  # its binding takes no elbow, which must not be ignored
        robot = connect()
        robot.load(name, arm_id="panda", type="franka_example_controllers/ElbowExampleController")
        robot.switch([name], [])
        robot.run(0.1)
        assert "cannot command the elbow" in robot.hw.error
        robot.hw.recover()
        return
    q, p = moved(connect, name)
    assert q[2] == pytest.approx(0.1 * math.pi * SWING, abs=5e-3)
    np.testing.assert_allclose(p, 0.0, atol=1e-4)
