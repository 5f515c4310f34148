"""RULA and REBA of postures: each threshold, each cell through a posture, an independent scorer, and public errors."""

import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from bodies import Posed, body
from posture_by_hand import reba_by_hand, rula_by_hand
from scipy.spatial.transform import Rotation

from hric_assessment.ergonomics import Posture, Task, of_joints, rula
from hric_assessment.ergonomics import reba as reba_method
from hric_assessment.ergonomics.posture import ANGLES, to_vertical
from hric_assessment.ergonomics.scoring import Scores
from hric_assessment.tables import PostureTable, reba_table, rula_table
from hric_core.errors import HricError

Score = Callable[..., Scores]
STEP = 0.01
"""Step between the tested angles [deg]."""
METHODS = {"rula": rula.score, "reba": reba_method.score}
THRESHOLDS = [
    # method, part, angle, threshold [deg], score of the part one step below, on and one step above it
    ("rula", "upper_arm", "upper_arm_flexion", -20, (2, 1, 1)),
    ("rula", "upper_arm", "upper_arm_flexion", 20, (1, 1, 2)),
    ("rula", "upper_arm", "upper_arm_flexion", 45, (2, 2, 3)),
    ("rula", "upper_arm", "upper_arm_flexion", 90, (3, 3, 4)),
    ("rula", "upper_arm", "shoulder_elevation", 10, (1, 1, 2)),
    ("rula", "upper_arm", "upper_arm_abduction", 20, (1, 1, 2)),
    ("rula", "lower_arm", "elbow_flexion", 60, (2, 1, 1)),
    ("rula", "lower_arm", "elbow_flexion", 100, (1, 1, 2)),
    ("rula", "lower_arm", "forearm_inward", 30, (1, 1, 2)),
    ("rula", "lower_arm", "forearm_inward", -30, (2, 1, 1)),
    ("rula", "wrist", "wrist_flexion", -15, (3, 2, 2)),
    ("rula", "wrist", "wrist_flexion", -5, (2, 1, 1)),
    ("rula", "wrist", "wrist_flexion", 5, (1, 1, 2)),
    ("rula", "wrist", "wrist_flexion", 15, (2, 2, 3)),
    ("rula", "wrist", "wrist_deviation", 10, (1, 1, 2)),
    ("rula", "wrist", "wrist_deviation", -10, (2, 1, 1)),
    ("rula", "wrist_twist", "pronation", 60, (1, 1, 2)),
    ("rula", "wrist_twist", "pronation", -60, (2, 1, 1)),
    ("rula", "neck", "neck_flexion", 0, (4, 1, 1)),
    ("rula", "neck", "neck_flexion", 10, (1, 1, 2)),
    ("rula", "neck", "neck_flexion", 20, (2, 2, 3)),
    ("rula", "neck", "neck_twist", 10, (1, 1, 2)),
    ("rula", "neck", "neck_twist", -10, (2, 1, 1)),
    ("rula", "neck", "neck_bend", 10, (1, 1, 2)),
    ("rula", "neck", "neck_bend", -10, (2, 1, 1)),
    ("rula", "trunk", "trunk_flexion", -60, (4, 3, 3)),
    ("rula", "trunk", "trunk_flexion", -20, (3, 2, 2)),
    ("rula", "trunk", "trunk_flexion", -5, (2, 1, 1)),
    ("rula", "trunk", "trunk_flexion", 5, (1, 1, 2)),
    ("rula", "trunk", "trunk_flexion", 20, (2, 2, 3)),
    ("rula", "trunk", "trunk_flexion", 60, (3, 3, 4)),
    ("rula", "trunk", "trunk_twist", 10, (1, 1, 2)),
    ("rula", "trunk", "trunk_twist", -10, (2, 1, 1)),
    ("rula", "trunk", "trunk_bend", 10, (1, 1, 2)),
    ("rula", "trunk", "trunk_bend", -10, (2, 1, 1)),
    ("reba", "neck", "neck_flexion", 0, (2, 1, 1)),
    ("reba", "neck", "neck_flexion", 20, (1, 1, 2)),
    ("reba", "neck", "neck_twist", 10, (1, 1, 2)),
    ("reba", "neck", "neck_bend", -10, (2, 1, 1)),
    ("reba", "trunk", "trunk_flexion", -20, (3, 2, 2)),
    ("reba", "trunk", "trunk_flexion", -5, (2, 1, 1)),
    ("reba", "trunk", "trunk_flexion", 5, (1, 1, 2)),
    ("reba", "trunk", "trunk_flexion", 20, (2, 2, 3)),
    ("reba", "trunk", "trunk_flexion", 60, (3, 3, 4)),
    ("reba", "trunk", "trunk_twist", -10, (2, 1, 1)),
    ("reba", "trunk", "trunk_bend", 10, (1, 1, 2)),
    ("reba", "legs", "knee_flexion", 30, (1, 2, 2)),
    ("reba", "legs", "knee_flexion", 60, (2, 2, 3)),
    ("reba", "upper_arm", "upper_arm_flexion", -20, (2, 1, 1)),
    ("reba", "upper_arm", "upper_arm_flexion", 20, (1, 1, 2)),
    ("reba", "upper_arm", "upper_arm_flexion", 45, (2, 2, 3)),
    ("reba", "upper_arm", "upper_arm_flexion", 90, (3, 3, 4)),
    ("reba", "upper_arm", "upper_arm_abduction", 20, (1, 1, 2)),
    ("reba", "upper_arm", "upper_arm_rotation", 30, (1, 1, 2)),
    ("reba", "upper_arm", "upper_arm_rotation", -30, (2, 1, 1)),
    ("reba", "upper_arm", "shoulder_elevation", 10, (1, 1, 2)),
    ("reba", "lower_arm", "elbow_flexion", 60, (2, 1, 1)),
    ("reba", "lower_arm", "elbow_flexion", 100, (1, 1, 2)),
    ("reba", "wrist", "wrist_flexion", -15, (2, 1, 1)),
    ("reba", "wrist", "wrist_flexion", 15, (1, 1, 2)),
    ("reba", "wrist", "wrist_deviation", -10, (2, 1, 1)),
    ("reba", "wrist", "pronation", 60, (1, 1, 2)),
]


