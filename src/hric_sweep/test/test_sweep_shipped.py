"""Sweeps of the workspace: a run of the short form of each gives all outputs."""

import numpy as np
import pytest

from hric_sweep import definition, task
from hric_sweep.space import EDGE


def test_the_sweeps_of_the_manual_ship() -> None:
    assert definition.names() == [
        "approaches",
        "exceedance_probability",
        "handover_population",
        "peak_force",
        "tracking_faults",
        "ur5e_peak_force",
    ]


@pytest.mark.parametrize("name", definition.names())
def test_a_quick_run_of_each_gives_all_its_outputs(name: str) -> None:
    plan = definition.load(name, quick=True)
    points = plan.sampler().ask()
    assert len(points) == plan.section.quick.runs
    response = task.run(plan.task(0, plan.space.values(np.array([points[0].u]))[0], "code"))
    assert response.failure == "" and len(response.state_sha256) == 64
    assert all(value is not None for value in response.outputs.values()), response.outputs


@pytest.mark.parametrize("end", [EDGE, 1.0 - EDGE])
@pytest.mark.parametrize("name", definition.names())
def test_the_ends_of_all_distributions_can_be_simulated(name: str, end: float) -> None:
    plan = definition.load(name)
    values = plan.space.values(np.full((1, len(plan.space.names)), end))[0]
    begun = task.reference(plan.task(0, values, "code"))
    assert len(begun.state_sha256) == 64


@pytest.mark.parametrize("name", ["peak_force", "ur5e_peak_force"])
def test_a_contact_that_the_end_of_a_run_cuts_off_is_no_exceedance(name: str) -> None:
    plan = definition.load(name, quick=True)
    for index, point in enumerate(plan.sampler().ask()):
        response = task.run(plan.task(index, plan.space.values(np.array([point.u]))[0], "code"))
        assert 0.0 < (response.outputs["share"] or 0.0) < 1.0, response.outputs
