"""Predicted influence of unconfirmed numbers on a verdict, against simulations with the numbers changed."""

import math
from argparse import Namespace
from typing import Any

import pytest

import panda_description
from hric_assessment.findings import CONTACT
from hric_assessment.tables import MASS, ROTORS, STIFFNESS
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.sensitivity import sensitivity_of
from hric_core.errors import HricError
from hric_run.simulation import Simulation
from hric_sweep.observed import Observed
from hric_sweep.statistics.verdict_indices import AssessSobolCommand

LINK = "human::r_elbow"
"""Forearm of the person, which the arm hits."""
SPEED = "speed at contact [m/s]"
SPRING = 40e3
"""Stiffness of the lower arm in ISO/TS 15066 [N/m]."""


def simulated(**plant: Any) -> AssessmentInput:
    with Simulation("try_contact", **{f"robot.plant.{name}": value for name, value in plant.items()}) as simulation:
        observed = Observed(simulation, {"human", "contacts", "impact"})
        simulation.run(0.6)
        return observed.values().verdict_input


def peak(source: AssessmentInput, factors: dict[str, float]) -> float:
    """Return the peak force by the speed at which both met [N s/m]; the controller changes that speed with the arm."""
    findings = sensitivity_of(source).findings(CONTACT, factors)
    return max((item.values["transient peak [N]"] or 0.0) / (item.values[SPEED] or math.inf) for item in findings)


@pytest.fixture(scope="module")
def nominal() -> AssessmentInput:
    return simulated()


def changed(name: str, factor: float) -> dict[str, Any]:
    if name == ROTORS:
        return {"rotor_inertia": [factor * value for value in panda_description.rotor_inertia()]}
    return {"surfaces": [{"link": LINK, "contact": "penalty", "stiffness": factor * SPRING}]}


@pytest.mark.parametrize(("name", "factor"), [(ROTORS, 2.0), (STIFFNESS, 0.7), (STIFFNESS, 1.4)])
def test_the_predicted_peak_at_a_speed_is_simulated(nominal: AssessmentInput, name: str, factor: float) -> None:
    assert peak(nominal, {name: factor}) == pytest.approx(peak(simulated(**changed(name, factor)), {}), rel=0.02)


def test_a_heavier_body_has_a_larger_peak(nominal: AssessmentInput) -> None:
    assert peak(nominal, {MASS: 1.4}) > 1.05 * peak(nominal, {})


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(HricError, match="--rows is 8; valid: a power of two, 16 or more"):
        AssessSobolCommand().run(Namespace(rows=8))