@pytest.mark.parametrize(("method", "part", "angle", "threshold", "expected"), THRESHOLDS)
def test_a_posture_one_step_below_on_and_above_a_threshold(
    method: str, part: str, angle: str, threshold: float, expected: tuple[int, int, int]
) -> None:
    degrees = np.array([threshold - STEP, threshold, threshold + STEP])
    found = METHODS[method](Posture(**{angle: np.radians(degrees)})).parts[part]
    assert tuple(found) == expected


LOADS = [
    ("rula", {}, 2.0, (0, 1, 1)),
    ("rula", {}, 10.0, (1, 1, 2)),
    ("rula", {"static": True}, 2.0, (0, 2, 2)),
    ("rula", {"static": True}, 10.0, (2, 2, 3)),
    ("rula", {"shock": True}, 10.0, (3, 3, 3)),
    ("reba", {}, 5.0, (0, 1, 1)),
    ("reba", {}, 10.0, (1, 1, 2)),
    ("reba", {"shock": True}, 10.0, (2, 2, 3)),
]


@pytest.mark.parametrize(("method", "how", "threshold", "expected"), LOADS)
def test_a_load_one_step_below_on_and_above_a_threshold(
    method: str, how: dict[str, bool], threshold: float, expected: tuple[int, int, int]
) -> None:
    found = METHODS[method](Posture(), Task(load=threshold + STEP * np.array([-1.0, 0.0, 1.0]), **how))
    assert tuple(sum(step.points for step in found.steps if step.part == "load")) == expected


@pytest.mark.parametrize(
    ("method", "part", "field", "threshold", "expected"),
    [
        ("rula", "muscle use", "held", 60.0, (0, 0, 1)),
        ("rula", "muscle use", "repeats", 4.0, (0, 1, 1)),
        ("reba", "activity", "held", 60.0, (0, 0, 1)),
        ("reba", "activity", "repeats", 4.0, (0, 0, 1)),
    ],
)
def test_muscle_use_and_activity_one_step_below_on_and_above_a_threshold(
    method: str, part: str, field: str, threshold: float, expected: tuple[int, int, int]
) -> None:
    found = METHODS[method](Posture(), Task(**{field: threshold + STEP * np.array([-1.0, 0.0, 1.0])}))
    assert tuple(sum(step.points for step in found.steps if step.part == part)) == expected


@pytest.mark.parametrize(
    ("method", "part", "posture", "expected"),
    [
        ("rula", "upper_arm", {"upper_arm_flexion": 1.0, "arm_supported": True}, 2),
        ("rula", "upper_arm", {"arm_supported": True}, 1),
        ("rula", "trunk", {"trunk_flexion": 1.2, "trunk_supported": True}, 1),
        ("rula", "legs", {"unbalanced": True}, 2),
        ("reba", "legs", {"knee_flexion": 1.5, "sitting": True}, 1),
        ("reba", "legs", {"knee_flexion": 1.5, "unbalanced": True}, 4),
        ("reba", "neck", {"neck_twist": 1.0, "neck_bend": 1.0}, 2),
        ("reba", "wrist", {"wrist_deviation": 1.0, "pronation": 1.3}, 2),
    ],
)
def test_support_balance_and_conditions_that_count_once(
    method: str, part: str, posture: dict[str, Any], expected: int
) -> None:
    assert METHODS[method](Posture(**posture)).parts[part] == expected


