"""Bounds on the cost of the control cycle, as ratios to the engine's bare step in the same run."""

from collections.abc import Callable
from pathlib import Path

import pytest
from cycle_cost import FRANKA, GENERIC, measure, share_of_the_accurate_step

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]


@pytest.mark.parametrize(
    ("robot", "rotor_inertia", "bound"), [(GENERIC, 0.0, 4.0), (GENERIC, 0.1, 6.0), (FRANKA, 0.1, 15.0)]
)
def test_a_whole_headless_cycle_costs_at_most_a_few_bare_engine_steps(
    robot: str, rotor_inertia: float, bound: float, tmp_path: Path, figure: Figure
) -> None:
    cost = measure(rotor_inertia, tmp_path, robot_hw=robot)
    figure(f"{robot}, rotor inertia {rotor_inertia:g} kg m^2: whole cycle beside a bare step", cost.ratio, "1")
    figure(
        f"{robot}, rotor inertia {rotor_inertia:g} kg m^2: robot time per processor time", cost.real_time_factor, "1"
    )
    assert cost.ratio <= bound, cost


@pytest.mark.parametrize(("rotor_inertia", "bound"), [(0.0, 1.3), (0.1, 1.1)])
def test_the_step_of_second_order_makes_a_whole_cycle_little_dearer(
    rotor_inertia: float, bound: float, figure: Figure
) -> None:
    share = share_of_the_accurate_step(rotor_inertia)
    figure(
        f"rotor inertia {rotor_inertia:g} kg m^2: cycle with the step of second order beside the engine's own",
        share,
        "1",
    )
    assert share <= bound
