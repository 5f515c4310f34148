"""Limits of the processor time of a control cycle, as ratios to PyBullet's bare step in the same run."""

from collections.abc import Callable

import pytest
from turns import ratio

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]
BOUNDS = {
    "cycle/pybullet/generic": 2.8,
    "cycle/pybullet/rotors": 3.3,
    "cycle/pybullet/franka": 4.0,
    "cycle/mujoco/generic": 2.4,
    "cycle/mujoco/rotors": 2.4,
    "cycle/mujoco/franka": 2.9,
    "cycle/mujoco/generic/semi_implicit": 1.5,
    "cycle/mujoco/rotors/semi_implicit": 1.6,
    "cycle/mujoco/franka/semi_implicit": 2.1,
}


@pytest.mark.parametrize("case", BOUNDS)
def test_a_whole_headless_cycle_costs_at_most_a_few_bare_engine_steps(case: str, figure: Figure) -> None:
    cost = ratio(case, "bare/pybullet", rounds=40)
    figure(f"{case} beside a bare step of PyBullet", cost, "1")
    assert cost <= BOUNDS[case]


@pytest.mark.parametrize(("robot", "bound"), [("generic", 1.3), ("rotors", 1.1)])
def test_the_step_of_second_order_makes_a_whole_cycle_on_pybullet_little_dearer(
    robot: str, bound: float, figure: Figure
) -> None:
    share = ratio(f"cycle/pybullet/{robot}", f"cycle/pybullet/{robot}/semi_implicit", rounds=40)
    figure(f"cycle/pybullet/{robot} beside one with the engine's own step", share, "1")
    assert share <= bound