# The scorer that is compared with: one posture at a time, by the words of the worksheets and the noted tables.


COUNT = 4000


@pytest.fixture(scope="module")
def streamed() -> dict[str, np.ndarray]:
    """A motion through all ranges, whole degrees so that thresholds are met, with changing tasks."""
    random = np.random.default_rng(18)
    ranges = {"elbow_flexion": (0, 150), "knee_flexion": (0, 120), "upper_arm_flexion": (-60, 150)}
    found = {name: random.integers(*ranges.get(name, (-90, 91)), COUNT).astype(float) for name in ANGLES}
    for name in ("neck_twist", "neck_bend", "trunk_twist", "trunk_bend", "wrist_deviation", "wrist_flexion"):
        found[name] = random.integers(-20, 21, COUNT).astype(float)
    found |= {name: random.integers(0, 2, COUNT).astype(bool) for name in FLAGS}
    found |= {"load": random.integers(0, 13, COUNT).astype(float), "held": random.integers(58, 63, COUNT).astype(float)}
    return found | {"repeats": random.integers(2, 7, COUNT).astype(float)}


FLAGS = ("arm_supported", "trunk_supported", "unbalanced", "sitting", "static", "shock", "rapid")


def given(streamed: dict[str, np.ndarray]) -> tuple[Posture, Task]:
    values = {name: np.radians(value) if name in ANGLES else value for name, value in streamed.items()}
    posture = {field.name: values[field.name] for field in fields(Posture)}
    return Posture(**posture), Task(**{name: value for name, value in values.items() if name not in posture})


@pytest.mark.parametrize("version", rula.VERSIONS)
def test_rula_of_a_streamed_motion_is_that_of_another_scorer_at_every_sample(
    streamed: dict[str, np.ndarray], version: str
) -> None:
    found = rula.score(*given(streamed), version)
    expected = [rula_by_hand({k: v[i].item() for k, v in streamed.items()}, version == "older") for i in range(COUNT)]
    assert found.score.tolist() == expected
    assert set(expected) >= set(range(3, 8))


def test_reba_of_a_streamed_motion_is_that_of_another_scorer_at_every_sample(streamed: dict[str, np.ndarray]) -> None:
    posture, task = given(streamed)
    found = reba_method.score(posture, Task(**{**vars(task), "coupling": "fair"}))
    expected = [reba_by_hand({k: v[i].item() for k, v in streamed.items()}) for i in range(COUNT)]
    assert found.score.tolist() == expected
    assert set(expected) >= set(range(4, 16))


@pytest.mark.parametrize(("method", "sizes"), [("rula", (144, 72)), ("reba", (60, 36))])
def test_every_cell_of_tables_a_and_b_is_reached_by_a_posture(
    streamed: dict[str, np.ndarray], method: str, sizes: tuple[int, int]
) -> None:
    names = {
        "rula": (("upper_arm", "lower_arm", "wrist", "wrist_twist"), ("neck", "trunk", "legs")),
        "reba": (("neck", "trunk", "legs"), ("upper_arm", "lower_arm", "wrist")),
    }[method]
    parts = METHODS[method](*given({**streamed, **rare()})).parts
    for chosen, size in zip(names, sizes, strict=True):
        assert len(set(zip(*(parts[name].tolist() for name in chosen), strict=True))) == size


def rare() -> dict[str, np.ndarray]:
    """Angles for which the rare scores are as frequent as the others."""
    random = np.random.default_rng(19)
    chosen = {
        "upper_arm_flexion": (0, 30, 60, 100),
        "neck_flexion": (-5, 5, 15, 30),
        "trunk_flexion": (0, 10, 40, 70),
        "wrist_flexion": (0, 10, 20),
        "knee_flexion": (0, 40, 70),
        "elbow_flexion": (80, 120),
        "shoulder_elevation": (0, 20),
        "upper_arm_abduction": (0, 30),
    }
    flags = {"arm_supported": np.zeros(COUNT, bool), "trunk_supported": np.zeros(COUNT, bool)}
    return {name: random.choice(np.array(values, float), COUNT) for name, values in chosen.items()} | flags


@pytest.mark.parametrize(
    ("cell", "expected"),
    [((2, 2, 2, 1), 3), ((6, 3, 4, 2), 9)],
)
def test_rula_table_a_has_the_cells_of_public_test_suites(cell: tuple[int, ...], expected: int) -> None:
    upper, lower, wrist, twist = cell
    assert rula.table_a(rula.rula_table(), "current")[f"{upper},{lower}"][2 * (wrist - 1) + twist - 1] == expected


