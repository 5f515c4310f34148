"""Conclusions about five questions: not proven is not yes, above stays above, and no question hides another."""

import itertools
import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import known_bags
import pytest

from hric_assessment.contact.area import check_area
from hric_assessment.findings import DISCLAIMER, Finding, Missing, Outcome, UnjudgedValue
from hric_assessment.tables import REGIONS, area_table
from hric_assessment.verdict import AssessmentChoices, Verdict, result
from hric_assessment.verdict.comparing import compared
from hric_assessment.verdict.conclusions import (
    QUESTIONS,
    Conclusion,
    Reply,
    conclusions,
    unknown_beforehand,
    with_remedy,
)
from hric_core.command import perform
from hric_core.errors import HricError

WITHIN, WARNING, ABOVE, UNKNOWN = Outcome.WITHIN, Outcome.WARNING, Outcome.ABOVE, Outcome.NOT_ASSESSABLE
CONTACT, DISTANCE, RULA, REBA = "contact", "separation", "RULA of the right arm", "REBA of the right arm"
DONE = {"status": "completed", "definition": {"duration": 4.0}}


def finding(what: str, outcome: Outcome, **more: Any) -> Finding:
    """A finding of contact or separation, or a posture by its subject."""
    group = what if what in (CONTACT, DISTANCE, "lift") else "posture"
    return Finding(what, outcome, f"reason of {what}", "a table", group=group, **more)


def replies(*findings: Finding, run: dict[str, Any] | None = None) -> dict[str, Conclusion]:
    given = conclusions(result.ranked(findings), (), (), DONE if run is None else run)
    assert tuple(one.question for one in given) == QUESTIONS
    return {one.question: one for one in given}


def verdict(*findings: Finding, name: str = "a", figures: Sequence[UnjudgedValue] = ()) -> Verdict:
    about = result.RecordingSummary(name, "bag", None, 0.0, 1.0)
    ranked = result.ranked(findings)
    given = conclusions(ranked, figures, (), DONE)
    return Verdict(about, result.TableTitle("a", "b"), None, (), ranked, tuple(figures), conclusions=given)


@pytest.mark.parametrize(
    ("outcomes", "reply"),
    [
        ((), Reply.UNKNOWN),
        ((WITHIN,), Reply.YES),
        ((WITHIN, WARNING), Reply.WARNING),
        ((WARNING, UNKNOWN, WITHIN), Reply.UNKNOWN),
        ((UNKNOWN, ABOVE, WITHIN), Reply.NO),
    ],
)
@pytest.mark.parametrize(("what", "question"), [(CONTACT, "contact"), (DISTANCE, "distance"), (RULA, "posture")])
def test_the_worst_finding_answers_and_without_any_the_answer_is_unknown(
    what: str, question: str, outcomes: tuple[Outcome, ...], reply: Reply
) -> None:
    assert replies(*(finding(what, outcome) for outcome in outcomes))[question].reply == reply


@pytest.mark.parametrize(
    ("rula", "reba", "reply"),
    [
        (WITHIN, UNKNOWN, Reply.YES),  # the knees that REBA asks for hide nothing
        (WARNING, UNKNOWN, Reply.WARNING),
        (UNKNOWN, WITHIN, Reply.UNKNOWN),
        (WITHIN, ABOVE, Reply.NO),
        (UNKNOWN, ABOVE, Reply.NO),
        (ABOVE, UNKNOWN, Reply.NO),
        (None, UNKNOWN, Reply.UNKNOWN),
        (None, WITHIN, Reply.YES),
    ],
)
def test_rula_answers_for_the_posture_and_reba_where_it_is_worse(
    rula: Outcome | None, reba: Outcome, reply: Reply
) -> None:
    given = [finding(REBA, reba), *([] if rula is None else [finding(RULA, rula)])]
    assert replies(*given)["posture"].reply == reply


def test_one_arm_that_is_not_known_makes_the_posture_unknown() -> None:
    assert replies(finding(RULA, WITHIN), finding("RULA of the left arm", UNKNOWN))["posture"].reply == Reply.UNKNOWN


def test_no_finding_of_another_question_changes_an_answer() -> None:
    kinds = (CONTACT, DISTANCE, RULA)
    for outcomes in itertools.product((WITHIN, UNKNOWN, ABOVE), repeat=3):
        together = replies(*map(finding, kinds, outcomes))
        for kind, outcome, question in zip(kinds, outcomes, ("contact", "distance", "posture"), strict=True):
            assert together[question].reply == replies(finding(kind, outcome))[question].reply


