"""The score of one posture by look-up is that of the whole method, at thresholds too, and costs a small part of it."""

import math

import numpy as np
import pytest
from cost_ratio import cost_ratio

from hric_assessment.ergonomics.instant import InstantScore, thresholds
from hric_assessment.ergonomics.posture import of_joints
from hric_assessment.ergonomics.reba import Reba
from hric_assessment.ergonomics.rula import Rula
from hric_assessment.ergonomics.scoring import PostureMethod
from hric_core.errors import HricError
from hric_human.body import Subject, describe

JOINTS = tuple(describe(Subject(code="P50", mass=78.2, height=1.759, sex="male", parts="whole_body")).joints)
METHODS = pytest.mark.parametrize("method", [Rula(), Reba()], ids=["rula", "reba"])


@METHODS
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_score_by_look_up_is_that_of_the_method(method: PostureMethod, side: str) -> None:
    q = np.random.default_rng(1).uniform(-1.6, 1.6, (400, len(JOINTS)))
    wanted = method.score(of_joints(JOINTS, q, side)).score
    instant = InstantScore(method, JOINTS, side)
    assert [instant(row.tolist()) for row in q] == wanted.tolist()
    assert [instant(row.tolist()) for row in q] == wanted.tolist()
    assert len(set(wanted.tolist())) > 3


@METHODS
def test_on_a_threshold_and_next_to_it_the_method_decides(method: PostureMethod) -> None:
    bounds, base = thresholds(method.table())["trunk_flexion"], [0.0] * len(JOINTS)
    instant, rows = InstantScore(method, JOINTS, "right"), []
    for bound in bounds:
        for angle in (math.nextafter(bound, -math.inf), bound, math.nextafter(bound, math.inf)):
            rows.append([angle if name == "trunk_flex" else q for name, q in zip(JOINTS, base, strict=True)])
    wanted = method.score(of_joints(JOINTS, np.array(rows), "right")).score.tolist()
    assert [instant(row) for row in reversed(rows)] == wanted[::-1]
    assert len(set(wanted)) > 1


@pytest.mark.parametrize("parts", ["whole_body", "upper_body", "both_arms", "left_arm"])
def test_the_score_of_both_arms_is_that_of_the_worse_one_and_unknown_angles_are_favourable(parts: str) -> None:
    joints = tuple(describe(Subject(code="P50", mass=78.2, height=1.759, sex="male", parts=parts)).joints)
    q = np.random.default_rng(2).uniform(-1.6, 1.6, (100, len(joints)))
    wanted = [Rula().score(of_joints(joints, q, side)).score for side in ("left", "right")]
    instant = InstantScore(Rula(), joints, "left", "right")
    assert [instant(row.tolist()) for row in q] == np.maximum(*wanted).astype(int).tolist()


def test_a_posture_that_is_not_known_has_no_score() -> None:
    with pytest.raises(HricError, match="not finite"):
        InstantScore(Rula(), JOINTS, "right")([math.nan] * len(JOINTS))


def test_a_method_that_reads_angles_itself_is_not_looked_up() -> None:
    class Own(Rula):
        by_table = False

        def total(self, scorer: object, task: object, version: str) -> np.ndarray:
            return np.array([round(100.0 * scorer.known["elbow_flexion"][0])])  # type: ignore[attr-defined]

    instant = InstantScore(Own(), JOINTS, "right")
    assert [instant([angle] * len(JOINTS)) for angle in (0.10, 0.11, 0.12)] == [10, 11, 12]


def test_a_look_up_costs_a_small_part_of_the_method() -> None:
    instant, q = InstantScore(Rula(), JOINTS, "right"), [0.1] * len(JOINTS)
    share = cost_ratio(
        lambda: instant(q), lambda: Rula().score(of_joints(JOINTS, np.array([q]), "right")), times=3, rounds=21
    )
    print(f"a look-up costs {share:.3f} of a score")
    assert share < 0.05