def test_reba_of_a_published_example_is_4() -> None:
    posture = Posture(
        neck_flexion=math.radians(30),
        trunk_flexion=math.radians(10),
        unbalanced=True,
        upper_arm_flexion=0.0,
        elbow_flexion=math.radians(30),
        wrist_flexion=math.radians(20),
        wrist_deviation=np.radians([0.0, 15.0]),
    )
    found = reba_method.score(posture)
    assert found.parts["wrist"].tolist() == [2, 3]
    assert (found.parts["table_a"][1], found.parts["table_b"].tolist()) == (4, [2, 3])
    assert found.score.tolist() == [4, 4]


# Public implementations have these errors.


def test_a_neck_bent_by_up_to_10_deg_scores_1_in_rula() -> None:
    assert rula.score(Posture(neck_flexion=np.radians([0.0, 5.0, 10.0]))).parts["neck"].tolist() == [1, 1, 1]


def test_flexion_alone_gives_an_upper_arm_no_more_than_4() -> None:
    angles = np.radians(np.arange(-180.0, 181.0))
    assert all(method(Posture(upper_arm_flexion=angles)).parts["upper_arm"].max() == 4 for method in METHODS.values())


def test_the_last_cells_of_reba_a_are_7_8_9_9() -> None:
    knees = np.radians([0.0, 40.0, 70.0, 70.0])
    posture = Posture(
        neck_flexion=0.5, neck_twist=0.5, trunk_flexion=1.2, trunk_bend=0.5, knee_flexion=knees,
        unbalanced=np.array([False, False, False, True]),
    )  # fmt: skip
    assert reba_method.score(posture).parts["table_a"].tolist() == [7, 8, 9, 9]


# What is not known, what was chosen, and how it is said.


def test_what_is_not_known_is_said_and_scores_least() -> None:
    found = rula.score(Posture(upper_arm_flexion=1.0))
    assert "neck_flexion is not known: assumed 0 deg" in found.assumptions
    assert "elbow_flexion is not known: assumed 80 deg" in found.assumptions
    assert not any(line.startswith("upper_arm_flexion") for line in found.assumptions)
    random = np.random.default_rng(3)
    known = Posture(upper_arm_flexion=1.0, **{name: random.uniform(-1.5, 1.5, 500) for name in ANGLES[1:]})
    assert rula.score(known).score.min() >= found.score[0]


def test_a_sample_that_is_not_known_is_said_and_does_not_score_as_extension() -> None:
    found = rula.score(Posture(neck_flexion=np.array([0.1, math.nan, 0.1])))
    assert found.parts["neck"].tolist() == [1, 1, 1]
    assert "neck_flexion is not known at 1 of 3 instants: assumed 0 deg there" in found.assumptions


def test_a_score_is_given_also_for_chosen_thresholds_5_deg_either_way() -> None:
    posture = Posture(upper_arm_abduction=np.radians([14.0, 16.0, 24.0, 26.0]), upper_arm_flexion=1.0)
    found = rula.score(posture, Task(load=3.0))
    arm = found.score
    assert found.stricter.tolist() == [arm[0], arm[3], arm[3], arm[3]]
    assert found.looser.tolist() == [arm[0], arm[0], arm[0], arm[3]]
    assert arm[0] < arm[3]
    assert "abducted: 20 deg, chosen here: abduction beyond which an upper arm is abducted" in found.chosen
    assert found.chosen[-1] == "changing them by 5 deg either way changes 2 of 4 scores"


def test_thresholds_that_a_source_has_are_not_moved() -> None:
    found = rula.score(Posture(upper_arm_flexion=np.radians(np.arange(-60.0, 150.0))))
    assert (found.stricter.tolist(), found.looser.tolist()) == (found.score.tolist(),) * 2


def test_each_step_says_its_reason() -> None:
    found = rula.score(Posture(upper_arm_flexion=math.radians(50), shoulder_elevation=0.3), Task(load=3.0, static=True))
    assert found.reasons(0)[:2] == [
        "upper arm +3: upper arm flexion 45 to 90 deg (50.0 deg)",
        "upper arm +1: shoulder raised (17.2 deg)",
    ]
    assert found.reasons(0)[-1] == "load +2: static or repeated load of 2 to 10 kg"
    assert found.level(0) == "investigate and change soon"


@pytest.mark.parametrize(
    ("table", "levels"),
    [
        (rula_table(), ["acceptable"] * 2 + ["investigate further"] * 2 + ["investigate and change soon"] * 2),
        (reba_table(), ["negligible", *["low"] * 2, *["medium"] * 4, *["high"] * 3, *["very high"] * 5]),
    ],
    ids=["rula", "reba"],
)
def test_each_score_has_its_level(table: PostureTable, levels: list[str]) -> None:
    assert [table.level(score) for score in range(1, len(levels) + 1)] == levels


def test_the_highest_score_of_rula_is_to_be_changed_now() -> None:
    assert rula_table().level(7) == "investigate and change now"


