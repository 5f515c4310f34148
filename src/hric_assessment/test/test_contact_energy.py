"""Class of a contact, its interpretation, and the energy of a contact against its limit."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from verdict_cases import AREA, Bag, half_sine

from hric_assessment.contact.assess import ContactSite, assess
from hric_assessment.contact.classes import BY_CLAMPING, ContactClass, contact_class
from hric_assessment.contact.energy import MEASURED, absorbed, energy_finding
from hric_assessment.contact.episodes import Episode, split
from hric_assessment.contact.limits import Limits
from hric_assessment.findings import CONTACT, ENERGY, Finding, Outcome
from hric_assessment.tables import episode_table
from hric_assessment.tables.limits import EnergyRow
from hric_assessment.verdict import AssessmentChoices, Verdict, opened
from hric_assessment.verdict.assess import judge
from hric_assessment.verdict.conclusions import Reply
from hric_human.contact import RegionContact

ISO, HAND = Limits.named(), ContactSite(("hand, fingers",), "panda::panda_hand", contact_area=1e-3)
X, BACK, UP = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def touch(
    other: str = "panda::panda_hand", normal: tuple[float, float, float] | None = X, **about: object
) -> RegionContact:
    met = RegionContact("r_wrist", ("hand, fingers",), other, "penalty", 1.0, 0.5, begin_normal=normal, normal=normal)
    return replace(met, **about)  # type: ignore[arg-type]


def hit(peak: float, *contacts: RegionContact) -> Episode:
    time = np.arange(0.0, 0.02, 1e-3)
    episode = split(time, peak * np.sin(math.pi * time / 0.02), episode_table(), 1e3)
    return replace(episode, contacts=contacts or (touch(),))


def energy_of(episode: Episode, site: ContactSite = HAND, limits: Limits = ISO, **about: bool) -> Finding:
    finding = energy_finding(episode, site, limits, **about)
    assert finding is not None
    return finding


# -- class -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("second", "complete", "expected"),
    [
        (touch("wall::link", BACK), True, ContactClass.CLAMPED),
        (touch("wall::link", BACK, kind="rigid"), False, ContactClass.CLAMPED),
        (touch("panda::panda_leftfinger", BACK), True, ContactClass.CLAMPED),
        (touch("wall::link", UP), True, ContactClass.FREE),
        (touch("wall::link", BACK, begin=3.0), True, ContactClass.FREE),
        (touch("wall::link", BACK, link="r_elbow"), True, ContactClass.FREE),
        (touch("wall::link", None), True, ContactClass.UNKNOWN),
        (touch("wall::link", UP), False, ContactClass.UNKNOWN),
    ],
)
def test_a_second_body_decides_the_class(second: RegionContact, complete: bool, expected: ContactClass) -> None:
    first = touch()
    assert contact_class([first], [first, second], complete)[0] == expected


def test_a_clamped_contact_has_quasi_static_limits() -> None:
    episode = hit(200.0)
    assert assess(episode, HAND, ISO).outcome == Outcome.WITHIN
    held = assess(episode, HAND, ISO, held=True)
    assert (held.outcome, held.share) == (Outcome.ABOVE, pytest.approx(episode.overall.peak / 140.0))


def verdict(path: Path, peak: float, chosen: str = "by_duration") -> Verdict:
    bag = Bag()
    bag.person(0.0, 3.0)
    bag.contact(half_sine(peak), 1.0, 1.02)
    return judge(opened(str(bag.save(path))), AssessmentChoices(contact_area=AREA, interpretation=chosen))


@pytest.mark.parametrize(("chosen", "outcome"), [("by_duration", Outcome.WARNING), (BY_CLAMPING, Outcome.ABOVE)])
def test_an_unknown_class_counts_as_clamped(tmp_path: Path, chosen: str, outcome: Outcome) -> None:
    findings = verdict(tmp_path / "a.bag", 250.0, chosen).findings
    finding = next(item for item in findings if item.group == CONTACT)
    assert finding.outcome == outcome
    assert finding.notes[0].startswith("class: not known") and finding.notes[0].endswith(chosen)
    assert finding.notes[1].startswith("interpretation by_")


# -- energy ------------------------------------------------------------------------------------------------------------


def test_a_recorded_energy_is_compared_with_its_limit() -> None:
    finding = energy_of(hit(100.0, touch(energy=0.3)))
    assert (finding.outcome, finding.share) == (Outcome.WITHIN, pytest.approx(0.3 / 0.49))
    assert MEASURED in finding.notes[0]
    assert finding.notes[1] == "energy limit: unconfirmed (memory); F^2/(2 k) of the transient force limit: 0.523 J"


def test_an_unknown_energy_is_that_of_the_spring() -> None:
    episode = hit(275.0)
    finding = energy_of(episode)
    assert finding.values["transferred energy [J]"] == pytest.approx(episode.overall.peak**2 / 150e3)
    assert finding.outcome == Outcome.ABOVE, "0.50 J, though the force is below its limit of 280 N"


def test_a_doubt_keeps_an_energy_from_being_within() -> None:
    episode = replace(hit(100.0, touch(energy=0.1)), doubts=("a sample is missing",))
    assert energy_of(episode).outcome == Outcome.NOT_ASSESSABLE


def test_a_held_contact_has_the_energy_of_its_force_limit() -> None:
    finding = energy_of(hit(100.0, touch(energy=0.1)), held=True)
    assert finding.values["energy limit [J]"] == pytest.approx(140.0**2 / 150e3)
    assert "computed" in finding.notes[1]


def test_a_table_without_energies_has_computed_ones() -> None:
    finding = energy_of(hit(100.0, touch(energy=0.1)), limits=Limits.named("bgia2011"))
    assert finding.values["energy limit [J]"] == pytest.approx(180.0**2 / 150e3)


@pytest.mark.parametrize("site", [replace(HAND, regions=("face",)), replace(HAND, kind="rigid")])
def test_no_energy_is_judged_without_a_limit(site: ContactSite) -> None:
    assert energy_finding(hit(100.0), site, ISO) is None


@pytest.mark.parametrize("row", ISO.table.energies, ids=lambda row: row.region)
def test_each_energy_follows_from_its_force(row: EnergyRow) -> None:
    computed = Limits(replace(ISO.table, energies=())).energy(row.region, held=False)
    assert computed is not None and 0.92 * computed.energy < row.transient <= round(computed.energy, 1)


def test_energies_of_one_robot_are_added() -> None:
    contacts = touch(energy=0.2), touch("panda::panda_link7", energy=0.1), touch("wall::link", energy=0.25)
    assert absorbed(contacts) == pytest.approx(0.3)
    assert absorbed([*contacts, touch(energy=0.15)]) == pytest.approx(0.3), "of repeated contacts the largest"
    assert absorbed([*contacts, touch()]) is None


def test_an_energy_above_its_limit_decides_the_question(tmp_path: Path) -> None:
    judged = verdict(tmp_path / "a.bag", 275.0)
    answer = next(item for item in judged.conclusions if item.question == "contact")
    assert answer.reply == Reply.NO
    assert answer.finding is not None and judged.findings[answer.finding].group == ENERGY
