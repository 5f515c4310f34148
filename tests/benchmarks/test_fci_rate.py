"""Bound on what the emulated arm costs a control loop through libfranka, as a ratio to a constant state in the same
run."""

from collections.abc import Callable

import pytest
from fci_rate import measure

pytestmark = pytest.mark.alone

BOUND = 0.3


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_a_control_loop_against_the_arm_has_a_good_part_of_the_rate_against_a_constant_state(
    robot: str, figure: Callable[[str, float, str], None]
) -> None:
    rate = measure(robot, rounds=9)
    figure(f"torque callback through libfranka, {robot}: rate", rate.arm_hz, "Hz")
    figure(f"torque callback through libfranka, {robot}: rate beside that against a constant state", rate.ratio, "1")
    assert rate.ratio >= BOUND, rate
