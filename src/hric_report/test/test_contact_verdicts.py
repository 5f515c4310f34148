"""Findings of the contact experiment on each engine: they change at the speed of the closed form; a head, a rigid pair
and a contact without an area are never within limits."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import AssessmentChoices, assess, opened
from hric_assessment.verdict.impacts import PERMITTED
from hric_report import headless as runner
from hric_run.definition import experiment

ENGINES = ("mujoco", "pybullet", "opensim")
PRESSURE = 2.0 * 180e4
"""Transient limit of the forearm muscle, ISO/TS 15066:2016 Annex A, area 15 [Pa]."""
SPRING, BODY_MASS = 40e3, 2.0
"""Stiffness [N/m] and mass [kg] of a forearm in the same standard."""
TOLERANCE = 0.03
"""Maximum relative deviation of the speed (requirement of this project)."""


def contact_run(root: Path, engine: str, change: Callable[[dict[str, Any]], None], duration: float = 1.8) -> Path:
    content = yaml.safe_load((experiment.config_path("experiments") / "contact.yaml").read_text())
    content["human"]["contact_area"] = None  # each test states its own
    change(content)
    path = root / "contact.yaml"
    path.write_text(yaml.safe_dump(content))
    words = [f"simulator:={engine}", f"duration:={duration:.3f}"]
    return runner.run(experiment.load(str(path), words), words, root=root, progress=False, figures=False).folder.path


def contacts(run: Path, area: float | None = None) -> list[Finding]:
    """Return the contacts in order of time."""
    found = [
        one for one in assess(opened(str(run)), AssessmentChoices(contact_area=area)).findings if one.group == "contact"
    ]
    return sorted(found, key=lambda one: one.window or (0.0, 0.0))


def at_velocity(velocity: float) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        content["parameters"]["joint_pd_controller"]["profile"]["velocity"] = velocity

    return change


MET = "speed at contact [m/s]"
MASSES = ("reflected mass of the robot m_u [kg]", "M/2 + m_L [kg]", "mass of the robot with locked joints [kg]")


def number(finding: Finding, name: str) -> float:
    value = finding.values[name]
    assert value is not None
    return value


@pytest.mark.parametrize("engine", ENGINES)
def test_a_contact_flips_between_within_and_above_at_the_speed_of_the_closed_form(engine: str, tmp_path: Path) -> None:
    """The body of the standard gives the higher force: 2 kg instead of 0.8 kg for the simulated forearm."""
    first = contacts(contact_run(tmp_path, engine, at_velocity(1.0)))[0]
    met, human = (number(first, name) for name in (MET, "reflected mass of the body as simulated [kg]"))
    heavier = max(number(first, mass) for mass in MASSES)
    assert human < BODY_MASS
    mu = 1.0 / (1.0 / heavier + 1.0 / BODY_MASS)
    area = met * math.sqrt(mu * SPRING) / PRESSURE  # so that this speed is the limit's, by the closed form
    found = {}
    for factor in (1.0 - TOLERANCE, 1.0 + TOLERANCE):
        finding = contacts(contact_run(tmp_path, engine, at_velocity(factor)), area)[0]
        assert number(finding, MET) / met == pytest.approx(factor, abs=0.01)
        found[factor] = finding.outcome
    assert found == {1.0 - TOLERANCE: Outcome.WARNING, 1.0 + TOLERANCE: Outcome.ABOVE}


@pytest.mark.parametrize("engine", ENGINES)
def test_the_simulated_body_bears_no_more_than_its_own_closed_form(engine: str, tmp_path: Path) -> None:
    finding = contacts(contact_run(tmp_path, engine, at_velocity(1.0)), 1e-2)[0]
    closed_form = number(finding, "v sqrt(mu k) as simulated [N]")
    assert number(finding, "transient peak [N]") == pytest.approx(closed_form, rel=TOLERANCE)


def test_a_contact_met_faster_than_a_permitted_speed_that_it_prints_is_not_within(tmp_path: Path) -> None:
    first = contacts(contact_run(tmp_path, "mujoco", at_velocity(1.0)), 4e-5)[0]
    permitted = [number(first, f"permitted speed by {mass} [m/s]") for mass in ("m_u", "M/2 + m_L", "locked joints")]
    area = 4e-5 * number(first, MET) / (0.5 * (min(permitted) + max(permitted)))  # between the two
    finding = contacts(contact_run(tmp_path, "mujoco", at_velocity(1.0)), area)[0]
    assert number(finding, "transient mean pressure [Pa]") < PRESSURE
    assert finding.outcome == Outcome.ABOVE and finding.reason.startswith("speed of approach")


def test_the_speeds_beside_a_contact_follow_from_the_masses(tmp_path: Path) -> None:
    finding = contacts(contact_run(tmp_path, "mujoco", at_velocity(1.0)), 4e-5)[0]
    for mass, speed in zip(MASSES, PERMITTED, strict=True):
        mu = 1.0 / (1.0 / BODY_MASS + 1.0 / number(finding, mass))
        assert number(finding, speed) == pytest.approx(PRESSURE * 4e-5 / math.sqrt(mu * SPRING), rel=1e-9)
    largest = max(number(finding, mass) for mass in MASSES)
    assert any(f"judged by largest of three masses, {largest:.2f} kg" in note for note in finding.notes)


@pytest.mark.parametrize("engine", ENGINES)
def test_contact_of_a_head_is_above_limits_however_soft(engine: str, tmp_path: Path) -> None:
    def change(content: dict[str, Any]) -> None:
        at_velocity(0.5)(content)
        content["human"] = {"parts": "upper_body", "position": [0.17, 0.26], "heading": -2.0, "floor": -1.05}
        content["human"]["rate"] = 1000.0

    found = contacts(contact_run(tmp_path, engine, change), 1e-2)
    heads = [one for one in found if "face" in one.regions]
    assert heads and all(one.outcome == Outcome.ABOVE for one in heads)
    assert "no contact with skull, forehead or face is within limits" in heads[0].reason


def test_a_rigid_pair_is_not_assessable_and_has_no_values(tmp_path: Path) -> None:
    def change(content: dict[str, Any]) -> None:
        content["robot"]["plant"] = {"surfaces": [{"link": "human::r_elbow", "contact": "rigid"}]}

    (found,) = contacts(contact_run(tmp_path, "mujoco", change), 1e-4)
    assert found.outcome == Outcome.NOT_ASSESSABLE and not found.values
    assert "the force of a rigid contact depends on the integration step" in found.reason
    assert "a force of penalty contact" in found.missing


def test_without_an_area_nothing_is_within_limits(tmp_path: Path) -> None:
    run = contact_run(tmp_path, "mujoco", at_velocity(1.0))
    assert {one.outcome for one in contacts(run)} == {Outcome.NOT_ASSESSABLE}
    assert contacts(run, 1e-4)[0].outcome == Outcome.WITHIN


def test_a_contact_that_goes_on_when_the_run_ends_is_not_within_limits(tmp_path: Path) -> None:
    (whole,) = contacts(contact_run(tmp_path, "mujoco", at_velocity(0.5)), 1e-4)
    assert whole.window is not None
    (finding,) = contacts(contact_run(tmp_path, "mujoco", at_velocity(0.5), sum(whole.window) / 2.0), 1e-4)
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason.startswith("the contact had not ended when the recording ended")
