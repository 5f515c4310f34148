"""Admittance control on every backend: a push moves the arm as the virtual mass and damper, and locked axes hold."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from contract_robots import PLANTS, Boxes, connected
from driven_robot import Robot

from hric_control.speed_scale import ScaleRequest
from hric_core.errors import HricError

pytestmark = pytest.mark.alone

YAML = Path(__file__).parents[2] / "src" / "hric_bringup" / "config" / "controllers.yaml"
NAME = "admittance_controller"
FORCE, SECONDS, DAMPING, DEAD_BAND = 10.0, 1.5, 100.0, 2.0
"""Push along x [N] and its duration [s]; virtual damping [N s/m] and dead band [N]."""
STILL = 500
"""Cycles before the push, with the tare."""


def loaded(robot: Robot, **changes: object) -> None:
    """Load the controller with the parameters of controllers.yaml and these changes."""
    parameters = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[NAME]
    robot.load(NAME, **parameters | changes)


def pushed(robot: Robot, backend: str, boxes: Boxes) -> None:
    """Push link 7 along x."""
    if backend in PLANTS:
        still = (0.0, 0.0, 0.0)
        robot.hw.plant.apply_wrench("panda_link7", (FORCE, 0.0, 0.0), still, still, SECONDS)
    else:
        boxes.order(backend, f"push {backend}_link7 {FORCE} 0 0 {SECONDS}")


def led(robot: Robot, backend: str, boxes: Boxes) -> np.ndarray:
    """Push the arm 0.5 s after the start; return the commanded position of each cycle, shape (n, 3) [m]."""
    rows: list[list[float]] = []

    def cycle(time: float) -> None:
        robot.hw.speed_scale.advance(time, 1e-3)
        rows.append(list(robot.hw.robot_state.O_T_EE_c[12:15]))
        if len(rows) == STILL:
            pushed(robot, backend, boxes)

    robot.switch([NAME], [])
    robot.run(0.001 * STILL + SECONDS + 1.0, cycle)
    assert robot.hw.error == ""
    return np.array(rows)


def test_a_push_moves_the_arm_at_the_speed_of_the_damper_and_locked_axes_hold(
    connect: Callable[..., Robot], backend: str, boxes: Boxes, figure: Callable[[str, float, str], None]
) -> None:
    robot = connect()
    loaded(robot, damping=DAMPING, locked=["y", "z", "rx", "ry", "rz"])
    rows = led(robot, backend, boxes)
    expected = (FORCE - DEAD_BAND) / DAMPING
    speed = float(np.diff(rows[:, 0]).max()) * 1e3
    figure(f"admittance, {backend}: speed of the damper", speed / expected, "of (F - dead band)/damping")
    assert np.abs(rows[:STILL] - rows[0]).max() < 1e-9
    assert speed == pytest.approx(expected, rel=0.1)
    assert np.abs(rows[:, 1:] - rows[0, 1:]).max() < 1e-6
    assert np.abs(np.diff(rows[-100:, 0])).max() * 1e3 < 1e-3


def test_the_speed_scale_bounds_the_speed_of_the_led_arm(
    connect: Callable[..., Robot], backend: str, boxes: Boxes
) -> None:
    robot = connect()
    loaded(robot, damping=DAMPING)
    robot.hw.speed_scale.request(ScaleRequest(scale=0.05))
    speed = float(np.diff(led(robot, backend, boxes)[:, 0]).max()) * 1e3
    assert speed == pytest.approx(0.05 * 0.7 / np.sqrt(3.0), rel=0.02)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": 0.0}, "mass is 0.0; valid: a finite number from 1 to 100"),
        ({"damping": -1.0}, "damping is -1.0; valid: "),
        ({"locked": ["w"]}, r"locked.*'w'.*x, y, z, rx, ry, rz"),
        ({"translation": {"velocity": 9.0}}, "translation/velocity is 9.0; valid: up to "),
        ({"masse": 3.0}, "masse.*mass"),
    ],
)
def test_a_bad_parameter_is_refused_in_one_sentence(changes: dict[str, object], words: str) -> None:
    with connected("mujoco", Boxes()) as robot, pytest.raises(HricError, match=words):
        loaded(robot, **changes)
