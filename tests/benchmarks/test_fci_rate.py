"""Limit of the processor time of the emulated arm behind libfranka, as a ratio to a constant state in the same run."""

import statistics
from collections.abc import Callable

import pytest
from turns import measure

pytestmark = pytest.mark.alone
BOUND = 0.3


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_a_control_loop_against_the_arm_has_a_good_part_of_the_rate_against_a_constant_state(
    robot: str, figure: Callable[[str, float, str], None]
) -> None:
    times = measure([f"fci/{robot}/constant", f"fci/{robot}"], rounds=9)
    ratio = statistics.median(constant / arm for constant, arm in zip(*times.values(), strict=True))
    figure(f"torque callback through libfranka, {robot}: rate", 1.0 / statistics.median(times[f"fci/{robot}"]), "Hz")
    figure(f"torque callback through libfranka, {robot}: rate beside that against a constant state", ratio, "1")
    assert ratio >= BOUND