@pytest.mark.parametrize(
    ("contact", "distance", "posture", "only", "code"),
    [
        (WITHIN, WITHIN, WITHIN, (), 0),
        (WARNING, WITHIN, WARNING, (), 0),
        (WITHIN, UNKNOWN, WITHIN, (), 4),
        (WITHIN, UNKNOWN, ABOVE, (), 3),
        (WITHIN, UNKNOWN, ABOVE, ("contact",), 0),
        (UNKNOWN, WITHIN, WITHIN, ("contact",), 4),
        (WITHIN, UNKNOWN, ABOVE, ("contact", "distance"), 4),
        (WITHIN, UNKNOWN, ABOVE, ("distance", "posture"), 3),
        (ABOVE, ABOVE, ABOVE, ("task",), 0),
        (WITHIN, WITHIN, WITHIN, ("effort",), 4),
    ],
)
def test_the_exit_code_is_that_of_the_questions_that_count(
    contact: Outcome, distance: Outcome, posture: Outcome, only: tuple[str, ...], code: int
) -> None:
    found = verdict(finding(CONTACT, contact), finding(DISTANCE, distance), finding(RULA, posture))
    assert found.exit_code(only) == code


def test_a_lift_above_its_limit_counts_and_a_lift_that_no_table_rates_does_not() -> None:
    good = [finding(CONTACT, WITHIN), finding(DISTANCE, WITHIN), finding(RULA, WITHIN)]
    assert verdict(*good, finding("lift", UNKNOWN)).exit_code() == 0
    assert verdict(*good, finding("lift", ABOVE)).exit_code() == 3
    assert verdict(*good, finding("lift", UNKNOWN)).exit_code(["effort"]) == 4


def test_effort_without_a_lift_is_a_number_without_a_limit() -> None:
    figure = UnjudgedValue("strength", "largest torque of elbow over its strength", 0.31, "1")
    effort = conclusions((), (figure,), (), DONE)[3]
    assert (effort.reply, effort.value, effort.limit, effort.unit) == (Reply.NO_LIMIT, pytest.approx(31.0), None, "%")


def test_a_lift_that_no_table_rates_leaves_the_effort_unknown_with_the_load_that_is_known() -> None:
    figure = UnjudgedValue("strength", "largest torque of elbow over its strength", 0.31, "1")
    effort = conclusions([with_remedy(finding("lift", UNKNOWN))], (figure,), (), DONE)[3]
    assert (effort.reply, effort.value, bool(effort.remedy)) == (Reply.UNKNOWN, pytest.approx(31.0), True)


@pytest.mark.parametrize(
    ("run", "reply"),
    [
        (DONE, Reply.YES),
        ({"status": "interrupted"}, Reply.NO),
        ({"status": "failed", "error": "x"}, Reply.NO),
        ({"status": "completed", "arm_error": "the motion was aborted: cartesian_reflex"}, Reply.NO),
        ({}, Reply.UNKNOWN),
    ],
)
def test_the_task_is_done_where_the_run_was_completed_without_an_error(run: dict[str, Any], reply: Reply) -> None:
    assert replies(run=run)["task"].reply == reply


def test_of_several_persons_the_worst_is_named_and_one_without_a_finding_is_unknown() -> None:
    first, second = "/hric/human", "/hric/human2"
    given = replies(
        finding(CONTACT, WITHIN, person=first),
        finding(CONTACT, ABOVE, person=second),
        finding(RULA, WITHIN, person=first),
        finding(DISTANCE, WITHIN, person=first),
        finding(DISTANCE, WARNING, person=second),
    )
    assert [(given[q].reply, given[q].person) for q in ("contact", "distance", "posture")] == [
        (Reply.NO, second),
        (Reply.WARNING, second),
        (Reply.UNKNOWN, second),
    ]


def test_an_unknown_answer_says_what_would_make_it_known() -> None:
    without_area = with_remedy(finding(CONTACT, UNKNOWN, missing=("the contact's area",)))
    arm = with_remedy(
        finding(RULA, UNKNOWN, missing=("the angle trunk_flexion",), signals=("/hric/human/joint_states",))
    )
    given = replies(without_area, arm)
    assert "--contact-area" in str(given["contact"]) and "human.parts:=upper_body" in str(given["posture"])
    nothing = conclusions((), (), (Missing("contacts (hric/human/contacts)", "contact forces to compare"),), {})
    assert "record contacts (hric/human/contacts)" in str(nothing[0])


@pytest.mark.parametrize("what", [CONTACT, DISTANCE, RULA, "lift"])
def test_no_finding_that_is_not_assessable_is_without_a_remedy(what: str) -> None:
    assert with_remedy(finding(what, UNKNOWN)).remedy
    assert "penalty" in with_remedy(finding(what, UNKNOWN, missing=("a force of penalty contact",))).remedy


