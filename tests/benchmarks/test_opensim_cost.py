"""Bounds on the cost of the control cycle on OpenSim, as ratios to OpenSim's bare step in the same run."""

import pytest
from opensim_cost import BareProcess, measure

BOUNDS = {"reduced, accurate": 1.6, "reduced, semi-implicit": 2.0, "full, accurate": 2.7}


@pytest.mark.parametrize("form", BOUNDS)
def test_a_whole_cycle_on_opensim_costs_little_more_than_a_bare_step(form: str) -> None:
    # Neighbours on a shared machine only ever add to the ratio: the best of three tries tells most of the code.
    for _ in range(3):
        cost = measure(form)
        if cost.ratio <= BOUNDS[form]:
            break
    print(f"{form}: {cost}, ratio {cost.ratio:.2f}, real-time factor {cost.real_time_factor:.1f}")
    assert cost.ratio <= BOUNDS[form], cost


def test_libraries_that_are_loaded_first_are_faster_and_compute_the_same() -> None:
    with BareProcess("third_order") as installed, BareProcess("third_order", loaded_first=True) as loaded_first:
        runs = [(installed.run(100), loaded_first.run(100)) for _ in range(20)]
    assert all(first[1] == second[1] for first, second in runs)
    best = [min(run[i][0] for run in runs) for i in (0, 1)]
    print(f"a step of OpenSim: {best[0] * 1e6:.0f} us as installed, {best[1] * 1e6:.0f} us loaded first")
    assert best[1] < 0.8 * best[0]
