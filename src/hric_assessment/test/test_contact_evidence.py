"""Within limits is a statement that the recording carries: contacts that are there and held against their limits, and
recordings that do not say enough of them."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from verdict_cases import AREA, HAND, RIGHT, WHOLE, Bag, Force, half_sine, held

from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import AssessmentChoices, Verdict, assess, opened
from hric_assessment.verdict.contacts import contact_findings
from hric_core.errors import HricError

Make = Callable[[Bag], None]
STATES = ("position", "velocity", "effort")


def verdict(folder: Path, make: Make, area: float | None = AREA, numbered: bool = False) -> Verdict:
    bag = Bag()
    make(bag)
    return assess(opened(str(bag.save(folder / "case.bag", numbered))), AssessmentChoices(contact_area=area))


def contacts(folder: Path, make: Make, area: float | None = AREA, numbered: bool = False) -> list[Finding]:
    found = [one for one in verdict(folder, make, area, numbered).findings if one.group == "contact"]
    return sorted(found, key=lambda one: one.window or (0.0, 0.0))


def only(folder: Path, make: Make, area: float | None = AREA) -> Finding:
    (finding,) = contacts(folder, make, area)
    return finding


def standing(bag: Bag, seconds: float = 3.0) -> None:
    bag.person(0.0, seconds)


# -- what is recorded counts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("level", "outcome", "quantity"), [(140.0, Outcome.WARNING, "quasi-static"), (140.1, Outcome.ABOVE, "quasi-static")]
)
def test_a_clamp_at_its_limit_is_within_and_just_above_it_above(
    tmp_path: Path, level: float, outcome: Outcome, quantity: str
) -> None:
    finding = only(tmp_path, lambda bag: (standing(bag), bag.contact(held(level), 0.5, 2.5))[1])
    assert finding.outcome == outcome and finding.reason.startswith(quantity)


@pytest.mark.parametrize(
    ("end", "outcome"), [(1.5, Outcome.WITHIN), (1.51, Outcome.ABOVE)], ids=["half a second", "longer"]
)
def test_200_newton_are_transient_for_half_a_second(tmp_path: Path, end: float, outcome: Outcome) -> None:
    assert only(tmp_path, lambda bag: (standing(bag), bag.contact(held(200.0), 1.0, end))[1]).outcome == outcome


def test_taps_farther_apart_than_the_gap_are_judged_one_by_one(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        for k in range(10):
            bag.contact(half_sine(200.0), 0.5 + 0.17 * k, 0.52 + 0.17 * k)

    assert [one.outcome for one in contacts(tmp_path, make)] == [Outcome.WITHIN] * 10


@pytest.mark.parametrize("person", [True, False], ids=["with joint states", "contacts alone"])
def test_a_blow_is_above_without_joint_torques_and_without_joint_states(tmp_path: Path, person: bool) -> None:
    def make(bag: Bag) -> None:
        if person:
            bag.person(0.0, 3.0, WHOLE, torque=False)
        bag.contact(half_sine(350.0), 1.0, 1.02)

    assert only(tmp_path, make).outcome == Outcome.ABOVE


def test_a_contact_that_began_before_the_recording_is_as_long_as_it_says(tmp_path: Path) -> None:
    finding = only(
        tmp_path, lambda bag: (standing(bag), bag.contact(held(168.0), 1.0, 3.0, recorded=lambda time: time > 2.7))[1]
    )
    assert (finding.outcome, finding.window) == (Outcome.ABOVE, pytest.approx((1.0, 3.0)))


def test_a_clamp_that_still_presses_at_the_end_is_above(tmp_path: Path) -> None:
    assert only(tmp_path, lambda bag: bag.contact(held(168.0), 1.0, 3.0, ends=False)).outcome == Outcome.ABOVE


@pytest.mark.parametrize("rate", [8.0, 1000.0], ids=["throttled", "lost"])
def test_a_clamp_whose_messages_are_throttled_or_lost_is_one_clamp(tmp_path: Path, rate: float) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 5.0)
        bag.contact(held(168.0), 1.0, 4.0, rate=rate, recorded=lambda time: rate < 10.0 or (time % 0.6) < 0.45)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.ABOVE and finding.reason.startswith("quasi-static force 168.0")


def test_a_peak_whose_messages_are_lost_is_that_of_the_later_ones(tmp_path: Path) -> None:
    finding = only(
        tmp_path,
        lambda bag: bag.contact(half_sine(350.0, 0.05), 1.0, 1.05, recorded=lambda time: not 1.015 < time < 1.035),
    )
    assert (finding.outcome, finding.values["transient peak [N]"]) == (Outcome.ABOVE, pytest.approx(350.0))


def test_a_peak_between_two_messages_of_which_the_later_states_it_counts(tmp_path: Path) -> None:
    """Messages of 1.00, 1.01 and 1.02 s; the force peaks between the first two, as their peak says."""
    finding = only(
        tmp_path,
        lambda bag: bag.contact(
            half_sine(350.0, 0.01), 1.0, 1.02, recorded=lambda time: abs(time * 100.0 - round(time * 100.0)) < 1e-6
        ),
    )
    assert (finding.outcome, finding.values["transient peak [N]"]) == (Outcome.ABOVE, pytest.approx(350.0))


def test_two_links_that_press_one_hand_at_once_are_added(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        for link in ("panda_hand", "panda_leftfinger"):
            bag.contact(held(100.0), 0.5, 2.5, other=f"panda::{link}")

    finding = only(tmp_path, make)
    assert (finding.outcome, finding.share) == (Outcome.ABOVE, pytest.approx(200.0 / 140.0))
    assert "panda_hand and panda::panda_leftfinger" in finding.subject


def test_a_wall_behind_a_clamped_hand_is_no_further_load(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        for other in ("panda::panda_hand", "wall::link"):
            bag.contact(held(100.0), 0.5, 2.5, other=other)

    assert only(tmp_path, make).share == pytest.approx(100.0 / 140.0)


@pytest.mark.parametrize(("end", "share"), [(2.5, 200.0 / 140.0), (0.9, 100.0 / 140.0)], ids=["both", "one"])
def test_links_with_a_message_each_are_added_while_both_last(tmp_path: Path, end: float, share: float) -> None:
    """Two messages at one instant, each with one link; the second one lasts 0.4 s or as long as the first."""

    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(100.0), 0.5, 2.5)
        bag.contact(held(100.0), 0.5, end, other="panda::panda_leftfinger")

    finding = only(tmp_path, make)
    assert finding.share == pytest.approx(share)
    assert finding.outcome == (Outcome.ABOVE if share > 1.0 else Outcome.WITHIN)


def test_short_touches_of_a_second_link_are_added_to_the_first_which_lasts(tmp_path: Path) -> None:
    """The finger touches for 0.2 ms at a time, between two messages of the hand."""

    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(100.0), 0.5, 2.5)
        for begin in np.arange(1.1, 2.4, 0.2):
            bag.contact(held(100.0), begin + 2e-4, begin + 4e-4, rate=1e4, other="panda::panda_leftfinger")

    finding = only(tmp_path, make)
    assert finding.share == pytest.approx(200.0 / 140.0)


def test_two_points_of_one_link_in_a_message_are_added(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(100.0), 0.5, 2.5)
        for _, topic, _, message in bag.rows:
            if topic.endswith("contacts"):
                message.touching, message.ended = message.touching * 2, message.ended * 2

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.ABOVE and finding.values["quasi-static peak [N]"] == pytest.approx(200.0)


def test_a_begin_that_is_stated_with_rounding_errors_is_one_contact(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(100.0), 0.5, 2.5)
        for k, (_, topic, _, message) in enumerate(bag.rows):
            if topic.endswith("contacts"):
                (contact,) = (*message.touching, *message.ended)
                contact.begin += 2e-6 * math.sin(k)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.WITHIN and finding.values["quasi-static peak [N]"] == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("regions", "link", "outcome"),
    [
        ([HAND, "lower arm, wrist"], "r_elbow", Outcome.NOT_ASSESSABLE),
        ([HAND], "hand", Outcome.NOT_ASSESSABLE),
        (["chest"], "torso", Outcome.WITHIN),
        ([HAND, "lower arm, wrist"], "l_elbow", Outcome.WITHIN),
    ],
    ids=["one of two regions", "side not stated", "another region", "the other side"],
)
def test_a_second_contact_that_may_be_on_the_same_region_makes_the_sum_unknown(
    tmp_path: Path, regions: list[str], link: str, outcome: Outcome
) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(100.0), 0.5, 2.5)
        bag.contact(held(100.0), 1.0, 2.0, regions=regions, link=link, other="panda::panda_leftfinger")

    hand = next(one for one in contacts(tmp_path, make) if "panda::panda_hand" in one.subject)
    assert hand.outcome == outcome
    assert ("panda_leftfinger" in hand.reason) == (outcome == Outcome.NOT_ASSESSABLE)


@pytest.mark.parametrize(
    ("stated", "outcome"), [(None, Outcome.NOT_ASSESSABLE), (AREA, Outcome.WITHIN)], ids=["nothing", "by the user"]
)
def test_the_area_of_one_contact_is_not_that_of_another(tmp_path: Path, stated: float | None, outcome: Outcome) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(5.0), 0.5, 1.0, area=1e-3)
        bag.contact(held(100.0), 1.02, 2.0)

    assert only(tmp_path, make, stated).outcome == outcome


def test_two_hands_that_are_pressed_at_once_are_not_added(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        for link in ("r_wrist", "l_wrist"):
            bag.contact(held(100.0), 0.5, 2.5, link=link, dominant=link == "r_wrist")

    assert [one.share for one in contacts(tmp_path, make)] == [pytest.approx(100.0 / 140.0)] * 2


def test_of_a_recorded_and_a_stated_area_the_smaller_counts_and_both_are_named(tmp_path: Path) -> None:
    recorded = only(tmp_path, lambda bag: bag.contact(half_sine(200.0), 1.0, 1.02, area=AREA), area=None)
    assert (recorded.outcome, recorded.values["contact area [m^2]"]) == (Outcome.WITHIN, AREA)
    both = only(tmp_path, lambda bag: bag.contact(half_sine(200.0), 1.0, 1.02, area=2e-5), area=AREA)
    assert (both.outcome, both.values["contact area [m^2]"]) == (Outcome.ABOVE, 2e-5)
    assert "contact area: 2e-05 m^2 recorded, 0.0004 m^2 stated; the smaller counts" in both.notes


def test_a_recorded_area_that_no_hand_has_is_not_used(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(200.0), 1.0, 1.02, area=0.2), area=None)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and finding.values["contact area [m^2]"] is None
    assert finding.reason.startswith("the recorded contact area is 0.2 m^2, which is 2000 cm^2, larger than")


@pytest.mark.parametrize(("dominant", "limit"), [(True, 200.0), (False, 190.0)])
def test_the_dominant_hand_bears_more_where_body_and_message_agree_that_it_is(
    tmp_path: Path, dominant: bool, limit: float
) -> None:
    """The right hand is the dominant one of the assumed body; lowest of its areas: the back of the hand."""
    finding = only(
        tmp_path, lambda bag: (standing(bag), bag.contact(half_sine(100.0), 1.0, 1.02, dominant=dominant))[1], area=2e-5
    )
    assert finding.share == pytest.approx(100.0 / 0.2 / (2.0 * limit))


@pytest.mark.parametrize("kind", ["penalty", "rigid"])
def test_the_head_is_never_within(tmp_path: Path, kind: str) -> None:
    about = {"regions": ["face"], "link": "head", "kind": kind}
    assert only(tmp_path, lambda bag: bag.contact(half_sine(0.1), 1.0, 1.02, **about)).outcome == Outcome.ABOVE


def test_of_two_regions_the_lower_limit_counts(tmp_path: Path) -> None:
    about = {"regions": ["neck", "chest"], "link": "x"}
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(290.0), 1.0, 1.02, **about))
    assert (finding.outcome, finding.share) == (Outcome.ABOVE, pytest.approx(290.0 / 280.0))


# -- what is not known is never within --------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [math.nan, -50.0, math.inf], ids=["NaN", "negative", "infinite"])
def test_a_force_that_is_no_force_is_not_assessable(tmp_path: Path, value: float) -> None:
    def force(time: float) -> float:
        return value if abs(time - 0.01) < 5e-4 else half_sine(100.0)(time)

    finding = only(tmp_path, lambda bag: bag.contact(force, 1.0, 1.02))
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "are NaN, infinite or negative" in finding.reason


def test_a_contact_without_any_force_has_no_share_of_a_limit(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(lambda time: math.nan, 1.0, 2.0, peak=math.nan))
    assert (finding.outcome, finding.share) == (Outcome.NOT_ASSESSABLE, None)


def test_a_flat_top_is_that_of_a_sensor_at_its_range(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(lambda time: min(250.0, half_sine(500.0)(time)), 1.0, 1.02))
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "flat top at 250.0 N" in finding.reason


def test_a_flat_top_that_is_above_stays_above(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(lambda time: min(290.0, half_sine(500.0)(time)), 1.0, 1.02))
    assert finding.outcome == Outcome.ABOVE


def test_a_blow_that_its_source_measured_a_hundred_times_a_second_is_not_assessable(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(200.0, 0.05), 1.0, 1.05, rate=100.0))
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason.startswith("an impact needs 1000 samples per second, and the messages do not prove")


def test_a_source_that_states_instants_a_millisecond_apart_may_publish_less_often(tmp_path: Path) -> None:
    sent = (1005, 1010, 1015, 1020, 1022)  # [ms]
    finding = only(
        tmp_path,
        lambda bag: bag.contact(half_sine(200.0, 0.021), 1.001, 1.022, recorded=lambda time: round(time * 1e3) in sent),
    )
    assert finding.outcome == Outcome.WITHIN


@pytest.mark.parametrize("blow", [100.0, 250.0])
def test_a_held_force_that_is_not_recorded_is_bounded_by_the_stated_peak(tmp_path: Path, blow: float) -> None:
    def force(time: float) -> float:
        return max(100.0, half_sine(blow)(time))

    def recorded(time: float) -> bool:
        return not 2.0 < time < 2.8

    finding = only(
        tmp_path, lambda bag: (bag.person(0.0, 5.0), bag.contact(force, 1.0, 4.0, recorded=recorded))[1], area=1e-3
    )
    assert (finding.outcome == Outcome.NOT_ASSESSABLE) == (blow > 140.0)
    assert ("may have been up to 250.0 N then" in finding.reason) == (blow > 140.0)


STAIRS = [0.004, 0.014, 0.024]
"""Times since the begin at which a slow sensor measures [s]."""


@pytest.mark.parametrize(
    ("force", "about", "words"),
    [
        (held(0.0), {}, "no force is measured"),
        (lambda t: half_sine(300.0)(STAIRS[int(100.0 * t)]), {}, "needs 1000 samples per second"),
        (half_sine(100.0), {"energy": -1.0}, "energy is NaN or negative"),
        (half_sine(100.0), {"impulse": 3.0}, "impulse of 3 N s needs a larger force than the recorded one"),
    ],
    ids=["a sensor that measures nothing", "a sensor of 100 Hz", "a negative energy", "an impulse of a harder blow"],
)
def test_a_force_that_contradicts_itself_is_not_assessable(
    tmp_path: Path, force: Force, about: dict[str, Any], words: str
) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(force, 1.0, 1.02, **about)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and words in finding.reason


def test_a_coarse_sensor_whose_force_changes_slowly_repeats_its_values(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(lambda t: math.floor(half_sine(100.0, 1.0)(t)), 1.0, 2.0)

    assert only(tmp_path, make).outcome == Outcome.WITHIN


def test_contacts_of_a_real_person_are_assessed_where_they_are_recorded(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 3.0, torque=False, name="/hric/person")
        bag.silence(0.0, 1.0)
        bag.contact(half_sine(200.0), 1.0, 1.02)
        bag.silence(1.05, 3.0)
        bag.rows = [(at, topic.replace("human/contacts", "person/contacts"), *rest) for at, topic, *rest in bag.rows]

    assert only(tmp_path, make).outcome == Outcome.WITHIN


@pytest.mark.parametrize(
    ("force", "outcome", "reason"),
    [
        (139.0, Outcome.WITHIN, "nothing but the grips"),
        (141.0, Outcome.NOT_ASSESSABLE, "quasi-static force 141.0 of 140.0 N"),
        (math.nan, Outcome.NOT_ASSESSABLE, "the force of the grip is not known"),
    ],
)
def test_a_grip_is_harmless_only_below_the_limit_of_a_held_contact(
    tmp_path: Path, force: float, outcome: Outcome, reason: str
) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.silence(0.0, 3.0)
        for k in range(200):
            bag.grip(0.5 + 0.01 * k, force)

    finding = only(tmp_path, make)
    assert finding.outcome == outcome and reason in finding.reason


def test_the_remedy_for_a_bag_is_a_command_for_a_file(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: (standing(bag), bag.contact(half_sine(100.0), 1.0, 1.02))[1], area=None)
    assert "hric assess FILE --contact-area M2" in finding.remedy  # hric assess case finds no run of this name


def test_a_grip_is_harmless_only_while_its_force_is_recorded(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.silence(0.0, 3.0)
        for k in [*range(50), *range(150, 200)]:
            bag.grip(0.5 + 0.01 * k, 20.0)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "longest gap 1.01 s" in finding.reason


def test_a_grip_of_the_experiment_that_is_not_recorded_is_not_harmless(tmp_path: Path) -> None:
    bag = Bag()
    standing(bag)
    bag.silence(0.0, 3.0)
    source = opened(str(bag.save(tmp_path / "case.bag")))
    grips = {"guide": {"held": "panda::panda_hand", "holder": "hand"}}
    run = {"definition": {"human": {"parts": "right_arm", "grips": grips}}}
    (finding,) = contact_findings(replace(source, run=run), AssessmentChoices())
    assert finding.outcome == Outcome.NOT_ASSESSABLE and finding.reason == "the grip is not recorded"


def test_a_grip_that_is_too_firm_for_three_milliseconds_is_not_harmless(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.silence(0.0, 3.0)
        for k in range(1000):
            bag.grip(0.5 + 0.001 * k, 300.0 if 503 <= k < 506 else 20.0)

    finding, *_ = contacts(tmp_path, make)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "quasi-static force 300.0 of 140.0 N" in finding.reason
    figures = {figure.name: figure.value for figure in verdict(tmp_path, make).figures}
    assert figures["largest force, grip right of box::handle"] == 300.0


def test_the_largest_share_of_strength_is_that_of_every_message(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 3.0, rate=1000.0)
        (strained,) = (row[3] for row in bag.rows if row[1].endswith("joint_torque") and abs(row[0] - 1.503) < 1e-6)
        strained.strength_share = np.linspace(-0.9, 0.0, len(strained.name))

    figures = {figure.name: figure.value for figure in verdict(tmp_path, make).figures}
    assert figures["largest torque of right shoulder flexion over its strength"] == pytest.approx(0.9)


def test_an_unknown_region_costs_its_own_contact_only(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(half_sine(100.0), 1.0, 1.02, regions=["elbow pit"], link="x")
        bag.contact(half_sine(350.0), 2.0, 2.02)

    unknown, above = contacts(tmp_path, make)
    assert unknown.outcome == Outcome.NOT_ASSESSABLE and "no region 'elbow pit'" in unknown.reason
    assert above.outcome == Outcome.ABOVE


@pytest.mark.parametrize("about", [{"regions": [], "link": "r_ankle"}, {"kind": ""}], ids=["foot", "kind"])
def test_a_link_without_a_region_and_an_unknown_kind_are_not_assessable(
    tmp_path: Path, about: dict[str, object]
) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(400.0), 1.0, 1.02, **about))
    assert finding.outcome == Outcome.NOT_ASSESSABLE


def test_an_end_that_is_not_recorded_is_told(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.silence(0.0, 3.0)
        bag.contact(half_sine(100.0), 1.0, 1.02, recorded=lambda time: time < 1.01)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "end is not recorded" in finding.reason


def test_messages_of_another_time_than_they_state_are_not_assessable(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(100.0), 1.0, 1.02, begin=0.5))
    assert "the messages' stamps do not agree with the begin and duration that they state" in finding.reason


@pytest.mark.parametrize(("speed", "outcome"), [(0.5, Outcome.WITHIN), (1.4, Outcome.NOT_ASSESSABLE)])
def test_the_standard_s_body_is_bounded_where_the_robot_s_mass_is_not_known(
    tmp_path: Path, speed: float, outcome: Outcome
) -> None:
    """A hand of 0.6 kg on 75 N/mm, and an infinitely heavy robot: 280 / sqrt(0.6 * 75e3) = 1.32 m/s."""
    finding = only(tmp_path, lambda bag: bag.contact(half_sine(100.0), 1.0, 1.02, begin_speed=speed), area=1e-3)
    assert finding.outcome == outcome
    assert ("1.400 of 1.320 m/s" in finding.reason) == (outcome == Outcome.NOT_ASSESSABLE)


# -- what is not recorded is not harmless -----------------------------------------------------------------------------


def test_contacts_that_are_not_recorded_are_told_with_the_topic(tmp_path: Path) -> None:
    finding = only(tmp_path, standing)
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason == "contacts are not recorded: the topic /hric/human/contacts is not in the recording"
    assert finding.evidence is not None and finding.evidence.known == 0.0
    assert finding.remedy.startswith("record /hric/human/contacts")


def test_nothing_touched_the_person_where_all_messages_say_so(tmp_path: Path) -> None:
    finding = only(tmp_path, lambda bag: (standing(bag), bag.silence(0.0, 3.0))[1])
    assert (finding.outcome, finding.reason) == (Outcome.WITHIN, "nothing touched the person")


@pytest.mark.parametrize(
    ("plant", "shape", "reason"),
    [
        ({}, True, "nothing touched the person"),
        ({"collision": False}, True, "the robot touches nothing in this simulation"),
        ({}, False, "contacts of tool, without collision shape, are not simulated"),
    ],
)
def test_silence_of_an_arm_that_cannot_touch_is_not_within(
    plant: dict[str, object], shape: bool, reason: str, tmp_path: Path
) -> None:
    bag = Bag()
    standing(bag)
    bag.silence(0.0, 3.0)
    bag.control_log(0.0, 3.0)
    source = opened(str(bag.save(tmp_path / "case.bag")))
    assert source.recording.log is not None
    joint = source.recording.log.joint_names[0]
    ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>" if shape else ""
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    description = (
        f"<robot name='r'><link name='base'/><link name='tool'>{inertial}{ball}</link><joint name='{joint}' "
        "type='continuous'><parent link='base'/><child link='tool'/></joint></robot>"
    )
    run = {"definition": {"human": {"rate": 1000.0}}, "parameters": {"robot": {"plant": plant}}}
    (finding,) = contact_findings(replace(source, run=run, description=description), AssessmentChoices())
    assert finding.reason.startswith(reason)
    assert (finding.outcome == Outcome.WITHIN) == (shape and not plant)


def test_a_topic_that_says_nothing_for_seconds_is_not_silence(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.silence(0.0, 1.0)
        bag.silence(2.5, 3.0)

    finding = only(tmp_path, make)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "longest gap 1.55 s" in finding.reason


def test_missing_numbers_of_messages_are_missing_contacts(tmp_path: Path) -> None:
    """A contact between two messages of silence that are 50 ms apart is lost without any gap in time."""

    bag = Bag()
    standing(bag)
    bag.silence(0.0, 3.0)
    bag.contact(half_sine(350.0), 1.51, 1.53)
    whole = bag.save(tmp_path / "whole.bag", numbered=True)
    assert Outcome.ABOVE in [one.outcome for one in assess(opened(str(whole))).findings if one.group == "contact"]
    bag.lost = lambda at, topic: 1.505 < at < 1.535 and topic.endswith("contacts")
    lost = bag.save(tmp_path / "lost.bag", numbered=True)
    (finding,) = [one for one in assess(opened(str(lost))).findings if one.group == "contact"]
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.reason.startswith("messages are missing in 1 places, the first at 1.500 s")


def test_a_second_in_which_nothing_at_all_was_recorded_is_told_beside_a_contact(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 1.0)
        bag.person(2.0, 3.0)
        bag.contact(half_sine(100.0), 0.5, 0.52)

    lost, contact = contacts(tmp_path, make)
    assert (lost.outcome, contact.outcome) == (Outcome.NOT_ASSESSABLE, Outcome.WITHIN)
    assert "longest gap 1.02 s" in lost.reason


# -- persons ----------------------------------------------------------------------------------------------------------


def test_two_persons_have_findings_of_their_own(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 5.0, WHOLE)
        bag.person(0.004, 5.0, WHOLE, {"right_sh_flex": 170.0, "trunk_flex": 70.0}, name="/hric/human2")

    found = {one.person: one for one in verdict(tmp_path, make).findings if one.subject == "RULA of the right arm"}
    assert found["/hric/human"].values["score that counts"] == 1.0
    assert found["/hric/human2"].values["score that counts"] >= 5.0  # type: ignore[operator]


@pytest.mark.parametrize("names", [WHOLE, WHOLE[:-1]], ids=["poses", "joints"])
def test_two_persons_in_one_namespace_are_refused_by_name(tmp_path: Path, names: list[str]) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 2.0, WHOLE)
        bag.person(0.004, 2.0, names, {"right_sh_flex": 170.0, "trunk_flex": 70.0})

    with pytest.raises(HricError, match=r"/hric/human/joint_states: .* two persons in one namespace cannot be told"):
        verdict(tmp_path, make)


def arm(bag: Bag, begin: float, end: float, q: float = 0.0, names: int = 7, prefix: str = "panda_joint") -> None:
    """Joint states of an arm that stands."""
    for at in np.arange(begin, end, 0.02):
        values = {"name": [f"{prefix}{k + 1}" for k in range(names)], "position": np.full(names, q)}
        values |= {"velocity": np.zeros(names), "effort": np.zeros(names)}
        bag.put(at, "/joint_states", "sensor_msgs/msg/JointState", **values)


def late_poses(bag: Bag) -> None:
    bag.person(5.0, 5.5, WHOLE)
    bag.person(5.013, 5.5, WHOLE, {"right_sh_flex": 170.0, "trunk_flex": 70.0})
    bag.person(5.5, 8.0, WHOLE)


def late_joints(bag: Bag) -> None:
    bag.person(5.0, 8.0, WHOLE)
    bag.person(7.0, 7.5, RIGHT)


def late_stamps(bag: Bag) -> None:
    bag.person(5.0, 8.0, WHOLE)
    bag.person(7.004, 7.9, WHOLE)


def late_node(bag: Bag) -> None:
    bag.node = "/first"
    bag.person(5.0, 8.0, WHOLE)
    bag.node = "/second"
    bag.person(7.01, 7.05, WHOLE)


@pytest.mark.parametrize("make", [late_poses, late_joints, late_stamps, late_node])
def test_a_second_person_who_comes_late_is_refused_by_name(tmp_path: Path, make: Make) -> None:
    with pytest.raises(HricError, match=r"/hric/human/joint_states: .* two persons in one namespace cannot be told"):
        verdict(tmp_path, lambda bag: (bag.person(0.0, 5.0, WHOLE), make(bag))[1])


def test_sequence_numbers_of_two_persons_are_refused_wherever_they_begin(tmp_path: Path) -> None:
    """Poses are equal and stamps even; the second one counts from 1 on."""
    bag = Bag()
    bag.person(0.0, 8.0, WHOLE)
    bag.person(7.01, 7.4, WHOLE)
    for at, *_, message in bag.rows:
        message.header.seq = round(50.0 * at) if abs(50.0 * at - round(50.0 * at)) < 0.1 else round(50.0 * (at - 7.0))
    with pytest.raises(HricError, match=r"repeated sequence numbers, from 7\..*two persons in one name"):
        assess(opened(str(bag.save(tmp_path / "case.bag", numbered=None))))


def two_names(bag: Bag) -> None:
    arm(bag, 5.0, 8.0)
    arm(bag, 6.0, 8.0, prefix="left_joint")


def two_arms(bag: Bag) -> None:
    arm(bag, 5.0, 8.0)
    arm(bag, 6.013, 8.0, q=1.0)


def two_nodes(bag: Bag) -> None:
    bag.node = "/left"
    arm(bag, 5.0, 6.0)
    bag.node = "/right"
    arm(bag, 6.0, 6.1)


@pytest.mark.parametrize("make", [two_names, two_arms, two_nodes])
def test_two_arms_on_one_topic_are_refused_by_name(tmp_path: Path, make: Make) -> None:
    with pytest.raises(HricError, match=r"/joint_states: .* two arms on one topic cannot be told apart; valid:"):
        verdict(tmp_path, lambda bag: (arm(bag, 0.0, 5.0) if make is not two_nodes else None, make(bag))[1])


def test_an_arm_and_its_gripper_share_a_topic(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        for bag.node, names, prefix in (("/arm", 7, "panda_joint"), ("/gripper", 2, "panda_finger_joint")):
            arm(bag, 0.0, 3.0, names=names, prefix=prefix)
        bag.node = ""
        bag.silence(0.0, 3.0)

    assert only(tmp_path, make).outcome == Outcome.WITHIN


def test_a_joint_that_is_twice_in_a_message_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(HricError, match=r"/hric/human/joint_states: right_el_flex twice in one message; valid: each"):
        verdict(tmp_path, lambda bag: bag.person(0.0, 1.0, [*WHOLE, "right_el_flex"]))


def test_a_tracker_that_jumps_now_and_then_is_no_second_person(tmp_path: Path) -> None:
    """Three spikes within four seconds, and three more later."""

    def make(bag: Bag) -> None:
        bag.person(0.0, 12.0, WHOLE)
        bag.silence(0.0, 12.0)
        states = [row[-1] for row in bag.rows if row[1].endswith("joint_states")]
        for k in (20, 60, 100, 400, 440, 480):
            states[k].position = states[k].position + 3.5

    assert only(tmp_path, make).outcome == Outcome.WITHIN


@pytest.mark.parametrize("recorded", [True, False], ids=["arm", "no arm"])
def test_a_source_that_reports_contacts_alone_is_trusted_where_no_arm_is_recorded(
    tmp_path: Path, recorded: bool
) -> None:
    """It may have died after its last message: nothing is known of what an arm did since."""

    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(half_sine(100.0), 1.0, 1.02)
        if recorded:
            bag.control_log(0.0, 3.0)

    made = verdict(tmp_path, make)
    (conclusion,) = [one for one in made.conclusions if one.question == "contact"]
    assert conclusion.reply == ("unknown" if recorded else "yes")
    assert any("has no messages without contact" in line for line in made.assumptions) == (not recorded)
    if recorded:
        assert "the source sends no empty messages" in conclusion.reason
        assert "an empty one every 50 ms" in conclusion.remedy


@pytest.mark.parametrize("speed", [0.0, 0.001, 0.1])
def test_a_contact_above_its_limit_is_above_at_any_speed_of_the_arm(tmp_path: Path, speed: float) -> None:
    def make(bag: Bag) -> None:
        standing(bag)
        bag.contact(held(150.0), 0.5, 2.5)
        bag.control_log(0.0, 3.0, speed)

    assert Outcome.ABOVE in [one.outcome for one in contacts(tmp_path, make)]


def test_joint_states_without_positions_say_nothing(tmp_path: Path) -> None:
    def make(bag: Bag) -> None:
        bag.silence(0.0, 3.0)
        bag.put(0.0, "/joint_states", "sensor_msgs/msg/JointState", name=["a"], **dict.fromkeys(STATES, np.zeros(0)))
        standing(bag)

    assert only(tmp_path, make).outcome == Outcome.WITHIN


def restarted(bag: Bag) -> None:
    """A second run in one bag, whose time begins at 0 again."""
    bag.person(0.0, 3.0, WHOLE)
    second = Bag()
    second.person(0.0, 3.0, WHOLE, {"right_sh_flex": 100.0})
    bag.rows += [(at + 3.0, *row) for at, *row in second.rows]
    bag.nodes |= second.nodes


def test_a_clock_that_goes_back_is_refused_with_the_time(tmp_path: Path) -> None:
    with pytest.raises(HricError, match=r"joint_states: the stamps go back from 2.980 to 0.000 s.*; valid: the bag of"):
        verdict(tmp_path, restarted)


@pytest.mark.parametrize("field", ["position", "command_interface"])
def test_a_control_log_without_values_is_refused_with_the_field(tmp_path: Path, field: str) -> None:
    def make(bag: Bag) -> None:
        bag.control_log(0.0, 1.0)
        setattr(bag.rows[10][3], field, [] if field == "command_interface" else np.zeros(0))

    with pytest.raises(HricError, match=rf"control log at 0.200 s has 0 values of {field}; valid: "):
        verdict(tmp_path, make)


def test_a_message_of_the_control_log_without_cycles_is_none(tmp_path: Path) -> None:
    bag = Bag()
    bag.control_log(0.0, 1.0)
    empty = dict.fromkeys(("time", "position", "velocity", "effort", "command_raw", "command"), np.zeros(0))
    for field, value in {**empty, "n_cycles": 0}.items():
        setattr(bag.rows[10][3], field, value)
    log = opened(str(bag.save(tmp_path / "case.bag"))).recording.log
    assert log is not None and log.cycles == 98 and log.time[-1] == pytest.approx(0.99)


@pytest.mark.parametrize("names", [RIGHT[::-1], ["right_el_flex"]], ids=["another order", "one joint"])
def test_torques_belong_to_the_joints_that_their_message_names(tmp_path: Path, names: list[str]) -> None:
    def make(bag: Bag) -> None:
        bag.person(0.0, 1.0)
        for _, topic, _, message in bag.rows:
            if topic.endswith("joint_torque"):
                share = np.array([0.5 if name == "right_el_flex" else 0.0 for name in names])
                message.name, message.torque, message.strength_share = names, 0.0 * share, share
                message.at_strength, message.clipped = share > 1.0, np.zeros(len(names), np.uint32)

    figures = {one.name: one.value for one in verdict(tmp_path, make).figures if one.group == "strength"}
    assert [name for name, value in figures.items() if value] == [
        "largest torque of right elbow flexion over its strength"
    ]


def test_one_message_is_no_time_without_contact(tmp_path: Path) -> None:
    (finding,) = contacts(tmp_path, lambda bag: bag.silence(0.0, 0.01))
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "known for 0.00 of 0.00 s" in finding.reason
