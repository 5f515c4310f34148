"""Recorded runs with one kind of damage each: no verdict improves, and the verdict names the damaged data."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest
from mutation_law import Recorded, Tally, tally
from recorded_runs import benchmark, of_benchmark, shipped

from hric_assessment.verdict.choices import AssessmentChoices

FAST = "parameters.joint_pd_controller.profile.velocity:=2.0"
SHORT = "duration:=1.8"
TIP = 1e-5
"""Contact area for which the pressure of a soft contact is above its limit [m^2]."""
RUNS: dict[str, Callable[[], Recorded]] = {
    "contact on MuJoCo": partial(shipped, "contact", "simulator:=mujoco", SHORT),
    "contact on PyBullet": partial(shipped, "contact", "simulator:=pybullet", SHORT, FAST, area=TIP),
    "contact on OpenSim": partial(shipped, "contact", "simulator:=opensim", SHORT, FAST),
    "clamped": partial(of_benchmark, "contact", "supervised", "p05", 3, area=TIP),
    "hand guidance": partial(of_benchmark, "hand_guidance", "supervised", "p05", 0),
    "co-transport": partial(of_benchmark, "co_transport", "compliant", "p50", 2),
    "handover": partial(of_benchmark, "handover", "stiff", "p95", 3),
    "shared workspace": partial(of_benchmark, "shared_workspace", "compliant", "p95", 2),
    "shared workspace, supervised": partial(of_benchmark, "shared_workspace", "supervised", "p05", 1),
}
"""Recordings by name; together with those of known_bags a dozen."""


@pytest.mark.parametrize("name", RUNS)
def test_no_mutation_of_a_run_improves_its_verdict_and_what_it_touched_is_named(name: str) -> None:
    found = tally(RUNS[name]())
    print(found)
    assert not found.faults, "\n".join(found.faults)


@pytest.mark.slow
def test_no_mutation_of_any_run_of_the_benchmark_improves_its_verdict(
    figure: Callable[[str, float, str], None],
) -> None:
    found = Tally()
    for number, recorded in enumerate(benchmark()):
        area = TIP if number % 2 else recorded.choices.contact_area
        own = tally(replace(recorded, choices=AssessmentChoices(contact_area=area)), seed=number)
        print("\n".join([f"{number + 1}: {recorded.name}: {own}", *own.faults]), flush=True)
        found.add_all(own)
    print(found)
    figure("mutations of the benchmark's runs", found.count, "1")
    figure("of these named, or refused with the reason", found.named + found.refused, "1")
    assert not found.faults, "\n".join(found.faults)
