"""Findings of postures: what makes a score count, what is not known, and what is uncertain."""

import math
import re
from dataclasses import replace
from pathlib import Path

import ezc3d
import numpy as np
import pytest
from bodies import Posed, body

from hric_assessment.ergonomics.posture import of_joints
from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import assess, opened
from hric_assessment.verdict.person import AssessedPerson, people_of
from hric_assessment.verdict.posture_input import spread_of
from hric_assessment.verdict.postures import posture_finding, scored
from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_bags.records.root_record import RootRecord
from hric_core.geometry import FloatArray, Pose, from_rotation_vector

WHOLE, UPPER = (body(parts=parts) for parts in ("whole_body", "upper_body"))
REST = {"right_el_flex": 80.0, "left_el_flex": 80.0}


def leaning(degrees: float) -> RootRecord:
    """A root link that leans forward."""
    return RootRecord.still(Pose((0.0, 0.0, 0.95), from_rotation_vector((0.0, math.radians(degrees), 0.0))))


def person(
    angles: dict[str, float | FloatArray], seconds: float = 5.0, root: RootRecord | None = None
) -> AssessedPerson:
    """A whole body at 50 Hz, at angles [deg]."""
    time = np.arange(0.0, seconds, 0.02)
    values = {**dict.fromkeys(WHOLE.joints, 0.0), **REST, **angles}
    q = np.radians(np.array([np.broadcast_to(values[name], len(time)) for name in WHOLE.joints]).T)
    return AssessedPerson("simulated human", WHOLE, tuple(WHOLE.joints), time, q, root, root, ())


def findings(
    person: AssessedPerson, seconds: float | None = None, version: str = "current", record: HumanRecord | None = None
) -> dict[str, Finding]:
    """Findings of a recording of so many seconds, by "RULA right"."""
    window = (0.0, float(person.time[-1]) if seconds is None else seconds)
    made = [posture_finding(one, person) for one in scored(person, record, window, {"rula": version})]
    return {one.subject.replace(" of the", "").replace(" arm", ""): one for one in made}


def counts(finding: Finding) -> float | None:
    return finding.values["score that counts"]


# Against gravity.


def test_hips_and_spine_that_are_bent_alike_score_alike() -> None:
    hips = findings(person({"trunk_flex": 5.0}, root=leaning(65.0)))
    spine = findings(person({"trunk_flex": 70.0}, root=leaning(0.0)))
    for subject, finding in hips.items():
        assert "trunk +4: trunk flexion above 60 deg (70.0 deg)" in finding.notes[0]
        assert (finding.values, finding.outcome) == (spine[subject].values, spine[subject].outcome)


def test_a_spine_that_makes_up_for_a_leaning_pelvis_is_upright() -> None:
    assert counts(findings(person({"trunk_flex": 20.0}, root=leaning(-20.0)))["RULA right"]) == 1.0


def test_an_upright_person_is_within_limits() -> None:
    assert {one.outcome for one in findings(person({}, root=leaning(0.0))).values()} == {Outcome.WITHIN}


def test_a_trunk_of_unknown_inclination_is_never_upright() -> None:
    finding = findings(person({}))["RULA right"]
    assert (counts(finding), finding.outcome) == (1.0, Outcome.WARNING)  # with the trunk at its worst, too
    assert "it can be up to 5: inclination of the trunk not known" in finding.reason
    assert finding.remedy.startswith("record the pose of the body's root link")
    assert finding.missing == ("inclination of the trunk",)


def test_a_trunk_is_known_where_its_root_is() -> None:
    root = leaning(0.0)
    known = replace(root, time=np.arange(0.0, 2.0, 0.02), pose=np.tile(root.pose, (100, 1)), fixed=False)
    finding = findings(person({}, root=known))["RULA right"]
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert finding.evidence is not None and finding.evidence.known == pytest.approx(1.98)


def test_what_is_above_limits_is_above_whatever_is_not_known() -> None:
    bad = {"neck_flex": 30.0, "neck_bend": 20.0, "neck_rot": 30.0, "trunk_flex": 70.0, "trunk_bend": 20.0}
    finding = findings(person(bad | {"right_sh_flex": 100.0, "right_sh_abd": 30.0}), seconds=60.0)["RULA right"]
    assert (counts(finding), finding.outcome, finding.remedy) == (7.0, Outcome.ABOVE, "")


# Evidence.


def test_a_person_known_for_three_of_thirty_seconds_is_not_assessable() -> None:
    for finding in findings(person({}, seconds=3.0, root=leaning(0.0)), seconds=30.0).values():
        assert finding.outcome == Outcome.NOT_ASSESSABLE
        assert "known for 2.98 of 30.00 s, longest gap 27.02 s" in finding.reason
        assert "record the joint states without gaps" in finding.remedy


