"""The committed policy, unchanged, on every backend: in process on each engine, and through libfranka."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from driven_robot import Robot
from geometry_msgs.msg import Point, PointStamped

from hric_core.errors import HricError

pytest.importorskip("onnxruntime", reason="scripts/setup --with learning")

pytestmark = pytest.mark.alone

SRC = Path(__file__).parents[2] / "src"
NAME, GOALS, NEAR = "policy_controller", ([0.5, 0.3, 0.4], [0.4, -0.25, 0.55]), 0.005


def test_the_policy_reaches_goals_without_a_reflex_and_within_the_limits(
    connect: Callable[..., Robot], figure: Callable[[str, float, str], None], backend: str
) -> None:
    robot, rows = connect(), list[list[float]]()
    values = yaml.safe_load(
        (SRC / "hric_controllers/config/policy_controller.yaml").read_text().replace("$(arg arm_id)", "panda")
    )
    if backend == "fr3":  # trained on the Panda
        with pytest.raises(HricError, match="the policy is of another robot: lower of panda"):
            robot.load(NAME, **values[NAME])
    robot.load(NAME, **values[NAME], other_ranges=backend == "fr3")
    robot.switch([NAME], [])
    goals = robot.node.advertise(f"{NAME}/goal", PointStamped)
    for number, goal in enumerate(GOALS):
        sent = len(rows) + 10  # libfranka's loop starts the controllers again, and a start forgets the goal

        def cycle(_: float, goal: list[float] = goal, sent: int = sent) -> None:
            rows.append(list(robot.hw.robot_state.q_d))
            if len(rows) == sent:
                goals.publish(PointStamped(point=Point(*goal)))

        robot.run(5.0, cycle)  # at the lowest speed of the policy, 0.14 m/s
        assert robot.hw.error == ""
        distance = math.dist(robot.hw.robot_state.O_T_EE[12:15], goal)
        figure(f"policy on {backend}: distance from goal {number}", 1e3 * distance, "mm")
        assert distance < NEAR
    rounding = float(8.0 * np.spacing(np.float32(2.0)) / 2.0) if backend == "fr3" else 0.0  # of its 32-bit state
    largest = 1.01 * np.array([1.5, 7.0, 500.0]) + rounding * np.array([1e3, 1e6, 1e9])
    rates = np.array([np.abs(np.diff(rows, order, axis=0)).max() * 1e3**order for order in (1, 2, 3)])
    assert np.all(rates <= largest)
