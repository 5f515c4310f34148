"""Processor time of a simulated human per cycle, as a ratio to PyBullet's bare step in the same run."""

import math
import statistics
from collections.abc import Callable

import pytest
from turns import measure

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]
BOUND = 5.7
"""Largest additional time of a grip per cycle, in bare steps of PyBullet: 60 us if a bare step takes 10.5 us."""


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "opensim"])
def test_a_grip_adds_few_bare_steps_to_a_cycle_with_a_human_arm(engine: str, figure: Figure) -> None:
    cases = ["bare/pybullet", *(f"human/{engine}/{beside}" for beside in ("alone", "arm", "grip"))]
    times = measure(cases, rounds=40)
    bare, alone, arm, grip = (statistics.median(times[case]) for case in cases)
    added = statistics.median(
        (g - a) / b for b, a, g in zip(times[cases[0]], times[cases[2]], times[cases[3]], strict=True)
    )
    figure(f"{engine}: robot alone, in bare steps of PyBullet", alone / bare, "1")
    figure(f"{engine}: with a human arm beside the robot alone", arm / alone, "1")
    figure(f"{engine}: with arm and grip beside the robot alone", grip / alone, "1")
    figure(f"{engine}: what the grip adds, in bare steps", added, "1")
    figure(f"{engine}: what the grip adds", 1e6 * (grip - arm), "us")
    assert added <= BOUND


def test_what_needs_no_engine_costs_few_bare_steps(figure: Figure) -> None:
    times = measure(["bare/pybullet", "human/law"], rounds=40)
    cost = statistics.median(law / bare for bare, law in zip(*times.values(), strict=True))
    figure("the human's law in bare steps of PyBullet", cost, "1")
    figure("the human's law", 1e6 * statistics.median(times["human/law"]), "us")
    assert cost <= BOUND


def test_muscles_need_no_engine_and_cost_few_bare_steps(figure: Figure) -> None:
    times = measure(["bare/pybullet", "human/muscles"], rounds=40)
    cost = statistics.median(both / bare for bare, both in zip(*times.values(), strict=True))
    figure("the human's law and 34 muscles in bare steps of PyBullet", cost, "1")
    figure("the human's law and 34 muscles", 1e6 * statistics.median(times["human/muscles"]), "us")
    assert cost <= 19.0, "200 us where a bare step takes 10.5"


@pytest.mark.parametrize(("engine", "bound"), [("mujoco", math.inf), ("pybullet", 8.6), ("opensim", 3.0)])
def test_a_cycle_with_muscles_costs_few_cycles_of_the_robot_alone(engine: str, bound: float, figure: Figure) -> None:
    times = measure([f"human/{engine}/alone", f"human/{engine}/muscles"], rounds=40)
    cost = statistics.median(both / alone for alone, both in zip(*times.values(), strict=True))
    figure(f"{engine}: with 34 muscles and grip beside the robot alone", cost, "1")
    assert cost <= bound