def test_a_band_that_does_not_count_says_why() -> None:
    found = rula.score(Posture(trunk_flexion=1.0, trunk_supported=np.array([False, True])))
    assert "trunk +3: trunk flexion 20 to 60 deg (57.3 deg)" in found.reasons(0)
    assert "trunk +1: trunk supported (57.3 deg)" in found.reasons(1)


def test_fields_of_different_lengths_are_refused_by_name() -> None:
    with pytest.raises(HricError, match=r"elbow_flexion has the shape \(2,\); valid: one value, or \(3,\)"):
        rula.score(Posture(upper_arm_flexion=np.zeros(3), elbow_flexion=np.zeros(2)))


def test_a_field_of_two_dimensions_is_refused_by_name() -> None:
    with pytest.raises(HricError, match=r"elbow_flexion has the shape \(1, 3\); valid: one value, or \(3,\) as others"):
        rula.score(Posture(upper_arm_flexion=0.2, elbow_flexion=np.zeros((1, 3))))


def test_a_coupling_that_is_not_known_is_said_once() -> None:
    found = reba_method.score(Posture(trunk_flexion=0.3), Task(load=6.0), spread={"trunk_flexion": 0.1})
    assert found.assumptions.count("coupling is not known: assumed good") == 1


def test_each_point_of_reba_beyond_the_posture_is_named() -> None:
    task = Task(load=6.0, shock=True, coupling="poor", held=61.0, repeats=5.0, rapid=True)
    reasons = reba_method.score(Posture(trunk_flexion=0.1, neck_flexion=0.1), task).reasons(0)
    assert reasons[-6:] == [
        "load +1: load with a shock",
        "load +1: load of 5 to 10 kg",
        "coupling +2: poor coupling",
        "activity +1: held for more than 60 s",
        "activity +1: more than 4 times a minute",
        "activity +1: rapid large changes or an unstable base",
    ]


@pytest.mark.parametrize(
    ("method", "balance"), [("rula", "legs not balanced or not supported"), ("reba", "standing on one leg or unstable")]
)
def test_a_part_that_begins_with_a_point_says_so_before_what_is_added(method: str, balance: str) -> None:
    reasons = [one for one in METHODS[method](Posture(unbalanced=True)).reasons(0) if one.startswith("legs")]
    assert reasons == ["legs +1: start value", f"legs +1: {balance}"]


def test_a_point_that_one_of_several_angles_gives_is_named_without_an_angle() -> None:
    reasons = reba_method.score(Posture(neck_twist=1.0)).reasons(0)
    assert "neck +1: neck twisted or bent to the side" in reasons


@pytest.mark.parametrize("version", rula.VERSIONS)
def test_rula_says_by_which_table_and_how_that_is_known(version: str) -> None:
    table = rula_table()
    mark = {"current": table.mark, "older": table.older_mark}[version]
    assert table.mark != table.older_mark
    assert rula.score(Posture(), version=version).method.endswith(f", table A {version} ({mark})")


def test_the_best_posture_has_the_first_cells_of_rulas_tables() -> None:
    parts = rula.score(Posture()).parts
    assert (parts["table_a"].tolist(), parts["table_b"].tolist()) == ([1], [1])


def test_each_point_of_rula_beyond_the_posture_is_named() -> None:
    task = Task(load=11.0, shock=False, static=True, held=61.0, rest_held=0.0, repeats=0.0)
    reasons = rula.score(Posture(trunk_flexion=0.0), task).reasons(0)
    assert reasons[-2:] == [
        "load +3: static or repeated load above 10 kg",
        "muscle use +1: held for more than 60 s, or 4 times a minute or more",
    ]
    task = Task(load=1.0, shock=True, held=0.0, rest_held=61.0)
    reasons = rula.score(Posture(trunk_flexion=0.0), task).reasons(0)
    assert reasons[-2:] == [
        "load +3: load with a shock",
        "muscle use, neck and trunk +1: held for more than 60 s, or 4 times a minute or more",
    ]


def test_the_parts_of_a_score_have_its_tables_and_itself() -> None:
    """REBA: table C and the activity are the score; RULA: by table C, which has no part of its own."""
    posture = Posture(trunk_flexion=np.array([0.1, 1.0]), upper_arm_flexion=1.0)
    reba = reba_method.score(posture, Task(load=6.0, rapid=True, held=61.0))
    assert reba.parts["score"].tolist() == reba.score.tolist() == (reba.parts["table_c"] + 2).tolist()
    found = rula.score(posture, Task(load=6.0))
    assert found.parts["score"].tolist() == found.score.tolist()
    assert {"table_a", "table_b"} < set(found.parts)


