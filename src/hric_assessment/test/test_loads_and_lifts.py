"""Joint loads and two-handed lifts in verdicts of known signals."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from known_bags import MESSAGES, STORE, Bag, joints, made
from rosbags.typesys import get_types_from_msg

from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import assess, opened
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

for _name in ("JointReactions", "HumanGrip"):
    STORE.register(get_types_from_msg((MESSAGES / f"{_name}.msg").read_text(), f"hric_msgs/msg/{_name}"))
G, PARTS = 9.80665, "both_arms"
LOAD, REACH, LOW, RISE = 10.0, 0.40, 0.30, 0.70
"""Mass of the box [kg]; its distance from the middle of the hips, height above the floor, and lift height [m]."""
HANDS = ("right", "left")


def vector(kind: str, x: float, y: float, z: float) -> Any:
    return made(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def wrench(x: float, y: float, z: float) -> Any:
    return made("geometry_msgs/msg/Wrench", force=vector("Vector3", x, y, z), torque=vector("Vector3", 0.0, 0.0, 0.0))


def test_contact_forces_in_the_joints_of_a_tracked_person_are_those_that_were_published(tmp_path: Path) -> None:
    """3-4-12 is 13, and grows by a newton a second; an arm that is lost has none. Those of a robot do not count."""
    times, kind = np.arange(0.0, 4.001, 0.01), "hric_msgs/msg/JointReactions"
    with Bag(tmp_path / "tracked.bag") as bag:
        for time in times.tolist():
            rest = {"at_limit": np.zeros(1, dtype=bool), "limited": np.zeros(1, dtype=np.uint32)}
            a = np.array([0.1])
            about = {"name": ["right_bic"], "excitation": a, "activation": a, **rest}
            bag.write("/hric/person/activation", "hric_msgs/msg/MuscleActivation", time, **about)
            size = (13.0 + time) / 13.0
            for topic, names, factor in (
                ("/hric/person/joint_reactions", ["right_shoulder", "left_shoulder"], size),
                ("/sim/joint_reactions", ["panda_joint1", "panda_joint2"], 100.0),
            ):
                forces = [wrench(3.0 * factor, 4.0 * factor, 12.0 * factor), wrench(np.nan, np.nan, np.nan)]
                places = {"link_names": names, "positions": [vector("Point", 0.0, 0.0, 0.0)] * 2}
                bag.write(topic, kind, time, joint_names=names, **places, wrenches=forces)
    (found,) = (one for one in assess(opened(str(tmp_path / "tracked.bag"))).figures if one.group == "joint load")
    assert found.name == "largest contact force in right_shoulder" and found.value == pytest.approx(17.0)
    assert "mean 15 N; recorded, a model's estimate" in found.note


def test_without_them_a_verdict_says_what_they_would_give(tmp_path: Path) -> None:
    with Bag(tmp_path / "moves.bag") as bag:
        joints(bag, np.arange(0.0, 2.0, 0.02), {"right_el_flex": 0.4, "right_sh_flex": 0.0})
    lacking = {one.signal: one.gives for one in assess(opened(str(tmp_path / "moves.bag"))).missing}
    (gives,) = (gives for signal, gives in lacking.items() if "joint_reactions" in signal)
    assert gives == "the load in shoulders and elbows"


def height(time: float) -> float:
    """Of the box above the floor: up within 3 s with least jerk, a second there, and down [m]."""
    u = np.clip(time / 3.0 if time < 3.5 else (7.0 - time) / 3.0, 0.0, 1.0)
    return LOW + RISE * float(u**3 * (10.0 - 15.0 * u + 6.0 * u * u))


def lifted(
    folder: Path,
    hands: tuple[str, ...],
    unknown: Callable[[float], float] = lambda time: 1.0,
    holds: Callable[[str, float], bool] = lambda side, time: True,
) -> list[Finding]:
    """Findings of lifts of a run in which some hands carry a box, each its part of the weight.

    unknown: factor of the recorded force at a time [s]; holds: True if the hand of a side is closed then.
    """
    section = {"parts": PARTS, "posture": "standing", "position": [1.0, 2.0]}
    settings = HumanSettings.of(section, "human")
    body, folder = describe(settings.person), folder / "lift"
    folder.mkdir()
    (folder / "run.yaml").write_text(yaml.safe_dump({"bag": "lift.bag", "definition": {"human": section}}))
    with Bag(folder / "lift.bag") as bag:
        times = np.arange(0.0, 7.001, 0.01)
        joints(bag, times[::2], dict.fromkeys(body.joints, 0.0))
        for time in times.tolist():
            for side in hands:
                y = 2.0 + (0.2 if side == "left" else -0.2 if len(hands) == 2 else 0.0)
                where = vector("Point", 1.0 + REACH, y, settings.floor + height(time))
                about = {"name": side, "held": "box::box", "holder": f"human::{body.segments[f'{side}_hand'].link}"}
                force = wrench(0.0, 0.0, -LOAD * G / len(hands) * unknown(time))
                still = {"stretch": 0.0, "slipped": 0.0, "turned": 0.0}
                bag.write(
                    "/hric/human/grip", "hric_msgs/msg/HumanGrip", time, **about, closed=holds(side, time),
                    wrench=force, point=where, **still,
                )  # fmt: skip
    return [one for one in assess(opened(str(folder))).findings if one.group == "lift"]


def test_what_both_hands_lift_is_rated_by_the_equation_at_both_ends(tmp_path: Path) -> None:
    """RWL = 23 kg (25/H) (1 - 0.003 |V - 75|) (0.82 + 4.5/D), with H 40, V 30, D 70 cm, one lift in 5 min, good grips;
    the index is 10 kg over it."""
    limit = 23.0 * (25.0 / 40.0) * (1.0 - 0.003 * 45.0) * (0.82 + 4.5 / 70.0)
    found = {one.subject: one for one in lifted(tmp_path, HANDS)}
    assert set(found) == {"pick-up of box::box", "put-down of box::box"}
    for one in found.values():
        assert one.values["load, the person's share [kg]"] == pytest.approx(LOAD, rel=1e-3)
        assert one.values["horizontal distance H [m]"] == pytest.approx(REACH, abs=1e-6)
        assert one.values["height V [m]"] == pytest.approx(LOW, abs=1e-6)
        assert one.values["recommended weight limit [kg]"] == pytest.approx(limit, rel=1e-3)
        assert one.values["lifting index [1]"] == pytest.approx(LOAD / limit, rel=2e-3)
        assert LOAD / limit < 1.0 and one.outcome == Outcome.WITHIN


def test_what_one_hand_lifts_is_outside_the_equation(tmp_path: Path) -> None:
    found = lifted(tmp_path, HANDS[:1])
    assert [one.outcome for one in found] == [Outcome.NOT_ASSESSABLE] * 2
    assert all("hands is 1; valid: 2" in one.reason for one in found)


def test_a_box_that_is_held_and_never_lifted_is_no_lift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "height", lambda time: LOW)
    assert lifted(tmp_path, HANDS) == []


def test_a_force_that_is_not_known_for_a_moment_is_not_a_load_of_zero(tmp_path: Path) -> None:
    found = lifted(tmp_path, HANDS, lambda time: math.nan if abs(time - 2.5) < 0.005 else 1.0)
    assert [one.values["load, the person's share [kg]"] for one in found] == [pytest.approx(LOAD, rel=1e-3)] * 2


@pytest.mark.parametrize(
    ("unknown", "holds"),
    [
        (lambda time: math.nan, lambda side, time: True),
        (lambda time: 1.0, lambda side, time: (side == "left") == (time < 3)),
    ],
    ids=["no force", "one hand after the other"],
)
def test_a_box_that_is_never_known_in_both_hands_is_not_assessable(
    tmp_path: Path, unknown: Callable[[float], float], holds: Callable[[str, float], bool]
) -> None:
    (finding,) = lifted(tmp_path, HANDS, unknown, holds)
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "no instant at which all hands hold it" in finding.reason
