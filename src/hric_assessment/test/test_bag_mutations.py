"""Bags from closed forms, damaged in one thing at a time: no verdict becomes better, and what was touched is named."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import known_bags
import numpy as np
import pytest
from bag_mutations import RATES, Mutation, RawBag, clip, cut, drop, lose, mutations, nan, shift, strip, throttle
from mutation_law import Judged, Recorded, faults_of, judged, still_shown, tally

from hric_assessment.findings import CONTACT, Outcome
from hric_assessment.verdict.choices import AssessmentChoices
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

CONTACTS, STATES = "/hric/human/contacts", "/hric/human/joint_states"
NAMES = ("within", "above", "clamped", "head", "rigid", "no_area", "approach", "posture", "bent", "calm")


def still(folder: Path, name: str, degrees: dict[str, float]) -> Path:
    """Write a bag of a whole body that holds a posture [deg]."""
    body = describe(HumanSettings.of({"parts": "whole_body"}, "human").person)
    angles = {joint: math.radians(degrees.get(joint, 80.0 if "el_flex" in joint else 0.0)) for joint in body.joints}
    with known_bags.Bag(folder / f"{name}.bag") as bag:
        known_bags.joints(bag, np.arange(0.0, 2.0, 0.02), angles)
    return folder / f"{name}.bag"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Recorded]:
    folder = tmp_path_factory.mktemp("bags")
    known = {one.name: one for one in known_bags.write(folder)}
    still(folder, "bent", {"trunk_flex": 70.0, "neck_flex": 30.0, "right_sh_flex": 120.0, "left_sh_flex": 120.0})
    still(folder, "calm", {})
    area = {name: AssessmentChoices(contact_area=known_bags.AREA) for name, one in known.items() if one.options}
    return {
        name: Recorded(name, RawBag.of(folder / f"{name}.bag"), choices=area.get(name, AssessmentChoices()))
        for name in NAMES
    }


def damage(recorded: Recorded, mutation: Mutation) -> Judged:
    return judged(recorded.with_bag(mutation.apply(recorded.bag)))


@pytest.mark.parametrize("name", NAMES)
def test_no_mutation_of_a_known_bag_improves_its_verdict_and_what_it_touched_is_named(
    name: str, recordings: dict[str, Recorded]
) -> None:
    found = tally(recordings[name])
    print(found)
    assert not found.faults, "\n".join(found.faults)


@pytest.mark.parametrize("loss", [lose(CONTACTS, "the peak", (1.012, 1.034)), throttle(CONTACTS, 25.0)], ids=str)
def test_a_peak_between_two_messages_of_a_contact_counts(loss: Mutation, tmp_path: Path) -> None:
    path = tmp_path / "blow.bag"
    known_bags.contact(path, known_bags.HAND, known_bags.half_sine(350.0, 0.05), 1.0, 1.05)
    recorded = Recorded("blow", RawBag.of(path), choices=AssessmentChoices(contact_area=known_bags.AREA))
    damaged = damage(recorded, loss)
    assert max(force(recorded.with_bag(loss.apply(recorded.bag)))) < 280.0, "no message has a force above the limit"
    assert damaged.outcomes["contact"] is Outcome.ABOVE
    assert damaged.verdict is not None
    finding = next(item for item in damaged.verdict.findings if item.group == CONTACT)
    assert finding.share == pytest.approx(350.0 / 280.0, rel=1e-3)


def force(recorded: Recorded) -> list[float]:
    """Forces of the contacts in all messages [N]."""
    bag = recorded.bag
    messages = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.rows if c.topic == CONTACTS]
    return [contact.force for message in messages for contact in message.touching]


# -- the mutations and the law themselves ------------------------------------------------------------------------------


def contacts_of(bag: RawBag) -> list[Any]:
    messages = [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.rows if c.topic == CONTACTS]
    return [contact for message in messages for contact in (*message.touching, *message.ended)]


def first(bag: RawBag, topic: str) -> Any:
    """The first message of a topic."""
    return next(bag.deserialize(raw, c.msgtype) for c, _, raw in bag.rows if c.topic == topic)


def test_a_bag_reads_in_memory_as_from_its_file(recordings: dict[str, Recorded]) -> None:
    bag = recordings["above"].bag
    assert {topic: one.msgcount for topic, one in bag.topics.items()} == {
        STATES: 76,
        "/hric/human/joint_torque": 76,
        CONTACTS: 21,
    }
    assert (bag.start_time, bag.message_count) == (0, 173)


@pytest.mark.parametrize(
    ("mutation", "left"),
    [
        (strip(CONTACTS), 0),
        (drop(CONTACTS, 0.9, 0), 4),
        (lose(CONTACTS, "the middle", (1.009, 1.011)), 0),
        (cut(CONTACTS, "first", 0.67), 15),
        (cut(CONTACTS, "last", 0.33), 5),
        (throttle(CONTACTS, RATES[0]), 3),
    ],
    ids=str,
)
def test_a_loss_leaves_so_many_messages_of_its_topic_and_all_of_the_others(
    mutation: Mutation, left: int, recordings: dict[str, Recorded]
) -> None:
    bag = recordings["above"].bag
    damaged = mutation.apply(bag)
    assert len(damaged.times(CONTACTS)) == left
    assert damaged.message_count == left + len(bag.times(STATES)) + len(bag.times("/hric/human/joint_torque"))


@pytest.mark.parametrize(
    ("mutation", "holds"),
    [
        (nan(CONTACTS, "force", 1.0, 0), lambda contact: math.isnan(contact.force) and contact.peak >= 0.0),
        (clip(CONTACTS, 0.6), lambda contact: max(contact.force, contact.peak) <= 210.0 + 1e-9),
    ],
    ids=["NaN", "clip"],
)
def test_a_field_is_changed_in_every_message(
    mutation: Mutation, holds: Callable[[Any], bool], recordings: dict[str, Recorded]
) -> None:
    assert all(map(holds, contacts_of(mutation.apply(recordings["above"].bag))))


@pytest.mark.parametrize("both", [False, True])
def test_stamps_shift_with_or_without_the_time_of_recording(both: bool, recordings: dict[str, Recorded]) -> None:
    bag = recordings["above"].bag
    damaged = shift(CONTACTS, 0.2, both).apply(bag)
    before, after = (first(one, CONTACTS).header.stamp for one in (bag, damaged))
    assert after.sec + 1e-9 * after.nanosec == pytest.approx(before.sec + 1e-9 * before.nanosec + 0.2)
    assert damaged.times(CONTACTS)[0] - bag.times(CONTACTS)[0] == (200_000_000 if both else 0)


def test_swapped_sides_change_names_and_leave_flags(recordings: dict[str, Recorded]) -> None:
    bag = recordings["posture"].bag
    (swap,) = (one for one in mutations(bag, {}) if one.name == f"left and right of {STATES}")
    damaged = swap.apply(bag)
    before, after = (first(one, STATES) for one in (bag, damaged))
    at = before.name.index("right_el_flex")
    assert (after.name[at], after.name[0]) == ("left_el_flex", before.name[0])
    assert sorted(after.name) == sorted(before.name)
    assert list(before.position) == list(after.position)


def test_a_verdict_that_hides_what_is_above_breaks_the_law(recordings: dict[str, Recorded]) -> None:
    above, within = judged(recordings["above"]), judged(recordings["within"])
    faults = faults_of(above, within, drop(STATES, 0.1, 0))
    assert any("above limits became within limits" in fault for fault in faults)


def test_what_the_bag_still_shows_must_stay_above(recordings: dict[str, Recorded]) -> None:
    recorded = recordings["clamped"]
    base = judged(recorded)
    assert base.verdict is not None
    finding = base.verdict.findings[0]
    assert still_shown(base, strip(STATES).apply(recorded.bag), finding)
    assert not still_shown(base, strip(CONTACTS).apply(recorded.bag), finding)


def test_a_change_without_a_word_breaks_the_law(recordings: dict[str, Recorded]) -> None:
    within, above = judged(recordings["within"]), judged(recordings["above"])
    assert faults_of(within, above, Mutation("drop", "of nothing", ("/nobody",), lambda bag: bag))