def test_a_remedy_of_the_finding_itself_stays() -> None:
    assert with_remedy(finding(CONTACT, UNKNOWN, missing=("x",), remedy="do y")).remedy == "do y"
    assert with_remedy(finding(CONTACT, ABOVE, missing=("x",))).remedy == ""


def test_the_text_opens_with_five_lines_and_has_the_disclaimer_once() -> None:
    many = [finding(CONTACT, UNKNOWN, missing=("the contact's area",)) for _ in range(40)]
    text = verdict(*map(with_remedy, many)).render()
    lines = text.splitlines()
    assert [line.split(" ")[0] for line in lines[2:7]] == list(QUESTIONS)
    assert text.count(DISCLAIMER) == 1 and len(lines) <= 10 + result.SHOWN_LINES + 1
    assert "--all" in lines[-1]


def test_the_finding_that_decides_is_shown_before_those_that_do_not_count() -> None:
    text = verdict(finding(REBA, UNKNOWN), finding(RULA, WARNING)).render()
    assert text.index(f"- {RULA}") < text.index(f"- {REBA}")


def test_nearest_links_that_differ_are_one_row_of_a_comparison() -> None:
    a = Finding("distance of wrist from hand", WITHIN, "", "t", 0.5, group=DISTANCE)
    b = Finding("distance of elbow from link7", ABOVE, "", "t", 1.5, group=DISTANCE)
    rows = [line for line in compared([verdict(a), verdict(b, name="b")]).splitlines() if "distance of the arm" in line]
    assert len(rows) == 1 and "within limits (50 %)" in rows[0] and "above limits (150 %)" in rows[0]


def test_equal_names_are_numbered_in_a_comparison() -> None:
    head = compared([verdict(name="run"), verdict(name="other"), verdict(name="run")]).splitlines()[0].split()
    assert head == ["run", "(1)", "other", "run", "(2)"]


@pytest.mark.parametrize(
    ("run", "only", "text"),
    [
        ({"status": "failed", "error": "no arm"}, ("task",), "run failed; no arm"),
        ({"status": "failed"}, ("task", "contact"), "within limits, run failed"),
        (DONE, ("task",), "run completed"),
        ({}, ("task",), "no run.yaml"),
        ({"status": "failed"}, (), "not assessable"),
    ],
)
def test_the_headline_says_of_the_task_whether_the_run_was_completed(
    run: dict[str, Any], only: tuple[str, ...], text: str
) -> None:
    contact = finding(CONTACT, WITHIN)
    drawn = conclusions((contact,), (), (), run)
    made = replace(verdict(contact), conclusions=drawn)
    assert made.render(only).splitlines()[0] == f"a, 0.00 to 1.00 s: {text}"
    assert made.exit_code(("task",)) == (0 if run == DONE else 3 if run else 4)


# -- areas -------------------------------------------------------------------------------------------------------------


def test_every_region_has_a_largest_area() -> None:
    assert set(area_table().largest) == set(REGIONS)


@pytest.mark.parametrize("area", [0.0, -1e-4, float("nan"), float("inf")])
def test_a_number_that_is_no_area_is_refused_without_a_comparison(area: float) -> None:
    with pytest.raises(
        HricError, match=rf"^contact_area is {area:g} m\^2; valid: 1e-06 to 0\.15 m\^2 \(chosen here\)$"
    ):
        check_area(area)


@pytest.mark.parametrize("area", [1e-7, 0.2])
def test_an_area_that_no_contact_has_is_refused(area: float) -> None:
    with pytest.raises(
        HricError, match=r"^contact_area is .* a contact with a body can cover; valid: 1e-06 to 0\.15 m"
    ):
        check_area(area)


def test_an_area_that_was_meant_in_square_centimetres_is_refused_with_both_values() -> None:
    with pytest.raises(HricError, match=r"0\.2 m\^2, which is 2000 cm\^2, .*did you mean 0\.2 cm\^2: 2e-05"):
        check_area(0.2, ["hand, fingers"])


@pytest.mark.parametrize("area", [1e-6, 0.02])
def test_the_smallest_and_the_largest_area_of_a_region_are_areas_of_it(area: float) -> None:
    check_area(area, ["hand, fingers"])


