"""Tasks of a work file: OCRA checklist, pushing and pulling, and lifts, by tables, examples, and known postures."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hric_assessment.ergonomics import ocra
from hric_assessment.ergonomics.niosh import HOUR, Lift, rate
from hric_assessment.ergonomics.ocra import Ends
from hric_assessment.ergonomics.pushing import limits
from hric_assessment.findings import Finding, NotAssessableError, Outcome
from hric_assessment.tables import ocra_table, push_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.tasks import stances_of, task_methods
from hric_assessment.work import LiftTask, PushTask, RepetitiveTask, Work, load
from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_bags.records.recording import Recording
from hric_bags.records.root_record import RootRecord
from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_human.body import Subject, describe

BODY = describe(Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body"))
JOINTS = tuple(BODY.joints)
TIME = np.arange(0.0, 20.0, 0.05)
STATED: Mapping[str, str] = {
    "recovery": "two_breaks",
    "static_hold": "none",
    "moderate_force": "third",
    "strong_force": "none",
    "maximal_force": "none",
    "grip": "third",
    "same_gestures": "half",
    "additional": "none",
    "pace": "partly",
}
STILL = dict.fromkeys(("shoulder", "raised", "elbow", "wrist"), Ends(0.0, 0.0, 0.0))


def person(degrees: Mapping[str, float] = {}, deviation: float = 0.0) -> AssessedPerson:
    """Return a person at rest; deviation: standard deviation of each joint angle [deg]."""
    q = np.tile(np.radians([degrees.get(name, 0.0) for name in JOINTS]), (len(TIME), 1))
    root = RootRecord.still(Pose((1.0, 2.0, BODY.base_height)))
    spread = np.full_like(q, np.radians(deviation))
    return AssessedPerson("tracked person", BODY, JOINTS, TIME, q, root, root, ("trial",), deviation=spread)


def findings(who: AssessedPerson, **work: object) -> list[Finding]:
    recording = Recording({}, frozenset(), 0.0, float(TIME[-1]), float, None, {}, None)
    source = AssessmentInput("trial", "c3d", Path(), recording)
    return [item for method in task_methods() for item in method.findings(source, who, Work(**work))]


# OCRA checklist


def test_a_score_is_the_sum_of_its_parts_by_the_duration() -> None:
    """Two breaks 4, 30 actions 1, force 2, a pinch grip 2 and gestures 1.5, pace 1; 300 min: 0.85."""
    rated = ocra.rate(STATED, Ends(30.0, 30.0, 30.0), STILL, 300.0)
    assert rated.score == pytest.approx((11.5 * 0.85,) * 3) and rated.unknown == ()


def test_the_duration_and_breaks_of_a_published_sheet_have_its_scores() -> None:
    """260 min of repetitive work have the factor 0.85, two breaks have 4: scribd.com/document/616477279."""
    rated = ocra.rate(STATED, Ends(20.0, 20.0, 20.0), STILL, 260.0)
    assert (rated.parts["duration"], rated.parts["recovery"]) == (0.85, 4.0)


@pytest.mark.parametrize(
    ("actions", "score"), [(0, 0), (20, 0), (21, 1), (30, 1), (31, 4), (40, 4), (50, 6), (60, 8), (61, 10), (200, 10)]
)
def test_the_next_more_frequent_row_counts(actions: float, score: float) -> None:
    rated = ocra.rate(STATED, Ends(actions, actions, actions), STILL, 480.0)
    assert rated.parts["frequency"] == score


@pytest.mark.parametrize(
    ("share", "shoulder", "wrist"),
    [(0.09, 0, 0), (0.1, 2, 0), (0.25, 6, 2), (0.49, 6, 2), (0.5, 12, 4), (0.79, 12, 4), (0.8, 24, 8), (1.0, 24, 8)],
)
def test_shares_of_the_time_have_the_scores_of_the_checklist(share: float, shoulder: float, wrist: float) -> None:
    options, ends = {**STATED, "grip": "none", "same_gestures": "none"}, Ends(share, share, share)
    scores = [
        ocra.rate(options, Ends(0.0, 0.0, 0.0), {**STILL, name: ends}, 480.0).parts["posture"]
        for name in ("shoulder", "wrist")
    ]
    assert scores == [shoulder, wrist]


def test_what_is_not_known_never_gives_a_good_score() -> None:
    nothing = ocra.rate(dict.fromkeys(STATED), None, STILL, None)
    worst = sum(max(scores.values()) for name, scores in ocra_table().factors.items() if name != "static_hold")
    assert nothing.score.low == 0.0 and nothing.score.worst == pytest.approx(4.0 * (worst + 10.0))
    assert set(nothing.unknown) == {*STATED, "minutes", "actions"}


def test_repetitive_work_is_judged_only_if_it_is_stated() -> None:
    everything = {"factors": STATED, "minutes": 300.0, "actions": 30.0}
    right, _ = findings(person(), repetitive=(RepetitiveTask(**everything),))
    without_recovery = {name: option for name, option in STATED.items() if name != "recovery"}
    assert (right.outcome, right.side) == (Outcome.WARNING, "right") and right.values["OCRA score [1]"] == 9.775
    right, _ = findings(person(), repetitive=(RepetitiveTask(**{**everything, "factors": without_recovery}),))
    assert right.outcome == Outcome.NOT_ASSESSABLE and right.missing == ("recovery",)
    assert "up to 14.9 with all that is not known: acceptable to medium risk" in right.reason
    assert "--work" in right.remedy and right.share is None
    assert findings(person()) == []


def test_raised_arms_are_above_limits_whatever_is_not_stated() -> None:
    raised = {f"{side}_sh_flex": 100.0 for side in ("right", "left")}
    right, _ = findings(person(raised), repetitive=(RepetitiveTask(minutes=480.0),))
    assert right.outcome == Outcome.ABOVE and right.values["share of time, shoulder [1]"] == 1.0


def test_an_arm_near_shoulder_height_is_judged_by_the_worse_end() -> None:
    stated = RepetitiveTask(480.0, 20.0, STATED)
    for deviation, outcome in ((0.0, Outcome.WARNING), (3.0, Outcome.ABOVE)):
        right, _ = findings(person({"right_sh_flex": 76.0}, deviation), repetitive=(stated,))
        assert right.outcome == outcome
    assert "OCRA score 10.5 to 32.5" in right.reason


def test_a_wrist_that_no_marker_shows_is_not_a_straight_one() -> None:
    who, stated = person(), RepetitiveTask(300.0, 20.0, STATED)
    unseen = who.q.copy()
    unseen[:, JOINTS.index("right_wr_flex")] = np.nan
    right, left = findings(replace(who, q=unseen), repetitive=(stated,))
    assert right.outcome == Outcome.NOT_ASSESSABLE and right.missing == ("posture of the wrist",)
    assert left.outcome == Outcome.WARNING


def test_wide_movements_of_the_elbow_are_counted_by_their_time() -> None:
    who = person()
    q, moving = who.q.copy(), TIME < 10.0
    q[moving, JOINTS.index("right_el_flex")] = 0.7 + 0.7 * np.sin(2.0 * np.pi * TIME[moving])
    right, _ = findings(replace(who, q=q), repetitive=(RepetitiveTask(),))
    assert right.values["share of time, elbow [1]"] == pytest.approx(0.5, abs=0.08)


# pushing and pulling


def test_a_published_push_has_its_limits_and_index() -> None:
    """Hands at 95 cm, 7.5 m once a minute: 23 and 13 kg; 15 and 10 kg have the index 0.77 (tests of snook.ts)."""
    accepted = limits("push", (0.95, 0.95), 7.5, 60.0)
    assert_allclose(np.array(accepted) / 9.80665, [23.0, 13.0])
    assert round(max(15.0 * 9.80665 / accepted.initial, 10.0 * 9.80665 / accepted.sustained), 2) == 0.77


def test_the_stricter_neighbours_of_a_table_count() -> None:
    assert_allclose(limits("push", (0.8, 1.0), 3.0, 59.0).initial / 9.80665, min(16.0, 18.0, 14.0))
    assert_allclose(limits("pull", (0.9, 0.9), 60.0, 300.0).initial / 9.80665, 16.0)


@pytest.mark.parametrize(
    ("heights", "way", "interval", "words"),
    [
        ((0.5, 0.9), 2.0, 60.0, "the hands are 50 to 90 cm high"),
        ((0.9, 0.9), 61.0, 600.0, "the distance is 61 m"),
        ((0.9, 0.9), 7.5, 14.0, "one action every 14 s over 7.5 m"),
    ],
)
def test_what_the_table_does_not_have_is_not_assessable(
    heights: tuple[float, float], way: float, interval: float, words: str
) -> None:
    with pytest.raises(NotAssessableError, match=words):
        limits("push", heights, way, interval)


def test_forces_grow_with_rest_and_shrink_with_the_way() -> None:
    """A table that is copied wrongly would break its order (all rows of Snook and Ciriello have it)."""
    table = push_table()
    for row in (*table.push, *table.pull):
        for forces in (row.initial, row.sustained):
            at = 0
            for group in table.columns:
                part = forces[at : at + len(group.intervals)]
                assert list(part) == sorted(part)
                at += len(group.intervals)
        assert all(a > b for a, b in zip(row.initial, row.sustained, strict=True))


PUSH = PushTask(1.0, 4.0, "push", initial=150.0, sustained=90.0, distance=7.5, interval=60.0, workforce="men")
BENT = {
    f"{side}_{joint}": value for side in ("right", "left") for joint, value in (("el_flex", 80.0), ("sh_flex", 10.0))
}


def test_a_push_of_men_with_stated_forces_is_judged() -> None:
    (finding,) = findings(person(BENT), pushes=(PUSH,))
    assert finding.outcome == Outcome.WITHIN and "which 90 % of men accept" in finding.reason
    (finding,) = findings(person(BENT), pushes=(replace(PUSH, initial=300.0),))
    assert finding.outcome == Outcome.ABOVE


@pytest.mark.parametrize(
    "change", [{"workforce": "mixed"}, {"workforce": None}, {"initial": None}, {"distance": None}, {"interval": None}]
)
def test_a_push_of_which_something_is_not_known_is_not_within(change: dict[str, object]) -> None:
    (finding,) = findings(person(BENT), pushes=(replace(PUSH, **change),))  # type: ignore[arg-type]
    assert finding.outcome == Outcome.NOT_ASSESSABLE and finding.missing and finding.remedy


def test_what_men_do_not_accept_is_above_limits_for_all() -> None:
    (finding,) = findings(person(BENT), pushes=(replace(PUSH, sustained=300.0, workforce="mixed", interval=None),))
    assert finding.outcome == Outcome.ABOVE


def test_forces_of_recorded_grips_are_measured_in_their_time() -> None:
    """Two hands with 40 N each in the horizontal plane, 100 N at the begin; outside the grips nothing is known."""
    time, who = np.arange(0.0, 5.0, 0.01), person(BENT)
    size = np.where(time < 1.5, 50.0, 40.0)
    force = np.column_stack([0.6 * size, 0.8 * size, 0.0 * size])
    none = np.zeros_like(force)
    grips = {
        side: GripRecord(
            side,
            "cart::cart",
            f"human::{BODY.segments[f'{side}_hand'].link}",
            time,
            time > -1.0,
            force,
            none,
            none,
            size,
        )
        for side in ("right", "left")
    }
    record = HumanRecord(JOINTS, TIME, who.q, TIME[:0], TIME[:0], TIME[:0], {}, grips)
    measured = replace(PUSH, initial=None, sustained=None, begin=1.0, end=4.0)
    (finding,) = findings(replace(who, record=record), pushes=(measured,))
    assert finding.values["initial force [N]"] == pytest.approx(100.0)
    assert finding.values["sustained force [N]"] == pytest.approx(80.0 + 20.0 * 0.5 / 3.0, rel=0.02)
    assert finding.outcome == Outcome.WITHIN
    (finding,) = findings(replace(who, record=record), pushes=(replace(measured, end=8.0),))
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "initial force" in finding.missing
    seen = (time < 1.2) | (time > 3.8)
    grips = {side: replace(grip, time=time[seen], force=force[seen]) for side, grip in grips.items()}
    (finding,) = findings(replace(who, record=replace(record, grips=grips)), pushes=(measured,))
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "initial force" in finding.missing


def test_a_short_jerk_of_a_long_push_is_its_initial_force() -> None:
    time, who = np.arange(0.0, 20.0, 0.01), person(BENT)
    force = np.column_stack([np.where(np.abs(time - 0.055) < 0.02, 400.0, 40.0), 0.0 * time, 0.0 * time])
    about = "cart::cart", f"human::{BODY.segments['right_hand'].link}", time, time > -1.0
    grip = GripRecord("right", *about, force, 0.0 * force, 0.0 * force, time)
    record = HumanRecord(JOINTS, TIME, who.q, TIME[:0], TIME[:0], TIME[:0], {}, {"right": grip})
    measured = replace(PUSH, initial=None, sustained=None, begin=0.0, end=19.0)
    (finding,) = findings(replace(who, record=record), pushes=(measured,))
    assert finding.values["initial force [N]"] == pytest.approx(400.0) and finding.outcome == Outcome.ABOVE


# lifts


LIFT = LiftTask(2.0, 8.0, 8.0, per_minute=0.2, hours=1.0, coupling="good")


def lifted(deviation: float = 0.0) -> AssessedPerson:
    """Return a person who lifts the hands at 5 s, from hanging arms bent by 40 deg to forearms bent by 100 deg."""
    who = person({f"{side}_el_flex": 40.0 for side in ("right", "left")}, deviation)
    q = who.q.copy()
    q[np.ix_(TIME > 5.0, [JOINTS.index("right_el_flex"), JOINTS.index("left_el_flex")])] = np.radians(100.0)
    return replace(who, q=q)


def test_a_stated_lift_has_the_index_of_its_geometry() -> None:
    pick, put = findings(lifted(), lifts=(LIFT,))
    values = pick.values
    names = ("horizontal distance H [m]", "height V [m]", "travel D [m]", "asymmetry A [rad]")
    h, v, d, a = (float(values[name] or 0.0) for name in names)
    assert values["lifting index [1]"] == pytest.approx(rate(Lift("pick-up", 8.0, h, v, d, a, 0.2, HOUR)).index)
    assert pick.outcome == Outcome.WITHIN and put.subject == "put-down of 8 kg at 8 s"
    hands = stances_of(lifted(), np.array([2.0, 8.0])).middle.hands[:, 2]
    assert (v, d) == (pytest.approx(hands[0]), pytest.approx(hands[1] - hands[0])) and a < 0.01


def test_forearms_bent_forward_bring_the_hands_forward_and_up_by_their_length() -> None:
    bent = person({f"{side}_el_flex": 90.0 for side in ("right", "left")})
    down, up = (stances_of(who, np.array([1.0])).middle for who in (person(), bent))
    hand = BODY.segments["right_hand"]
    length = BODY.segments["right_forearm"].length + 0.5 * float(np.linalg.norm(hand.start + hand.end))
    assert_allclose(up.hands[:, 2] - down.hands[:, 2], length, rtol=0.01)
    assert_allclose(up.hands[:, 0] - down.hands[:, 0], length, rtol=0.01)


def test_the_interval_of_a_lift_holds_those_of_postures_with_errors() -> None:
    pick, _ = findings(lifted(3.0), lifts=(LIFT,))
    low, high = (float(pick.values[f"lifting index{end} [1]"] or 0.0) for end in (", better end", ""))
    exact, rng, indices = lifted(), np.random.default_rng(5), []
    for _ in range(200):
        moved = replace(exact, q=exact.q + rng.normal(scale=np.radians(3.0), size=len(JOINTS)))
        indices.append(float(findings(moved, lifts=(LIFT,))[0].values["lifting index [1]"] or 0.0))
    assert low < np.median(indices) < high
    assert 0.9 <= np.mean((np.array(indices) >= low) & (np.array(indices) <= high)) <= 1.0


def test_a_lift_is_judged_by_its_worse_end() -> None:
    load = 8.0 / float(findings(lifted(), lifts=(LIFT,))[0].values["lifting index [1]"] or 0.0)
    for deviation, outcome in ((0.0, Outcome.WITHIN), (3.0, Outcome.WARNING)):
        pick, _ = findings(lifted(deviation), lifts=(replace(LIFT, load=0.98 * load),))
        assert pick.outcome == outcome


def test_a_lift_whose_frequency_is_not_known_is_not_assessable() -> None:
    pick, _ = findings(lifted(), lifts=(replace(LIFT, per_minute=None),))
    assert pick.outcome == Outcome.NOT_ASSESSABLE and pick.missing == ("lifts per minute",)


@pytest.mark.parametrize(
    ("joint", "words"), [("right_el_flex", "the angles of trunk or arms"), ("left_knee_flex", "the angles of the legs")]
)
def test_a_lift_with_a_joint_that_is_not_known_is_not_assessable(joint: str, words: str) -> None:
    who = lifted()
    q = who.q.copy()
    q[:, JOINTS.index(joint)] = np.nan
    for finding in findings(replace(who, q=q), lifts=(LIFT,)):
        assert finding.outcome == Outcome.NOT_ASSESSABLE and words in finding.reason


@pytest.mark.parametrize("about", [{"deviation": np.full((len(TIME), len(JOINTS)), np.nan)}, {"uncertainty": np.inf}])
def test_a_lift_of_unknown_uncertainty_is_not_an_exact_one(about: dict[str, object]) -> None:
    who = replace(lifted(), **{"deviation": None, **about})  # type: ignore[arg-type]
    for finding in findings(who, lifts=(LIFT,)):
        assert finding.outcome == Outcome.NOT_ASSESSABLE
        assert finding.reason == "the uncertainty of the joint angles is not known"


@pytest.mark.parametrize("part", ["joints", "root"])
def test_a_lift_in_a_gap_of_the_recording_is_not_assessable(part: str) -> None:
    who, seen = lifted(), np.abs(TIME - 8.0) > 1.0
    moving = RootRecord(TIME, np.tile(who.root.pose, (len(TIME), 1)))
    lost = RootRecord(TIME[seen], moving.pose[seen])
    if part == "joints":
        who = replace(who, time=TIME[seen], q=who.q[seen], deviation=who.deviation[seen])
    else:
        who = replace(who, root=lost, attitude=lost)
    for finding in findings(who, lifts=(LIFT,)):
        assert finding.outcome == Outcome.NOT_ASSESSABLE and "is not known at 8 s" in finding.reason


def test_a_lift_outside_the_recording_is_not_assessable() -> None:
    (pick, _) = findings(lifted(), lifts=(replace(LIFT, end=50.0),))
    assert pick.outcome == Outcome.NOT_ASSESSABLE and "the motion of the person is not known at 50 s" in pick.reason


# work file


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "lifts: [{begin: 2, end: 1, load: 5}]",
            r"work.yaml: lifts\[0\].end is 1.0; valid: a number above begin \(2\)",
        ),
        ("repetitive: [{factors: {pace: fast}}]", "fast.*; valid: free, machine, partly"),
        ("lifts: [{begin: 1, end: 2, load: 5, coupling: firm}]", "firm.*valid: fair, good, poor"),
        ("pushes: [{action: shove, begin: 1, end: 2}]", "shove'; valid: push, pull"),
        ("lift: []", "lift.*valid: lifts, pushes, repetitive"),
    ],
)
def test_a_mistake_in_a_work_file_is_refused_with_the_valid_words(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "work.yaml"
    path.write_text(text)
    with pytest.raises(HricError, match=words):
        load(path)