@pytest.mark.parametrize(("lost", "outcome"), [(0.8, Outcome.WITHIN), (1.2, Outcome.NOT_ASSESSABLE)])
def test_a_gap_counts_from_the_time_on_for_which_a_score_has_to_last(lost: float, outcome: Outcome) -> None:
    whole = person({}, seconds=20.0, root=leaning(0.0))
    q = whole.q.copy()
    q[(whole.time > 5.0) & (whole.time < 5.0 + lost), whole.names.index("neck_flex")] = np.nan
    assert findings(replace(whole, q=q))["RULA right"].outcome == outcome


def test_a_score_that_is_within_limits_at_its_worst_needs_no_more() -> None:
    """REBA of an upright person: 1; knees bent by more than 60 deg make table A 3, and table C of 3 and 1 is 2."""
    whole = person({}, root=leaning(0.0))
    rows = [k for k, name in enumerate(whole.names) if "knee" not in name]
    finding = findings(replace(whole, names=tuple(whole.names[k] for k in rows), q=whole.q[:, rows]))["REBA right"]
    assert finding.values["score that counts, unknown at its worst"] == 2.0
    assert (finding.outcome, finding.missing) == (Outcome.WITHIN, ("the angle knee_flexion",))


def test_of_a_recording_shorter_than_a_second_the_highest_score_counts() -> None:
    arm = np.where(np.arange(40) < 5, 100.0, 0.0)
    assert counts(findings(person({"right_sh_flex": arm}, seconds=0.8, root=leaning(0.0)))["RULA right"]) == 3.0


# Static and repeated use.


@pytest.mark.parametrize(("recorded", "lasts"), [(0.6, 0.9), (0.02, 0.0)], ids=["a third is lost", "one instant"])
def test_a_recording_shorter_than_a_second_is_within_limits_only_if_all_of_it_is_known(
    recorded: float, lasts: float
) -> None:
    found = findings(person({}, recorded, leaning(0.0)), lasts)
    assert {one.outcome for one in found.values()} == {Outcome.NOT_ASSESSABLE}


@pytest.mark.parametrize(
    ("lost", "outcomes"),
    [
        (("right_el_flex",), {Outcome.WARNING}),
        (("right_sh_", "right_el_", "right_pro_", "right_wr_"), {Outcome.NOT_ASSESSABLE}),
    ],
    ids=["without its elbow", "not at all"],
)
def test_an_arm_that_is_not_completely_recorded_is_assessed_nevertheless(
    lost: tuple[str, ...], outcomes: set[Outcome]
) -> None:
    whole = person({"right_sh_flex": 170.0}, root=leaning(0.0))
    rows = [k for k, name in enumerate(whole.names) if not name.startswith(lost)]
    found = findings(replace(whole, names=tuple(whole.names[k] for k in rows), q=whole.q[:, rows]))
    assert {found["RULA right"].outcome} == outcomes


@pytest.mark.parametrize(("uncertainty", "outcome"), [(0.0, Outcome.WITHIN), (math.inf, Outcome.NOT_ASSESSABLE)])
def test_angles_of_unknown_uncertainty_are_never_within_limits(uncertainty: float, outcome: Outcome) -> None:
    finding = findings(replace(person({}, root=leaning(0.0)), uncertainty=uncertainty))["RULA right"]
    assert finding.outcome == outcome
    assert ("the uncertainty of the angles is not known" in finding.reason) == (outcome == Outcome.NOT_ASSESSABLE)


def test_a_posture_held_for_two_minutes_scores_one_more_for_muscle_use() -> None:
    held = {"right_sh_flex": 30.0, "left_sh_flex": 30.0, "neck_flex": 15.0}
    short, long = (findings(person(held, seconds, leaning(0.0)))["RULA right"] for seconds in (50.0, 120.0))
    assert (counts(short), short.outcome) == (2.0, Outcome.WITHIN)
    assert (counts(long), long.outcome) == (3.0, Outcome.WARNING)
    assert "this recording of 50.0 s is too short to judge it" in " ".join(short.notes)
    assert "not judged" not in " ".join(long.notes)


def test_an_arm_that_moves_over_a_bent_back_has_no_static_use_and_the_back_has() -> None:
    time = np.arange(0.0, 120.0, 0.02)
    moving = 20.0 + 15.0 * np.cos(2.0 * np.pi * time / 40.0)
    note = findings(person({"right_sh_flex": moving, "trunk_flex": 40.0}, 120.0, leaning(0.0)))["RULA right"].notes[0]
    assert "muscle use, neck and trunk +1" in note and "muscle use +1" not in note