def test_neck_and_trunk_are_used_as_the_arm_where_nothing_else_is_known() -> None:
    for task in (Task(held=61.0), Task(repeats=4.0), Task(held=61.0, rest_repeats=0.0)):
        points = {step.part: step.points.tolist() for step in rula.score(Posture(), task).steps}
        assert points["muscle use"] == points["muscle use, neck and trunk"] == [1]
    alone = {
        step.part: step.points.tolist() for step in rula.score(Posture(), Task(repeats=4.0, rest_repeats=0.0)).steps
    }
    assert (alone["muscle use"], alone["muscle use, neck and trunk"]) == ([1], [0])


def test_a_posture_of_one_instant_with_a_value_for_each_instant_of_others_counts_at_all_of_them() -> None:
    many = rula.score(Posture(upper_arm_flexion=np.radians([10.0, 50.0, 100.0]), neck_flexion=0.3), Task(load=3.0))
    single = [
        rula.score(Posture(upper_arm_flexion=math.radians(angle), neck_flexion=0.3), Task(load=3.0)).score[0]
        for angle in (10.0, 50.0, 100.0)
    ]
    assert many.score.tolist() == single


def test_what_is_not_known_is_said_with_its_stand_in_and_flags_as_not_so() -> None:
    found = rula.score(
        Posture(upper_arm_flexion=1.0, arm_supported=None), Task(load=None, held=np.array([1.0, math.nan]))
    )
    for line in (
        "arm_supported is not known: assumed false",
        "load is not known: assumed 0",
        "held is not known at 1 of 2 instants: assumed 0 there",
    ):
        assert line in found.assumptions


def test_an_unknown_version_and_coupling_are_refused_with_the_valid_ones() -> None:
    with pytest.raises(HricError, match="no version of RULA's table A 'new'; valid: current, older"):
        rula.score(Posture(), version="new")
    with pytest.raises(HricError, match="no coupling 'great' in REBA; valid: fair, good, poor, unacceptable"):
        reba_method.score(Posture(), Task(coupling="great"))


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_angles_of_a_body_are_those_of_its_links(side: str) -> None:
    angles = {"sh_flex": 40.0, "sh_abd": 25.0, "sh_rot": 35.0, "el_flex": 70.0}
    made = body(parts="upper_body")
    posed = Posed(made, **{f"{side}_{name}": value for name, value in angles.items()})
    names = list(made.joints)
    q = np.radians([[angles.get(name.removeprefix(f"{side}_"), 0.0) if side in name else 0.0 for name in names]])
    found = of_joints(names, q, side)
    link = {"right": "r", "left": "l"}[side]
    arm = posed.point(f"{link}_elbow") - posed.point(f"{link}_shoulder")
    forearm = posed.point(f"{link}_wrist") - posed.point(f"{link}_elbow")
    outward = {"right": -1.0, "left": 1.0}[side]
    assert float(found.upper_arm_flexion[0]) == pytest.approx(math.acos(-arm[2] / np.linalg.norm(arm)))
    assert float(found.upper_arm_abduction[0]) == pytest.approx(math.asin(outward * arm[1] / np.linalg.norm(arm)))
    across = -outward * forearm[1] / np.linalg.norm(forearm)
    assert float(found.forearm_inward[0]) == pytest.approx(math.asin(across))


ARM_JOINTS = ("el_flex", "wr_flex", "wr_dev", "pro_sup", "sh_rot")
ARM_ANGLES = ("elbow_flexion", "wrist_flexion", "wrist_deviation", "pronation", "upper_arm_rotation")


@pytest.mark.parametrize("side", ["right", "left"])
def test_angles_that_are_joints_are_those_of_the_side_and_of_the_middle(side: str) -> None:
    middle = [f"{part}_{way}" for part in ("neck", "trunk") for way in ("flex", "bend", "rot")]
    names = [f"{either}_{joint}" for either in ("left", "right") for joint in ARM_JOINTS] + middle
    q = np.arange(1.0, 2 * len(names) + 1.0).reshape(len(names), 2).T
    found, columns = of_joints(names, q, side), dict(zip(names, q.T.tolist(), strict=True))
    assert [getattr(found, name).tolist() for name in ARM_ANGLES] == [columns[f"{side}_{name}"] for name in ARM_JOINTS]
    ways = {"flex": "flexion", "bend": "bend", "rot": "twist"}
    for name in middle:
        part, way = name.split("_")
        assert getattr(found, f"{part}_{ways[way]}").tolist() == columns[name]
    assert found.upper_arm_flexion is found.upper_arm_abduction is found.forearm_inward is found.knee_flexion is None


@pytest.mark.parametrize("lacks", ["sh_flex", "sh_abd", "sh_rot", "el_flex"])
def test_an_angle_of_several_joints_is_not_known_without_one_of_them(lacks: str) -> None:
    names = [f"right_{joint}" for joint in ("sh_flex", "sh_abd", "sh_rot", "el_flex") if joint != lacks]
    found = of_joints(names, np.full((1, 3), 0.2), "right")
    assert (found.upper_arm_flexion is None) == (found.upper_arm_abduction is None) == (lacks in ("sh_flex", "sh_abd"))
    assert found.forearm_inward is None


