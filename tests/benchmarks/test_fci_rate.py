"""Bound on what the emulated arm costs a control loop through libfranka, as a ratio to a constant state in the same run."""

import pytest
from fci_rate import measure

BOUND = 0.3


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_a_control_loop_against_the_arm_has_a_good_part_of_the_rate_against_a_constant_state(robot: str) -> None:
    # Neighbours on a shared machine only ever lower the ratio: the best of three tries tells most of the code.
    for _ in range(3):
        rate = measure(robot, rounds=5)
        if rate.ratio >= BOUND:
            break
    print(f"{robot}: {rate}")
    assert rate.ratio >= BOUND, rate
