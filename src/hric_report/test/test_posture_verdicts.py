"""Scores of a streamed motion with known postures agree with those of an independent implementation at every sample."""

from typing import Any

import numpy as np
import pytest
from bodies import body
from posture_by_hand import reba_by_hand, rula_by_hand
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from hric_assessment.findings import Outcome
from hric_assessment.verdict import Verdict, assess, opened
from hric_core.robot_time.stamps import to_time
from hric_run.bag_writer import BagWriter

COUNT, RATE = 1500, 100.0
MIDDLE = {"neck_flexion": "neck_flex", "neck_bend": "neck_bend", "neck_twist": "neck_rot"} | {
    "trunk_flexion": "trunk_flex",
    "trunk_bend": "trunk_bend",
    "trunk_twist": "trunk_rot",
}
ARM = {
    "upper_arm_rotation": "sh_rot",
    "elbow_flexion": "el_flex",
    "wrist_flexion": "wr_flex",
    "wrist_deviation": "wr_dev",
    "pronation": "pro_sup",
}
SPREAD = {"el_flex": (0, 150), "sh_flex": (-60, 150), "knee_flex": (0, 120)}
NOT_SO = ("arm_supported", "trunk_supported", "unbalanced", "sitting", "static", "shock", "rapid")


@pytest.fixture(scope="module")
def motion() -> dict[str, np.ndarray]:
    """Return a motion in whole degrees of all joints of a body, so that it meets thresholds exactly."""
    random = np.random.default_rng(18)
    ranges = {name: SPREAD.get(name.partition("_")[2], (-25, 26)) for name in body().joints}
    return {name: random.integers(*limits, COUNT).astype(float) for name, limits in ranges.items()}


@pytest.fixture(scope="module")
def verdict(motion: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    path = tmp_path_factory.mktemp("bags") / "motion.bag"
    with BagWriter(path) as writer:
        for k in range(COUNT):
            message = JointState(name=list(motion), position=[np.radians(values[k]) for values in motion.values()])
            message.header.stamp = to_time(1.0 + k / RATE)
            writer.write("/somebody/joint_states", message, 1.0 + k / RATE)
    return assess(opened(str(path)))


def posture(motion: dict[str, np.ndarray], side: str, k: int) -> dict[str, Any]:
    """Return the angles that an observer would note, directions of upper arm and forearm with the rotations of a
    library [deg, whole]; the random motion changes direction many times in its minute."""
    found: dict[str, Any] = dict.fromkeys(NOT_SO, False) | {"load": 0.0, "held": 0.0, "repeats": 99.0}
    found |= {name: motion[joint][k].item() for name, joint in MIDDLE.items()}
    found |= {name: motion[f"{side}_{joint}"][k].item() for name, joint in ARM.items()}
    found["knee_flexion"] = max(motion[f"{one}_knee_flex"][k].item() for one in ("right", "left"))
    shoulder = Rotation.from_euler(
        "XZY", [motion[f"{side}_{joint}"][k] for joint in ("sh_flex", "sh_abd", "sh_rot")], True
    )
    outward, up, back = shoulder.apply([0.0, -1.0, 0.0])
    behind = up < 0.0 and back > abs(outward)
    found["upper_arm_flexion"] = round(float(np.degrees(np.arccos(min(-up, 1.0))))) * (-1 if behind else 1)
    found["upper_arm_abduction"] = round(float(np.degrees(np.arcsin(outward))))
    bent = np.radians(found["elbow_flexion"])
    across = shoulder.apply([0.0, -np.cos(bent), -np.sin(bent)])[0]
    return found | {"forearm_inward": round(float(np.degrees(np.arcsin(across)))), "shoulder_elevation": 0.0}


@pytest.mark.parametrize("side", ["right", "left"])
def test_rula_of_a_bag_is_that_of_another_scorer_at_every_sample(
    motion: dict[str, np.ndarray], verdict: Verdict, side: str
) -> None:
    (found,) = [one for one in verdict.timelines.scores["rula"] if one.side == side]
    assert found.score == [rula_by_hand(posture(motion, side, k)) for k in range(COUNT)]
    assert found.time == pytest.approx((np.arange(COUNT) / RATE).tolist(), abs=1e-6)


@pytest.mark.parametrize("side", ["right", "left"])
def test_reba_of_a_bag_is_that_of_another_scorer_at_every_sample(
    motion: dict[str, np.ndarray], verdict: Verdict, side: str
) -> None:
    (found,) = [one for one in verdict.timelines.scores["reba"] if one.side == side]
    assert found.score == [reba_by_hand(posture(motion, side, k), coupling=0) for k in range(COUNT)]


def test_the_score_that_counts_is_reached_for_a_second_in_all(verdict: Verdict) -> None:
    for one in [finding for finding in verdict.findings if finding.group == "posture"]:
        (timeline,) = [t for t in verdict.timelines.scores[one.subject[:4].lower()] if t.side in one.subject]
        scores = np.array(timeline.score)
        counts = one.values["score that counts"]
        assert counts is not None
        assert (scores >= counts).sum() / RATE >= 1.0 > (scores > counts).sum() / RATE
        assert one.outcome == (Outcome.ABOVE if counts > {"RULA": 6, "REBA": 7}[one.subject[:4]] else Outcome.WARNING)
        assert any("chosen here" in note for note in one.notes)


def test_a_bag_without_a_run_says_what_is_not_in_it_and_what_was_assumed(verdict: Verdict) -> None:
    signals = " ".join(one.signal for one in verdict.missing)
    assert all(name in signals for name in ("human/contacts", "control_log", "robot_description", "joint_torque"))
    assert any("assumed to be that of P50M, whole_body" in line for line in verdict.assumptions)
    assert verdict.timelines.separation is None and verdict.timelines.activation is None
