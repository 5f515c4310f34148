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