@pytest.mark.parametrize(
    ("area", "told"),
    [
        (
            0.5,
            "side is 0.5 m^2, which is 5000 cm^2, larger than what a contact with hand, fingers can cover; "
            "valid: 1e-06 to 0.02 m^2 (chosen here); did you mean 0.5 cm^2: 5e-05?",
        ),
        (
            5e-7,
            "side is 5e-07 m^2, which is 0.005 cm^2, smaller than what a contact with hand, fingers can cover; "
            "valid: 1e-06 to 0.02 m^2 (chosen here)",
        ),
    ],
)
def test_an_area_is_refused_with_its_side_and_a_suggestion_that_is_an_area(area: float, told: str) -> None:
    with pytest.raises(HricError) as caught:
        check_area(area, ["hand, fingers", "chest"], "side")
    assert str(caught.value) == told


def test_an_area_must_fit_the_smallest_region_that_was_met() -> None:
    check_area(0.05, ["chest"])
    with pytest.raises(HricError, match="hand, fingers"):
        check_area(0.05, ["chest", "hand, fingers"])


# -- the command -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    known_bags.write(folder)
    return folder


def test_one_question_alone_has_an_exit_code_of_its_own(bags: Path) -> None:
    bag, area = str(bags / "within.bag"), ("--contact-area", str(known_bags.AREA))
    assert perform(["assess", bag, *area]) == 4  # nobody knows where the arm was
    assert perform(["assess", bag, *area, "--only", "contact"]) == 0
    assert perform(["assess", bag, "--only", "contact"]) == 4
    assert perform(["assess", bag, *area, "--only", "contact,distance"]) == 4


def test_an_area_larger_than_the_hand_that_was_met_leaves_no_verdict(bags: Path) -> None:
    (bags / "within_verdict.json").unlink(missing_ok=True)
    with pytest.raises(HricError, match=r"--contact-area is 0\.1 m\^2.*hand, fingers"):
        perform(["assess", str(bags / "within.bag"), "--contact-area", "0.1"])
    assert not (bags / "within_verdict.json").exists()


def test_bags_of_one_folder_keep_a_verdict_each(bags: Path) -> None:
    perform(["assess", str(bags / "within.bag"), "--compare", str(bags / "posture.bag")])
    for name in ("within", "posture"):
        assert json.loads((bags / f"{name}_verdict.json").read_text())["input"]["name"] == name


def test_a_verdict_that_cannot_be_written_is_printed(
    bags: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(bags / "within.bag", tmp_path)
    (tmp_path / "within_verdict.json").mkdir()
    with pytest.raises(HricError, match=r"cannot write .*within_verdict.json"):
        perform(["assess", str(tmp_path / "within.bag")])
    assert "contact   unknown" in capsys.readouterr().out


def test_the_schema_of_the_json_is_that_of_its_types() -> None:
    """Write the file again by json.dumps(verdict_schema(), indent=2)."""
    path = Path(__file__).parents[1] / "config" / "verdict.schema.json"
    assert json.loads(path.read_text()) == result.verdict_schema()


def test_an_area_that_run_yaml_has_as_the_text_1e_4_is_a_number() -> None:
    assert AssessmentChoices().stated({"human": {"contact_area": "1e-4"}}).contact_area == 1e-4


def test_the_older_table_of_rula_can_be_chosen(bags: Path) -> None:
    assert perform(["assess", str(bags / "posture.bag"), "--only", "posture", "--rula-table", "older"]) in (0, 4)
    with pytest.raises(SystemExit):
        perform(["assess", str(bags / "posture.bag"), "--rula-table", "oldest"])


def test_the_worst_moment_is_drawn_with_what_decides(bags: Path, tmp_path: Path) -> None:
    perform(["assess", str(bags / "approach.bag"), "--only", "distance", "--picture", str(tmp_path / "worst.svg")])
    drawn = ElementTree.parse(tmp_path / "worst.svg").getroot()
    moment = json.loads((bags / "approach_verdict.json").read_text())["moment"]
    capsules = [*moment["arm"], *moment["person"]]
    assert [sum(one["decides"] for one in moment[model]) for model in ("arm", "person")] == [1, 1]
    assert len([one for one in drawn if one.tag.endswith("}g")]) == len(capsules)


@pytest.mark.parametrize(
    ("settings", "lacks"),
    [
        ({}, ("contact", "posture")),
        ({"parts": "upper_body"}, ("contact",)),
        ({"contact_area": 1e-4}, ("posture",)),
        ({"contact_area": 1e-4, "parts": "whole_body"}, ()),
    ],
)
def test_a_run_says_beforehand_what_its_verdict_will_not_know(settings: dict[str, Any], lacks: tuple[str, ...]) -> None:
    said = unknown_beforehand(settings)
    assert tuple(word for word in ("contact", "posture") if f" {word}" in said) == lacks and bool(said) == bool(lacks)
