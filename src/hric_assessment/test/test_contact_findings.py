"""Contacts divided into episodes, and the finding about each."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bodies import body

from hric_assessment.contact.assess import FORCE_ONLY, NO_AREA, ContactSite, approach_ratio, assess
from hric_assessment.contact.episodes import Episode, split
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.speed import speed_limit
from hric_assessment.findings import DISCLAIMER, Outcome
from hric_assessment.tables import FOOT, LimitTable, episode_table, limit_table
from hric_core.errors import HricError
from hric_human.body.regions import REGION_MODELS

ISO, BGIA = Limits(limit_table("iso_ts_15066")), Limits(limit_table("bgia2011"))
HAND, FACE, SKULL, NECK = ("hand, fingers",), ("face",), ("skull, forehead",), ("neck",)
ROBOT = "panda::panda_hand"
LARGE = 1e-3
"""Area on which no pressure is the lower limit [m^2]."""
TIME = np.arange(0.0, 2.0, 1e-3)


def pulse(begin: float, duration: float, peak: float, time: np.ndarray = TIME) -> np.ndarray:
    """Return a half-sine force [N]."""
    inside = (time >= begin) & (time <= begin + duration)
    return np.where(inside, peak * np.sin(math.pi * (time - begin) / duration), 0.0)


def step(begin: float, end: float, force: float) -> np.ndarray:
    return np.where((begin - 5e-4 < TIME) & (end - 5e-4 > TIME), force, 0.0)


def one(force: np.ndarray, time: np.ndarray = TIME) -> Episode:
    """Return the single episode of a force, from the first touch to the last."""
    touching = np.flatnonzero(force > 0.0)
    part = slice(touching[0], touching[-1] + 1)
    return split(time[part], force[part], episode_table(), 1.0 / float(time[1] - time[0]))


def hit(peak: float) -> Episode:
    return one(pulse(0.2, 0.02, peak))


def where(regions: tuple[str, ...] = HAND, **given: object) -> ContactSite:
    return ContactSite(regions, ROBOT, **given)  # type: ignore[arg-type]


def test_a_half_sine_has_its_peak_duration_and_impulse() -> None:
    found = hit(100.0)
    assert found.overall.peak == pytest.approx(100.0)
    assert found.overall.duration == pytest.approx(0.02, abs=2.1e-3)
    assert found.overall.impulse == pytest.approx(100.0 * 2.0 / math.pi * 0.02, rel=0.01)
    assert found.quasi_static is None
    assert found.transient == found.overall


def test_what_lasts_longer_than_half_a_second_is_quasi_static() -> None:
    force = step(0.2, 0.3, 200.0) + step(0.3, 1.2, 90.0)
    found = one(force)
    assert (found.transient.peak, found.transient.begin, found.transient.end) == pytest.approx((200.0, 0.2, 0.7))
    assert found.quasi_static is not None
    assert (found.quasi_static.peak, found.quasi_static.begin) == (90.0, pytest.approx(0.701))
    assert found.quasi_static.end == pytest.approx(1.199)


@pytest.mark.parametrize(("last", "quasi_static"), [(0.499, False), (0.500, False), (0.501, True)])
def test_a_contact_one_sample_below_on_and_above_half_a_second(last: float, quasi_static: bool) -> None:
    force = np.where(last + 5e-4 > TIME, 10.0, 0.0)
    assert (one(force).quasi_static is not None) == quasi_static


def test_a_clamp_that_rattles_becomes_quasi_static() -> None:
    force = np.where((TIME % 0.05) < 0.02, 50.0, 0.0)
    found = one(force)
    assert found.quasi_static is not None and found.quasi_static.duration > 1.4


def test_a_rate_that_is_too_low_for_a_peak_is_said() -> None:
    assert len(hit(100.0).notes) == 1
    slow = one(pulse(0.2, 0.02, 100.0)[::5], TIME[::5])
    assert slow.notes[-1] == "less than 1000 samples per second: higher peaks may lie between the samples"
    assert "200 samples per second" in slow.notes[0] and "0.5 s (unconfirmed)" in slow.notes[0]


@pytest.mark.parametrize(
    ("peak", "outcome"), [(279.9, "within limits"), (280.0, "within limits"), (280.1, "above limits")]
)
def test_a_short_contact_one_step_below_on_and_above_the_transient_limit(peak: float, outcome: str) -> None:
    force = step(0.2, 0.25, peak)
    assert assess(one(force), where(contact_area=LARGE), ISO).outcome == outcome


@pytest.mark.parametrize(
    ("level", "outcome"), [(139.9, "within limits"), (140.0, "within limits"), (140.1, "above limits")]
)
def test_a_long_contact_one_step_below_on_and_above_the_quasi_static_limit(level: float, outcome: str) -> None:
    finding = assess(one(step(0.2, 1.5, level)), where(contact_area=LARGE), ISO)
    assert finding.outcome == outcome
    assert finding.share == pytest.approx(level / 140.0)


def test_a_finding_has_the_notes_of_its_episode_and_what_would_make_it_known() -> None:
    contact = hit(50.0)
    known, unknown = (assess(contact, where(contact_area=area), ISO) for area in (LARGE, None))
    assert known.notes[: len(contact.notes)] == contact.notes and contact.notes[0].startswith("transient: the first")
    assert (known.remedy, unknown.remedy) == ("", NO_AREA)


def test_a_force_that_is_not_a_spring_s_has_no_notes_of_an_episode_and_is_missing() -> None:
    rigid = assess(hit(50.0), where(kind="rigid"), ISO)
    assert not any(note.startswith("transient") for note in rigid.notes)
    assert rigid.missing[0] == assess(None, where(), ISO).missing[0] == "a force of penalty contact"


def test_of_a_head_alone_it_is_known_what_was_met() -> None:
    assert assess(hit(0.01), where(FACE), ISO).reason == "no contact with skull, forehead or face is within limits"


def test_what_lasts_is_named_with_its_limit_and_what_does_not_has_no_held_time() -> None:
    finding = assess(one(step(0.2, 1.5, 150.0)), where(contact_area=LARGE), ISO)
    assert finding.reason == "quasi-static force 150.0 of 140.0 N (hand, fingers)"
    assert assess(hit(50.0), where(contact_area=LARGE), ISO).values["quasi-static duration [s]"] == 0.0


def test_the_pressure_counts_where_the_area_is_small() -> None:
    finding = assess(hit(100.0), where(contact_area=0.2e-4), ISO)
    assert finding.outcome == Outcome.ABOVE
    assert finding.share == pytest.approx(100.0 / 0.2 / 380.0)
    assert (
        finding.reason == "transient mean pressure 500.0 of 380.0 N/cm^2 (hand, fingers: back of the hand, other hand)"
    )


def test_a_named_area_has_its_own_pressure() -> None:
    finding = assess(hit(100.0), where(contact_area=0.2e-4, area="palm"), ISO)
    assert finding.share == pytest.approx(100.0 / 0.2 / 520.0)
    with pytest.raises(HricError, match="no area 'thumb' in ISO/TS 15066:2016, Annex A; valid: back of the hand, fore"):
        assess(hit(100.0), where(area="thumb"), ISO)


def test_the_finding_flips_at_the_speed_of_the_closed_form() -> None:
    robot = 2.2
    limit = speed_limit(ISO, HAND[0], robot)
    for share, outcome in ((0.97, Outcome.WITHIN), (1.03, Outcome.ABOVE)):
        duration = math.pi * math.sqrt(limit.mass / REGION_MODELS[HAND[0]].stiffness)
        peak = share * float(limit.transient) * math.sqrt(limit.mass * REGION_MODELS[HAND[0]].stiffness)
        time = np.arange(0.0, 1.0, 1e-5)
        met = one(pulse(0.2, duration, peak, time), time)
        assert assess(met, where(contact_area=LARGE), ISO).outcome == outcome


@pytest.mark.parametrize("peak", [1e-3, 10.0, 279.0])
def test_without_an_area_a_contact_is_never_within_limits(peak: float) -> None:
    finding = assess(hit(peak), where(), ISO)
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason.startswith(f"{FORCE_ONLY}: the contact's area is not known")
    assert finding.share == pytest.approx(hit(peak).overall.peak / 280.0)


def test_without_an_area_a_force_above_its_limit_is_above() -> None:
    assert assess(hit(300.0), where(), ISO).outcome == Outcome.ABOVE


@pytest.mark.parametrize("limits", [ISO, BGIA], ids=["iso", "bgia"])
@pytest.mark.parametrize("regions", [SKULL, FACE, (*SKULL, *FACE, *NECK)])
def test_no_contact_with_the_head_is_within_limits(regions: tuple[str, ...], limits: Limits) -> None:
    for area in (None, LARGE):
        assert assess(hit(0.01), where(regions, contact_area=area), limits).outcome == Outcome.ABOVE
    assert assess(None, where(regions, kind="rigid"), limits).outcome == Outcome.ABOVE


def test_a_contact_with_the_head_of_a_simulated_body_is_above_limits() -> None:
    finding = assess(hit(0.01), where(tuple(region.name for region in body().regions["head"])), ISO)
    assert finding.outcome == Outcome.ABOVE
    assert finding.reason.endswith("is within limits, and which of these was touched is not known")


def test_a_neck_alone_may_be_touched() -> None:
    assert assess(hit(100.0), where(NECK, contact_area=LARGE), ISO).outcome == Outcome.WITHIN


@pytest.mark.parametrize(
    ("unknown", "area", "outcome"),
    [(140.0, LARGE, Outcome.WITHIN), (140.1, LARGE, Outcome.NOT_ASSESSABLE), (95.1, 0.5e-4, Outcome.NOT_ASSESSABLE)],
)
def test_a_held_force_that_is_unknown_is_bounded_by_the_limits_of_force_and_pressure(
    unknown: float, area: float, outcome: Outcome
) -> None:
    """A hand bears 140 N, and 190 N/cm^2 of which 0.5 cm^2 makes 95 N."""
    finding = assess(replace(hit(50.0), unknown_peak=unknown), where(contact_area=area), ISO)
    assert finding.outcome == outcome
    told = f"the force is not known for a part of the time, and may have been up to {unknown:.1f} N then; "
    assert finding.reason.startswith(told) == (outcome == Outcome.NOT_ASSESSABLE)


@pytest.mark.parametrize(("speed", "outcome"), [(1.0, Outcome.WITHIN), (1.01, Outcome.NOT_ASSESSABLE)])
def test_a_speed_that_an_unknown_mass_may_not_permit_is_not_proven(speed: float, outcome: Outcome) -> None:
    approach = approach_ratio(speed, 1.0, "an infinite mass", exact=False)
    finding = assess(hit(50.0), where(contact_area=LARGE), ISO, approach=approach)
    assert (finding.outcome, finding.share) == (outcome, pytest.approx(1.0 if speed <= 1.0 else 50.0 / 280.0))
    told = "speed of approach 1.010 of 1.000 m/s (an infinite mass), and the robot's mass there is not known"
    assert finding.reason.startswith(told) == (outcome == Outcome.NOT_ASSESSABLE)


@pytest.mark.parametrize(("speed", "outcome"), [(1.0, Outcome.WITHIN), (1.01, Outcome.ABOVE)])
def test_a_speed_above_what_a_known_mass_permits_is_above(speed: float, outcome: Outcome) -> None:
    approach = approach_ratio(speed, 1.0, "4 kg", exact=True)
    finding = assess(hit(50.0), where(contact_area=LARGE), ISO, approach=approach)
    assert (finding.outcome, finding.share) == (outcome, pytest.approx(speed))
    rigid = assess(None, where(kind="rigid"), ISO, approach=approach)
    assert (rigid.outcome, rigid.share) == (Outcome.NOT_ASSESSABLE, None)


def test_which_of_several_regions_was_met_is_not_known_and_the_lowest_limit_counts() -> None:
    regions = ("back, shoulders", "chest", "abdomen")
    finding = assess(hit(219.0), where(regions, contact_area=LARGE), ISO)
    assert finding.share == pytest.approx(219.0 / 220.0, rel=1e-3)
    assert "(abdomen)" in finding.reason


def test_a_region_that_may_have_been_met_and_is_not_in_the_table_keeps_a_contact_from_being_within() -> None:
    rows = {"forces": [{"region": "chest", "quasi_static": 140}], "force_factor": 2, "pressure_factor": 2}
    rows["pressures"] = [{"region": "chest", "quasi_static": 100}]
    own = Limits(LimitTable.of({"title": "own", "edition": "1", "sources": {}, **rows}, "own.yaml:"))
    assert assess(hit(100.0), where(("chest",), contact_area=LARGE), own).outcome == Outcome.WITHIN
    finding = assess(hit(100.0), where(("chest", "abdomen"), contact_area=LARGE), own)
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason.startswith("own has no force of abdomen and no pressure of abdomen; ")
    assert assess(hit(300.0), where(("chest", "abdomen"), contact_area=LARGE), own).outcome == Outcome.ABOVE


def test_a_named_area_says_which_of_several_regions_was_met() -> None:
    finding = assess(hit(250.0), where(("chest", "abdomen"), area="sternum", contact_area=LARGE), ISO)
    assert (finding.outcome, finding.share) == (Outcome.WITHIN, pytest.approx(250.0 / 280.0))


@pytest.mark.parametrize("area", [0.0, -1e-4, math.nan])
def test_an_area_of_contact_that_none_has_is_refused(area: float) -> None:
    with pytest.raises(HricError, match=r"contact_area is .*; valid: a finite number above 0 \[m\^2\]"):
        assess(hit(1.0), where(contact_area=area), ISO)


def test_a_finding_has_the_values_of_both_parts() -> None:
    force = step(0.2, 0.3, 200.0) + step(0.3, 1.2, 90.0)
    values = assess(one(force), where(contact_area=LARGE), ISO).values
    assert values == {
        "transient peak [N]": 200.0,
        "quasi-static peak [N]": 90.0,
        "duration [s]": pytest.approx(0.999),
        "quasi-static duration [s]": pytest.approx(0.499),
        "impulse [N s]": pytest.approx(0.1 * 200.0 + 0.9 * 90.0, abs=0.2),
        "energy by the table's spring [J]": pytest.approx(200.0**2 / (2.0 * 75e3)),
        "contact area [m^2]": LARGE,
        "transient mean pressure [Pa]": 2e5,
        "quasi-static mean pressure [Pa]": 9e4,
    }


def test_a_finding_has_its_signals_and_what_is_missing() -> None:
    finding = assess(hit(1.0), where(), ISO, ["/sim/contacts"])
    assert finding.signals == ("/sim/contacts",)
    assert finding.missing == ("the contact's area", "the area of the body")
    assert assess(None, where(kind="rigid"), ISO).missing[0] == "a force of penalty contact"


def test_a_rigid_pair_is_not_assessable_and_has_no_values() -> None:
    finding = assess(hit(900.0), where(kind="rigid", contact_area=LARGE), ISO)
    assert (finding.outcome, finding.share, dict(finding.values)) == (Outcome.NOT_ASSESSABLE, None, {})
    assert "depends on the integration step" in finding.reason


def test_a_link_without_a_region_is_not_assessable_and_a_foot_is_by_the_older_set() -> None:
    assert assess(hit(10.0), where(()), ISO).outcome == Outcome.NOT_ASSESSABLE
    assert assess(hit(10.0), where((FOOT,), contact_area=LARGE), ISO).reason.endswith("has no limit there")
    assert assess(hit(100.0), where((FOOT,), contact_area=LARGE), BGIA).outcome == Outcome.WITHIN


def test_a_force_that_is_not_known_is_not_assessable() -> None:
    assert assess(None, where(contact_area=LARGE), ISO).reason == "the force is not known"


def test_a_finding_names_its_table_window_and_marks_and_the_disclaimer_what_it_is_not() -> None:
    finding = assess(hit(100.0), where(("chest",), contact_area=LARGE), ISO)
    assert finding.table == "ISO/TS 15066:2016, Annex A (2016, as carried into ISO 10218-2:2025)"
    assert finding.window == pytest.approx((0.201, 0.219), abs=1.1e-3)
    assert "limit of the pressure, chest: sternum: confirmed twice (S1, S2)" in finding.notes
    first = str(finding)
    assert first.startswith(f"contact of {ROBOT} with chest from 0.2")
    assert " s: within limits (36 % of the limit): transient force 100.0 of 280.0 N (chest) [ISO/TS 15066" in first
    assert DISCLAIMER not in first  # it stands once, with all findings
    for words in (
        "ISO 12100",
        "proof of conformity",
        "ISO/PAS 5672",
        "certified safety function",
        "Estimate of a model",
    ):
        assert words in DISCLAIMER
