"""Limits of the processor time of a learning environment, as ratios to PyBullet's bare step of the Panda."""

from collections.abc import Callable

import pytest
from turns import ratio

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]
BOUNDS = {
    "environment/joints": 2.0,
    "environment/cartesian": 3.5,
    "environment/person": 5.0,
    "environment/muscles": 7.0,
}
"""Targets of the cost; about a quarter above the measured cost."""


@pytest.mark.parametrize("case", BOUNDS)
def test_a_millisecond_of_an_environment_costs_at_most_a_few_bare_engine_steps(case: str, figure: Figure) -> None:
    cost = ratio(case, "bare/panda", rounds=40)
    figure(f"{case} beside a bare step of PyBullet's Panda", cost, "1")
    assert cost <= BOUNDS[case]
