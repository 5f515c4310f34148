"""The distance of a person from an arm where one of the two is not recorded for a part of the time."""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import known_bags
import numpy as np
import pytest
import verdict_cases

from hric_assessment.findings import Outcome
from hric_assessment.verdict import assess, opened
from hric_assessment.verdict.conclusions import Reply
from hric_core.errors import HricError
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings


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


BASE = [("world", "base_link", 0.0), *FAR]


def states(bag: known_bags.Bag, topic: str, at: float, names: list[str]) -> None:
    values = dict.fromkeys(("position", "velocity", "effort"), np.zeros(len(names)))
    bag.write(topic, "sensor_msgs/msg/JointState", at, name=names, **values)


@pytest.mark.parametrize(
    ("more", "reply", "words"),
    [
        (lambda bag: None, Reply.YES, "never nearer than S_p"),
        (lambda bag: states(bag, "/arm2/joint_states", 1.0, ["lift"]), Reply.UNKNOWN, "the links of lift are"),
        (
            lambda bag: known_bags.frames(bag, 3.0, ("world", "base_link", 1.0, 0.0)),
            Reply.UNKNOWN,
            "has several or invalid poses",
        ),
        (
            lambda bag: known_bags.frames(bag, 3.0, ("floor", "base_link", 0.0, 0.0)),
            Reply.UNKNOWN,
            "has several or invalid poses",
        ),
        (
            lambda bag: known_bags.frames(bag, 3.0, ("world", "base_link", math.nan, 0.0)),
            Reply.UNKNOWN,
            "has several or invalid poses",
        ),
        (
            lambda bag: known_bags.frames(bag, 3.0, ("world", "base_link", 1.0, 0.0), topic="/tf"),
            Reply.UNKNOWN,
            "the frame base_link has several or invalid poses in tf",
        ),
        (
            lambda bag: known_bags.frames(bag, 3.0, ("world", "human_base", 1.0, 1.4), topic="/tf"),
            Reply.UNKNOWN,
            "the frame human_base has several or invalid poses in tf",
        ),
        (lambda bag: known_bags.frames(bag, 3.0, ("base_link", "tool", 1.0, 0.0), topic="/tf"), Reply.YES, "never"),
        (
            lambda bag: bag.write("/robot_description", "std_msgs/msg/String", 1.0, data='<robot name="desk"/>'),
            Reply.YES,
            "never nearer than S_p",
        ),
        (
            lambda bag: bag.write("/robot_description", "std_msgs/msg/String", 1.0, data='<joint name="rail"/>'),
            Reply.UNKNOWN,
            "the robot descriptions in the recording differ",
        ),
        (lambda bag: bag.write("/hric/human/root", "std_msgs/msg/String", 1.0, data="text"), Reply.YES, "never"),
    ],
    ids=[
        *(
            "alone",
            "second arm",
            "base moved",
            "two parents",
            "base is not finite",
            "base moves",
            "person moves",
            "links in tf",
        ),
        *("another description", "two descriptions", "another type of a topic"),
    ],
)
def test_an_arm_is_far_enough_only_where_all_that_moves_is_known(
    tmp_path: Path, more: Callable[[known_bags.Bag], None], reply: Reply, words: str
) -> None:
    known_bags.approach(tmp_path, urdf=known_bags.ball_urdf("base_link"), base=BASE, more=more, parts="upper_body")
    verdict = assess(opened(str(tmp_path / "approach.bag")))
    (distance,) = [one for one in verdict.conclusions if one.question == "distance"]
    assert distance.reply == reply and words in "; ".join([distance.reason, *verdict.input.notes])


def tracking(bag: known_bags.Bag, at: float, **changes: Any) -> None:
    """A tracked person, 9 m from the ball's path."""
    point = known_bags.made("geometry_msgs/msg/Point", x=0.0, y=9.0, z=1.4)
    turn = known_bags.made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    root = known_bags.made("geometry_msgs/msg/Pose", position=point, orientation=turn)
    about = {"calibrated": True, "root": root, "root_state": "measured", "name": [], "state": [], "residual": 0.005}
    about |= {"missing": [], "dropped": 0} | changes
    kind, frame = "hric_msgs/msg/PersonTracking", about.pop("frame", "world")
    about["header"] = known_bags.header(at, frame)
    bag.write("/hric/person/tracking", kind, at, **about)


