"""The verdict so far is that of the same recording, and does not know what only the end of a run shows."""

import math
from io import BytesIO
from typing import Any

import pytest
from geometry_msgs.msg import Point, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hric_bags.run_file import RunFile
from hric_core.robot_time import stamps
from hric_msgs.msg import RegionContact, RegionContacts
from hric_view.verdict import LiveVerdict

ARM = """<robot name="arm"><link name="base"/><link name="one"><collision><origin xyz="0 0 0.5"/><geometry>
<cylinder radius="0.05" length="0.4"/></geometry></collision></link>
<joint name="joint1" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="2" velocity="2" effort="10"/></joint></robot>"""
PERSON = "/hric/human"
RUN: RunFile = {"definition": {"human": {"parts": "upper_body", "position": [0.9, 0.0], "contact_area": 1e-3}}}
JOINTS = ["right_el_flex", "right_sh_flex"]


def verdict() -> LiveVerdict:
    return LiveVerdict(ARM, ["joint1"], RUN, PERSON)


def data(message: Any) -> bytes:
    message.serialize(buffer := BytesIO())
    return buffer.getvalue()


def lived(force: float | None, seconds: float = 2.0, begin: float = 0.0, of: LiveVerdict | None = None) -> LiveVerdict:
    """Feed a resting arm and person, with an unchanging contact force [N], or contacts unknown."""
    judged = of or verdict()
    for cycle in range(round(100 * seconds)):
        stamp = Header(stamp=stamps.to_time(begin + 0.01 * cycle), seq=cycle)
        judged.push("joint_states", data(JointState(stamp, ["joint1"], [0.1], [0.0], [0.0])))
        judged.push(f"{PERSON}/joint_states", data(JointState(stamp, JOINTS, [1.5, 0.0], [0.0] * 2, [0.0] * 2)))
        if force is not None:
            touching = [contact(force, 0.01 * cycle)] if force else []
            judged.push(f"{PERSON}/contacts", data(RegionContacts(stamp, touching, [])))
    judged.judge()
    return judged


def contact(force: float, duration: float) -> RegionContact:
    return RegionContact(
        ["lower arm, wrist"], False, "r_elbow", "panda::hand", "penalty", 0.0, duration, force, force, 0.0, force,
        math.nan, 1e-3, Point(), Vector3(0.0, 0.0, 1.0), Point(), Vector3(0.0, 0.0, 1.0), 0.0,
    )  # fmt: skip


def replies(judged: LiveVerdict) -> dict[str, str]:
    shown: Any = judged.frame()["verdict"]
    return {line["question"]: line["reply"] for line in shown["lines"]}


@pytest.mark.parametrize(("force", "reply"), [(0.0, "yes"), (400.0, "no"), (None, "unknown")])
def test_contacts_so_far_are_judged(force: float | None, reply: str) -> None:
    assert replies(lived(force))["contact"] == reply


def test_states_of_the_hand_do_not_hide_the_arm() -> None:
    judged = verdict()
    for cycle in range(200):
        stamp = Header(stamp=stamps.to_time(0.01 * cycle))
        judged.push("joint_states", data(JointState(stamp, ["finger"], [0.0], [0.0], [0.0])))
        judged.push("joint_states", data(JointState(stamp, ["joint1"], [0.1], [0.0], [0.0])))
        judged.push(f"{PERSON}/joint_states", data(JointState(stamp, JOINTS, [1.5, 0.0], [0.0] * 2, [0.0] * 2)))
    judged.judge()
    shown: Any = judged.frame()["verdict"]
    assert next(line["number"] for line in shown["lines"] if line["question"] == "distance").startswith("0.42")


def test_what_the_end_shows_is_unknown() -> None:
    after = replies(lived(0.0))
    assert (after["task"], after["effort"]) == ("unknown", "unknown")


def test_a_run_that_begins_anew_is_judged_anew() -> None:
    judged = lived(400.0, begin=100.0)
    assert replies(lived(0.0, of=judged))["contact"] == "yes"


def test_nothing_is_said_without_data() -> None:
    judged = verdict()
    judged.judge()
    assert judged.frame() == {}


def test_the_verdict_is_sent_once_per_period() -> None:
    judged = lived(0.0)
    assert "verdict" in judged.frame() and judged.frame() == {}