def test_an_arm_without_rotation_or_elbow_has_an_elevation_and_no_forearm() -> None:
    found = of_joints(["right_sh_flex", "right_sh_abd"], np.array([[0.2, 0.1]]), "right")
    assert found.upper_arm_flexion is not None and found.forearm_inward is None


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["right_knee_flex"], [0.2, 0.9]),
        (["left_knee_flex"], [0.2, 0.9]),
        (["left_knee_flex", "right_knee_flex"], [0.7, 0.9]),
    ],
)
def test_the_knee_that_is_bent_more_counts(names: list[str], expected: list[float]) -> None:
    q = np.array([[0.2, 0.7], [0.9, 0.1]])[:, : len(names)]
    assert np.asarray(of_joints(names, q, "left").knee_flexion).tolist() == expected


DIRECTIONS = [
    # sh_flex, sh_abd [deg]; elevation [deg]
    (100.0, 0.0, 100.0),
    (0.0, 100.0, 100.0),
    (170.0, 0.0, 170.0),
    (0.0, 170.0, 170.0),
    (-20.0, 95.0, 94.7),
    (-40.0, 0.0, -40.0),
    (-40.0, 10.0, -41.0),
    (-10.0, 40.0, 41.0),
    (0.0, -30.0, 30.0),
]


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(("flexion", "abduction", "elevation"), DIRECTIONS)
def test_an_upper_arm_is_as_high_as_its_direction_whichever_way_it_was_raised(
    side: str, flexion: float, abduction: float, elevation: float
) -> None:
    made = body(parts="upper_body")
    posed = Posed(made, **{f"{side}_sh_flex": flexion, f"{side}_sh_abd": abduction})
    link = {"right": "r", "left": "l"}[side]
    arm = posed.point(f"{link}_elbow") - posed.point(f"{link}_shoulder")
    names = list(made.joints)
    angles = {f"{side}_sh_flex": flexion, f"{side}_sh_abd": abduction}
    found = math.degrees(of_joints(names, np.radians([[angles.get(n, 0.0) for n in names]]), side).upper_arm_flexion[0])
    assert found == pytest.approx(elevation, abs=0.5)
    assert abs(found) == pytest.approx(math.degrees(math.acos(-arm[2] / np.linalg.norm(arm))))


def test_an_arm_overhead_by_abduction_and_by_flexion_scores_alike() -> None:
    names = ["right_sh_flex", "right_sh_abd", "right_sh_rot", "right_el_flex"]
    overhead = of_joints(names, np.radians([[170.0, 0.0, 0.0, 80.0], [0.0, 170.0, 0.0, 80.0]]), "right")
    for method in METHODS.values():
        assert method(Posture(upper_arm_flexion=overhead.upper_arm_flexion)).parts["upper_arm"].tolist() == [4, 4]
    assert rula.score(overhead).parts["upper_arm"].tolist() == [4, 4]


@pytest.mark.parametrize("heading", [0.0, 40.0, -130.0])
@pytest.mark.parametrize(
    ("pelvis", "flexion", "bend"), [(65, 5, 0), (0, 70, 0), (-20, 10, 0), (0, 30, 20), (0, 0, -25)]
)
def test_a_trunk_is_as_inclined_as_its_axis_whether_hips_or_spine_are_bent(
    heading: float, pelvis: float, flexion: float, bend: float
) -> None:
    root = Rotation.from_euler("ZY", [heading, pelvis], degrees=True)
    posed = Posed(body(parts="upper_body"), trunk_flex=flexion, trunk_bend=bend)
    up = root.apply(posed.rotation("torso")[:, 2])
    forward, bent = to_vertical(root.as_matrix()[None], *np.radians([[flexion], [bend]]))
    assert np.degrees(forward) == pytest.approx(pelvis + flexion)
    assert np.degrees(bent) == pytest.approx(bend)
    assert math.cos(forward[0]) * math.cos(bent[0]) == pytest.approx(up[2])


def test_a_pelvis_that_leans_to_the_right_bends_the_trunk_to_the_right() -> None:
    root = Rotation.from_euler("ZX", [70.0, 15.0], degrees=True).as_matrix()[None]
    forward, bent = to_vertical(root, np.zeros(1), np.zeros(1))
    assert (np.degrees(forward[0]), np.degrees(bent[0])) == pytest.approx((0.0, 15.0))


