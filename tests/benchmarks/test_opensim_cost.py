"""Limits of the processor time of a control cycle on OpenSim, as ratios to OpenSim's bare step in the same run."""

import statistics
from collections.abc import Callable

import pytest
from turns import measure

pytestmark = [pytest.mark.alone, pytest.mark.live]
Figure = Callable[[str, float, str], None]
BOUNDS = {
    "cycle/opensim/generic": ("accurate", 1.6),
    "cycle/opensim/generic/semi_implicit": ("semi_implicit", 2.0),
    "cycle/opensim/full": ("accurate", 2.7),
}
"""Integrator of the bare step with the same libraries loaded, and largest ratio of a cycle to it, by case."""


@pytest.mark.parametrize("case", BOUNDS)
def test_a_whole_cycle_on_opensim_costs_little_more_than_a_bare_step(case: str, figure: Figure) -> None:
    step, bound = BOUNDS[case]
    times = measure([f"bare/opensim/{step}", case], rounds=40)
    cost = statistics.median(cycle / bare for bare, cycle in zip(*times.values(), strict=True))
    figure(f"{case} beside a bare step with the same libraries", cost, "1")
    figure(f"{case}: robot time per processor time", 1e-3 / statistics.median(times[case]), "1")
    assert cost <= bound


def test_libraries_that_are_loaded_first_are_faster(figure: Figure) -> None:
    times = measure(["bare/opensim/installed", "bare/opensim/accurate"])
    ratio = statistics.median(first / installed for installed, first in zip(*times.values(), strict=True))
    figure("OpenSim: bare step with the libraries loaded first beside one as installed", ratio, "1")
    assert ratio < 0.8
