"""Certainty of the answers of a verdict: unconfirmed numbers at the ends of their ranges, intervals, error bars."""

from pathlib import Path

import numpy as np
import pytest
from verdict_cases import Bag, half_sine

from hric_assessment.findings import CONTACT, SEPARATION, Finding, Outcome
from hric_assessment.separation.stopping import MEASUREMENT, StopRow, StopTable
from hric_assessment.tables import uncertain_table
from hric_assessment.verdict import AssessmentChoices, Verdict, assess, opened
from hric_assessment.verdict.certainty import Certainty, Influence
from hric_assessment.verdict.choices import BrakingChoice
from hric_assessment.verdict.conclusions import Reply
from hric_assessment.verdict.refined import error_bar, refinement, relative_bar, with_bars

SMALL = 0.5e-4
"""Area over which the pressure decides, 400 N/cm^2 for a short contact of the hand [m^2]."""
LIMIT = 200.0
"""Transient force at that limit [N]."""
STOPS = StopTable("a", MEASUREMENT, "b", None, 0.02, (StopRow(2.0, 3.0, 0.5, 0.4),))
PEAK, DISTANCE = "transient peak [N]", "smallest distance [m]"


def verdict(path: Path, peak: float, area: float | None = SMALL) -> Verdict:
    bag = Bag()
    bag.person(0.0, 2.0)
    bag.silence(0.0, 2.0)
    bag.contact(half_sine(peak), 1.0, 1.02)
    return assess(opened(str(bag.save(path / "a.bag"))), AssessmentChoices(contact_area=area), muscles=False)


def contact(found: Verdict) -> Certainty:
    return next(item for item in found.certainty if item.question == "contact")


def influence(lower: float, upper: float) -> Influence:
    return Influence("a number", "x 2", "chosen here", upper, lower, upper, {})


def finding(group: str, begin: float, **values: float) -> Finding:
    name = PEAK if group == CONTACT else DISTANCE
    return Finding(
        "a contact", Outcome.WITHIN, "", "", None, {name: values["value"]}, (begin, begin + 0.1), group=group
    )


def test_the_interval_sums_squares_to_either_side() -> None:
    made = Certainty.of("contact", ("share", 50.0, 100.0, "%"), [influence(-3.0, 6.0), influence(-4.0, 8.0)])
    assert (made.low, made.high) == pytest.approx((45.0, 60.0))


def test_influences_come_in_order_of_size() -> None:
    made = Certainty.of("contact", ("share", 50.0, 100.0, "%"), [influence(0.0, 1.0), influence(0.0, 8.0)])
    assert [item.upper for item in made.moved_by] == [8.0, 1.0]


def test_the_influence_of_the_area_is_exact(tmp_path: Path) -> None:
    found = contact(verdict(tmp_path, 100.0))
    low = uncertain_table().numbers["contact_area"].low
    largest = found.moved_by[0]
    assert (found.value, found.value + largest.upper) == pytest.approx((50.0, 50.0 / low))


def test_a_yes_that_may_be_no_is_a_warning(tmp_path: Path) -> None:
    found = verdict(tmp_path, 0.75 * LIMIT)
    judged = next(item for item in found.findings if item.group == CONTACT)
    assert (judged.outcome, found.conclusions[0].reply) == (Outcome.WITHIN, Reply.WARNING)


def test_a_yes_far_from_its_limit_stays(tmp_path: Path) -> None:
    assert verdict(tmp_path, 0.5 * LIMIT).conclusions[0].reply == Reply.YES


def test_a_no_stays_a_no(tmp_path: Path) -> None:
    assert verdict(tmp_path, 1.05 * LIMIT).conclusions[0].reply == Reply.NO


def test_masses_do_not_move_a_measured_force(tmp_path: Path) -> None:
    moved = {item.number: item.change for item in contact(verdict(tmp_path, 100.0)).moved_by}
    assert moved["mass of the body part"] == moved["rotor inertias"] == 0.0


def test_an_energy_that_decides_has_the_interval(tmp_path: Path) -> None:
    found = contact(verdict(tmp_path, 275.0, None))
    low = uncertain_table().numbers["unconfirmed_limits"].low
    assert found.value == pytest.approx(100.0 * 275.0**2 / 150e3 / 0.49, rel=0.01)
    upper = {item.number: item.upper for item in found.moved_by}
    assert upper["limits that are marked unconfirmed"] == pytest.approx(found.value * (1.0 / low - 1.0))


def test_without_an_area_it_moves_nothing(tmp_path: Path) -> None:
    assert all(item.number != "stated contact area" for item in contact(verdict(tmp_path, 100.0, None)).moved_by)


def test_the_text_shows_interval_and_largest_influence(tmp_path: Path) -> None:
    text = verdict(tmp_path, 100.0).render()
    assert "moved by stated contact area x 0.7 (chosen here): +21 %" in text


@pytest.mark.parametrize("stops", [None, STOPS])
def test_braking_varies_by_its_factors(stops: StopTable | None) -> None:
    speed = np.array([0.5])
    before, after = (BrakingChoice(stops, 1.0, factor).stop(speed, 0.0) for factor in (1.0, 1.4))
    assert after.braked(speed) == pytest.approx(1.4 * np.asarray(before.braked(speed)))


def test_the_error_bar_is_richardsons_times_three() -> None:
    assert error_bar(10.0, 10.5) == pytest.approx(3.0 * 0.5 * 2.0)


def test_a_contact_is_paired_with_the_simultaneous_one() -> None:
    run = [finding(CONTACT, 1.0, value=50.0), finding(SEPARATION, 0.0, value=0.2)]
    twin = [finding(CONTACT, 3.0, value=7.0), finding(CONTACT, 1.02, value=51.0), finding(SEPARATION, 0.0, value=0.2)]
    assert [row["refined"] for row in refinement(run, twin)] == [51.0, 0.2]


def test_a_contact_without_partner_has_no_bar() -> None:
    assert [row["bar"] for row in refinement([finding(CONTACT, 1.0, value=50.0)], [])] == [None]


def test_a_finding_shows_its_error_bar() -> None:
    run, twin = [finding(CONTACT, 1.0, value=50.0)], [finding(CONTACT, 1.0, value=51.0)]
    (found,) = with_bars(run, {"refined": {"time_step": 5e-4, "values": refinement(run, twin)}})
    assert relative_bar(found) == pytest.approx(6.0 / 50.0) and "50 +- 6 N" in found.notes[0]