@pytest.mark.parametrize("lean", [-50.0, 20.0, 40.0])
def test_forward_is_level_and_at_right_angles_to_the_left_of_a_pelvis_that_leans(lean: float) -> None:
    root = Rotation.from_euler("ZXY", [35.0, lean, 10.0], degrees=True)
    axis = root.apply(Rotation.from_euler("YX", [40.0, -15.0], degrees=True).apply([0.0, 0.0, 1.0]))
    left = root.apply([0.0, 1.0, 0.0]) * [1.0, 1.0, 0.0]
    left /= np.linalg.norm(left)
    ahead = np.cross(left, [0.0, 0.0, 1.0])
    forward, bend = to_vertical(root.as_matrix()[None], *np.radians([[40.0], [-15.0]]))
    assert forward[0] == pytest.approx(math.atan2(axis @ ahead, axis[2]))
    assert bend[0] == pytest.approx(-math.asin(axis @ left))


def test_a_pelvis_on_its_side_has_no_forward() -> None:
    root = Rotation.from_euler("X", 80.0, degrees=True).as_matrix()[None]
    assert np.isnan(to_vertical(root, np.zeros(1), np.zeros(1))).all()


# An angle that is known within an interval, and one that is not known at all.


def test_an_angle_near_a_threshold_gives_both_scores_and_is_named() -> None:
    neck = Posture(neck_flexion=np.radians([1.0, 5.0]))
    found = rula.score(neck, spread={"neck_flexion": math.radians(2.0)})
    assert found.score.tolist() == [1, 1]
    assert (found.lowest.tolist(), found.highest.tolist()) == ([1, 1], [4, 1])
    assert found.uncertain(0) == ["neck +4: neck flexion below 0 deg (1.0 +- 2.0 deg)"]
    assert found.uncertain(1) == []


@pytest.mark.parametrize(("degrees", "lowest", "highest"), [(24.0, 2, 2), (22.0, 1, 2), (18.0, 1, 2), (16.0, 1, 1)])
def test_a_point_of_an_angle_counts_where_a_half_width_to_either_side_says_so(
    degrees: float, lowest: int, highest: int
) -> None:
    """An arm is abducted beyond 20 degrees; the angle is known to 3 degrees."""

    def scored(angle: float, half: float = 0.0) -> Scores:
        posture = Posture(upper_arm_abduction=math.radians(angle), upper_arm_flexion=1.0)
        return rula.score(posture, Task(load=3.0), spread={"upper_arm_abduction": math.radians(half)})

    found, either = scored(degrees, 3.0), [int(scored(angle).score[0]) for angle in (10.0, 30.0)]
    assert either[0] < either[1]
    assert (found.lowest[0], found.highest[0]) == (either[lowest - 1], either[highest - 1])


def test_a_point_of_an_angle_is_named_with_its_half_width() -> None:
    found = rula.score(Posture(shoulder_elevation=0.3), spread={"shoulder_elevation": math.radians(2.0)})
    assert "upper arm +1: shoulder raised (17.2 +- 2.0 deg)" in found.reasons(0)


def test_an_angle_that_may_be_any_scores_as_it_was_measured_beside_its_ends() -> None:
    measured = rula.score(Posture(upper_arm_abduction=0.6), spread={"upper_arm_abduction": math.inf})
    assert measured.parts["upper_arm"].tolist() == [2]


@pytest.mark.parametrize("method", METHODS)
def test_no_posture_within_an_interval_scores_outside_the_ends(method: str) -> None:
    random, half = np.random.default_rng(5), math.radians(8.0)
    angles = {name: random.uniform(-1.6, 1.6, 400) for name in ANGLES}
    found = METHODS[method](Posture(**angles), spread=dict.fromkeys(ANGLES, half))
    for _ in range(20):
        other = {name: values + random.uniform(-half, half, 400) for name, values in angles.items()}
        score = METHODS[method](Posture(**other)).score
        assert ((found.lowest <= score) & (score <= found.highest)).all()


@pytest.mark.parametrize("method", METHODS)
def test_an_angle_that_is_not_known_may_score_most(method: str) -> None:
    found = METHODS[method](Posture(), spread={"trunk_flexion": math.inf})
    most = METHODS[method](Posture(trunk_flexion=np.radians(np.arange(-180.0, 181.0)))).score.max()
    assert (found.score[0], found.highest[0]) == (1, most)


def test_the_use_of_neck_and_trunk_counts_for_them_alone() -> None:
    held = rula.score(Posture(neck_flexion=0.3), Task(held=0.0, rest_held=61.0))
    points = {step.part: step.points.tolist() for step in held.steps if step.part.startswith("muscle use")}
    assert points == {"muscle use": [0], "muscle use, neck and trunk": [1]}


def test_an_arm_alone_has_no_trunk_and_says_so() -> None:
    names = list(body(parts="right_arm").joints)
    found = rula.score(of_joints(names, np.zeros((3, len(names))), "right"))
    assert "trunk_flexion is not known: assumed 0 deg" in found.assumptions
    with pytest.raises(HricError, match="the side of the arm is 'both'; valid: right, left"):
        of_joints(names, np.zeros((3, len(names))), "both")