def test_an_arm_that_moves_six_times_a_minute_is_used_repeatedly() -> None:
    time = np.arange(0.0, 120.0, 0.02)
    often, seldom = (
        findings(person({"right_sh_flex": 10.0 + 10.0 * np.cos(2.0 * np.pi * time / period)}, 120.0, leaning(0.0)))
        for period in (10.0, 30.0)
    )
    assert "muscle use +1" in often["RULA right"].notes[0]
    assert "muscle use +1" not in seldom["RULA right"].notes[0]


def gripping(person: AssessedPerson, force: FloatArray) -> HumanRecord:
    """A record of the right hand that holds a box with a force downwards, shape (n,) [N]."""
    vectors, none = np.outer(force, [0.0, 0.0, -1.0]), np.empty((0, 0))
    names = ("hand", "box::link", f"human::{WHOLE.segments['right_hand'].link}")
    closed = np.ones(len(force), np.bool_)
    grip = GripRecord(*names, person.time, closed, vectors, 0.0 * vectors, 0.0 * vectors, 0.0 * force)
    return HumanRecord(person.names, person.time, person.q, np.empty(0), none, none, {}, {"hand": grip})


def test_a_load_held_for_more_than_a_minute_is_static() -> None:
    still = person({}, 120.0, leaning(0.0))
    record = gripping(still, np.full(len(still.time), 5.0 * 9.81))
    notes = [findings(still, record=record)[f"RULA {side}"].notes[0] for side in ("right", "left")]
    assert "load +2: static or repeated load of 2 to 10 kg" in notes[0]
    assert "load" not in notes[1].partition("at its first instant")[2]


def test_a_load_that_is_not_a_number_for_two_seconds_is_not_known_to_be_light() -> None:
    upright = person({}, 10.0, leaning(0.0))
    lost = (upright.time > 3.0) & (upright.time < 5.0)
    found = findings(upright, record=gripping(upright, np.where(lost, np.nan, 1.0)))
    assert found["RULA right"].outcome == Outcome.NOT_ASSESSABLE
    assert found["RULA left"].outcome == Outcome.WITHIN


# The older table.


def test_the_older_table_a_is_used_where_it_is_chosen() -> None:
    """Upper arm 2, lower arm 2, wrist 1, twist 1: table A 3, and 2 on the older worksheet."""
    arm = person({"right_sh_flex": 30.0, "right_el_flex": 110.0}, root=leaning(0.0))
    current, older = (findings(arm, version=version)["RULA right"] for version in ("current", "older"))
    assert "table A older" in older.table and "table A current" in current.table
    assert (counts(current), counts(older)) == (3.0, 2.0)


# Markers.


def c3d(folder: Path, angles: dict[str, float], noise: float, lean: float = 0.0, seconds: float = 4.0) -> Path:
    """A file with the markers of an upper body at 100 Hz; noise: standard deviation of each coordinate [m]."""
    posed, n = Posed(UPPER, **REST, **angles), round(100.0 * seconds)
    turn = np.array(leaning(lean).transforms(np.zeros(1))[0, :3, :3])
    places = np.array([turn @ posed.point(one.link, one.p_link_marker) for one in UPPER.markers.values()])
    random = np.random.default_rng(0)
    points = np.ones((4, len(places), n))
    points[:3] = 1e3 * (
        places.T[:, :, None] + [[[0.0]], [[0.0]], [[0.95]]] + noise * random.normal(size=(3, len(places), n))
    )
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["LABELS"]["value"] = list(UPPER.markers)
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["data"]["points"] = points
    file.write(str(folder / "trial.c3d"))
    return folder / "trial.c3d"


def of_markers(folder: Path, angles: dict[str, float], noise: float, lean: float = 0.0) -> Finding:
    verdict = assess(opened(str(c3d(folder, angles, noise, lean))))
    return next(one for one in verdict.findings if one.subject == "RULA of the right arm")


def test_exact_markers_leave_the_band_of_their_unknown_places(tmp_path: Path) -> None:
    finding = of_markers(tmp_path, {}, 0.0)
    assert finding.values["score that counts, better end"] == 1.0
    assert re.search(r"decided by wrist \+2: wrist flexion -15 to -5 deg \(\S+ \+- \S+ deg\)", finding.reason)
    assert finding.outcome == Outcome.WARNING


def test_a_verdict_of_markers_shows_what_was_assumed(tmp_path: Path) -> None:
    verdict = assess(opened(str(c3d(tmp_path, {}, 0.0))))
    assert any("of P50_male, as no option and no file states it" in note for note in verdict.input.notes)
    assert f"note: {verdict.input.notes[0]}\n" in verdict.render()


