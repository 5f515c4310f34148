"""Limits of the processor time of a learning environment, as ratios to PyBullet's bare step of the Panda."""

from collections.abc import Callable

import pytest
from turns import ratio

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]
BOUNDS = {
    "environment/joints": 2.3,
    "environment/cartesian": 4.3,
    "environment/person": 6.5,
    "environment/muscles": 10.0,
}
"""Limits of the cost: the measured cost and a margin for other load; the targets are 2.0, 3.5, 5 and 7."""


@pytest.mark.parametrize("case", BOUNDS)
def test_a_millisecond_of_an_environment_costs_at_most_a_few_bare_engine_steps(case: str, figure: Figure) -> None:
    cost = ratio(case, "bare/panda", rounds=40)
    figure(f"{case} beside a bare step of PyBullet's Panda", cost, "1")
    assert cost <= BOUNDS[case]