@pytest.mark.parametrize(
    ("changes", "reply"),
    [
        ({}, Reply.YES),
        ({"root_state": "lost"}, Reply.UNKNOWN),
        ({"frame": "cell"}, Reply.UNKNOWN),
        ({"residual": 0.0}, Reply.UNKNOWN),
        ({"residual": math.nan}, Reply.UNKNOWN),
    ],
    ids=["tracked", "lost", "in another frame", "residual not filled in", "without residual"],
)
def test_a_tracked_person_is_far_enough_only_where_the_tracker_knows_their_pose(
    tmp_path: Path, changes: dict[str, Any], reply: Reply
) -> None:
    """The changes last for one second, those of the residual for the whole recording."""
    body = describe(HumanSettings.of({"parts": "upper_body"}, "human").person)

    def more(bag: known_bags.Bag) -> None:
        for at in (0.02 * k for k in range(200)):
            states(bag, "/hric/person/joint_states", at, list(body.joints))
            tracking(bag, at, **(changes if "residual" in changes or 1.0 < at < 2.0 else {}))

    known_bags.approach(tmp_path, seen=lambda time: False, more=more)
    verdict = assess(opened(str(tmp_path / "approach.bag")))
    (distance,) = [one for one in verdict.conclusions if one.question == "distance"]
    assert distance.reply == reply


def logged(bag: verdict_cases.Bag, robot_time: Callable[[float], float]) -> None:
    """Let a control log of 3 s have another clock."""
    bag.control_log(0.0, 3.0)
    for at, topic, _, message in bag.rows:
        if topic == "/control_log":
            message.time = message.time - at + robot_time(at)


@pytest.mark.parametrize(
    "robot_time",
    [lambda at: min(at, 1.0), lambda at: at % 1.5],
    ids=["stands still", "begins again"],
)
def test_a_robot_clock_that_does_not_rise_is_refused(tmp_path: Path, robot_time: Callable[[float], float]) -> None:
    bag = verdict_cases.Bag()
    logged(bag, robot_time)
    with pytest.raises(HricError, match=r"the clock of the control log does not rise above"):
        opened(str(bag.save(tmp_path / "clock.bag")))


def test_a_robot_clock_may_be_slow(tmp_path: Path) -> None:
    bag = verdict_cases.Bag()
    logged(bag, lambda at: 0.5 * at)
    assert opened(str(bag.save(tmp_path / "clock.bag"))).recording.log is not None


def test_an_arm_whose_position_is_frozen_while_it_has_a_velocity_is_not_known(tmp_path: Path) -> None:
    known_bags.approach(tmp_path, base=FAR, measured=lambda times: np.minimum(times, 2.0), parts="upper_body")
    findings = assess(opened(str(tmp_path / "approach.bag"))).findings
    (finding,) = [one for one in findings if one.group == "separation"]
    assert finding.outcome == Outcome.NOT_ASSESSABLE and "known for 2.0" in finding.reason


def test_an_arm_at_no_place_has_no_picture(tmp_path: Path) -> None:
    known_bags.approach(tmp_path, measured=lambda times: np.where(times > 1.0, np.nan, times), parts="upper_body")
    verdict = assess(opened(str(tmp_path / "approach.bag")))
    assert verdict.moment is None


def test_a_person_whose_first_joint_states_are_empty_is_assessed(tmp_path: Path) -> None:
    empty = functools.partial(states, topic="/hric/human/joint_states", at=0.0, names=[])
    known_bags.approach(tmp_path, base=FAR, more=empty, parts="upper_body")
    findings = assess(opened(str(tmp_path / "approach.bag"))).findings
    (finding,) = [one for one in findings if one.group == "separation"]
    assert finding.outcome == Outcome.WITHIN


def test_a_person_of_whom_only_an_arm_is_known_is_not_far_enough(tmp_path: Path) -> None:
    known_bags.approach(tmp_path, base=FAR)
    findings = assess(opened(str(tmp_path / "approach.bag"))).findings
    (finding,) = [one for one in findings if one.group == "separation"]
    assert (
        finding.outcome == Outcome.NOT_ASSESSABLE
        and "only one or both arms of the person are recorded" in finding.reason
    )