def test_five_millimetres_of_noise_give_an_upright_person_a_band_that_names_the_angle(tmp_path: Path) -> None:
    finding = of_markers(tmp_path, {}, 5e-3)
    assert finding.reason.startswith("score 1 to 5: investigate and change soon, decided by ")
    assert "neck +4: neck flexion below 0 deg" in finding.reason
    assert (finding.values["score that counts, better end"], counts(finding)) == (1.0, 5.0)
    assert finding.outcome == Outcome.WARNING


def test_noise_far_from_all_thresholds_gives_one_score(tmp_path: Path) -> None:
    finding = of_markers(tmp_path, {"neck_flex": 5.0, "trunk_flex": 12.0}, 5e-4)
    assert finding.values["score that counts, better end"] == counts(finding)


def test_markers_of_a_person_bent_at_the_hips_show_a_bent_trunk(tmp_path: Path) -> None:
    finding = of_markers(tmp_path, {"trunk_flex": 5.0}, 0.0, lean=65.0)
    assert "trunk +4: trunk flexion above 60 deg (70.0 +- " in finding.notes[0]


@pytest.mark.parametrize("joint", ["neck_flex", "trunk_flex", "right_sh_abd", "right_wr_flex"])
def test_an_interval_for_all_frames_holds_three_deviations_and_not_five(tmp_path: Path, joint: str) -> None:
    (measured,) = people_of(opened(str(c3d(tmp_path, {"neck_flex": 5.0}, 5e-3))))
    assert measured is not None
    tracked = replace(measured, deviation=None)
    angle = {"neck_flex": "neck_flexion", "trunk_flex": "trunk_flexion", "right_wr_flex": "wrist_flexion"}.get(joint)
    deviation = np.degrees(np.std(tracked.q[:, tracked.names.index(joint)]))
    width = math.degrees(spread_of(tracked, "right")[angle or "upper_arm_flexion"])
    assert 3.0 * deviation - 0.5 <= width <= 5.0 * deviation + 0.5


def test_intervals_of_markers_hold_the_true_angles(tmp_path: Path) -> None:
    """All angles together: the error of a marker's place is the same in all frames of a trial."""
    (tracked,) = people_of(opened(str(c3d(tmp_path, {"neck_flex": 5.0}, 5e-3))))
    truth = {"neck_flexion": 5.0, "trunk_flexion": 0.0, "elbow_flexion": 80.0, "wrist_flexion": 0.0}
    posture, width = of_joints(tracked.names, tracked.q, "right"), spread_of(tracked, "right")
    errors = {name: np.degrees(np.asarray(getattr(posture, name))) - angle for name, angle in truth.items()}
    held = [np.abs(error) <= np.degrees(width[name]) for name, error in errors.items()]
    print(f"held: {[round(float(one.mean()), 3) for one in held]}")
    assert np.mean(held) >= 0.9


def test_an_arm_is_as_uncertain_as_the_joint_that_raises_it() -> None:
    """A forward arm is raised by sh_flex, an arm to the side by sh_abd; the other joint moves it along a circle."""
    posed = person({"right_sh_flex": np.where(np.arange(250) < 125, 60.0, 0.0), "right_sh_abd": 0.0})
    q, deviation = posed.q.copy(), np.zeros_like(posed.q)
    q[125:, posed.names.index("right_sh_abd")] = math.radians(60.0)
    deviation[:, posed.names.index("right_sh_abd")] = math.radians(5.0)
    width = np.degrees(spread_of(replace(posed, q=q, deviation=deviation), "right")["upper_arm_flexion"])
    assert width[0] <= 1.0 and width[-1] == pytest.approx(10.0)  # whole degrees, rounded up


def test_an_arm_between_behind_and_aside_is_no_more_uncertain() -> None:
    posed = person({"right_sh_flex": -10.0, "right_sh_abd": 10.0})
    deviation = np.zeros_like(posed.q)
    deviation[:, posed.names.index("right_sh_abd")] = math.radians(1.0)
    assert np.degrees(spread_of(replace(posed, deviation=deviation), "right")["upper_arm_flexion"]).max() <= 2.0


def test_a_score_is_uncertain_only_at_uncertain_instants() -> None:
    posed = person({"trunk_flex": 18.0}, root=leaning(0.0))
    deviation = np.zeros_like(posed.q)
    deviation[:100, posed.names.index("trunk_flex")] = math.radians(5.0)
    arm = next(scored(replace(posed, deviation=deviation), None, (0.0, 5.0)))
    differs = arm.scores.highest > arm.scores.lowest
    assert differs[:100].all() and not differs[100:].any()
    finding = posture_finding(arm, posed)
    assert re.search(r"score \d to \d: .*trunk flexion 20 to 60 deg \(18.0 \+- 10.0 deg\)", finding.reason)
