"""The distance of a person from an arm where one of the two is not recorded for a part of the time."""

from collections.abc import Callable
from pathlib import Path

import known_bags
import pytest

from hric_assessment.findings import Outcome
from hric_assessment.verdict import assess, opened


@pytest.mark.parametrize(
    ("seen", "outcome"),
    [
        (lambda time: True, Outcome.ABOVE),
        (lambda time: time < 0.8, Outcome.NOT_ASSESSABLE),
        (lambda time: not 0.8 <= time < 3.6, Outcome.NOT_ASSESSABLE),
        (lambda time: time > 3.5, Outcome.NOT_ASSESSABLE),
        (lambda time: not 0.3 < time < 0.5, Outcome.ABOVE),
    ],
    ids=["all of the time", "before the arm comes", "but for when it comes", "after it came", "but for elsewhere"],
)
def test_an_arm_that_passes_while_nobody_sees_the_person_was_not_far_enough(
    tmp_path: Path, seen: Callable[[float], bool], outcome: Outcome
) -> None:
    known_bags.approach(tmp_path, seen)
    findings = assess(opened(str(tmp_path / "approach.bag"))).findings
    (finding,) = [one for one in findings if one.group == "separation"]
    assert finding.outcome == outcome and finding.evidence is not None
    assert (finding.evidence.arm_motion == 1.0) == all(seen(0.1 * k) for k in range(40))
    assert finding.remedy.startswith("record /control_log and /hric/human/joint_states") == (outcome != Outcome.ABOVE)


ON_A_TABLE = [("world", "table", 3.0), ("table", "base_link", 4.0)]
FAR = [("elsewhere", "far", 9.0)]
"""A frame of nothing, which moves the ball's path 9 m away."""
COLUMN = (
    '<link name="{}"/><joint name="column" type="prismatic"><parent link="{}"/><child link="{}"/><axis xyz="1 0 0"/>'
)
COLUMN += '<limit lower="-3" upper="3" effort="100" velocity="5"/></joint>'


@pytest.mark.parametrize(
    ("urdf", "base", "outcome", "reason"),
    [
        (known_bags.ball_urdf("base_link"), ON_A_TABLE, Outcome.ABOVE, "the distance is 0.331 m"),
        (known_bags.ball_urdf("base_link"), [], Outcome.NOT_ASSESSABLE, "no static transform leads from world to"),
        (known_bags.ball_urdf("base_link"), ON_A_TABLE[1:], Outcome.NOT_ASSESSABLE, "no static transform leads"),
        (
            known_bags.ball_urdf("carriage", COLUMN.format("floor", "floor", "carriage")),
            [("world", "floor", 0.0), *FAR],
            Outcome.NOT_ASSESSABLE,
            "the positions of column are not in the control log",
        ),
        (
            known_bags.ball_urdf(more=COLUMN.format("second", "world", "second")),
            FAR,
            Outcome.NOT_ASSESSABLE,
            "the positions of column are not in the control log",
        ),
    ],
    ids=["on a table", "no transform", "no transform to the world", "on a column", "beside another arm"],
)
def test_an_arm_is_far_enough_only_where_its_base_is_known(
    tmp_path: Path, urdf: str, base: list[tuple[str, str, float]], outcome: Outcome, reason: str
) -> None:
    known_bags.approach(tmp_path, urdf=urdf, base=base)
    findings = assess(opened(str(tmp_path / "approach.bag"))).findings
    (finding,) = [one for one in findings if one.group == "separation"]
    assert finding.outcome == outcome and reason in finding.reason
