"""Shipped subjects for published experiments with people."""

import math
from collections.abc import Mapping, Sequence

from hric_core.geometry import Pose, Vector
from hric_core.parameters import package_yaml
from hric_human.body import Subject, describe, subject
from hric_human.control import HumanControl
from hric_human.control.kinematics import GRAVITY

WOMEN, MEN = ("P05_female", "P50_female"), ("P50_male", "P95_male")
"""Shipped subjects by sex: 5th and 50th percentile of women, 50th and 95th of men."""
AVERAGE_WOMAN, AVERAGE_MAN = WOMEN[1], MEN[0]
NO_GRAVITY: Vector = (0.0, 0.0, 0.0)
"""Gravity for an arm that is supported against its weight [m/s^2]."""


def control(name: str, gravity: Vector = GRAVITY, points: Sequence[Mapping[str, float]] | None = None) -> HumanControl:
    """Return the control of a shipped subject's right arm with default settings.

    Args:
        name: name of the subject.
        gravity: gravity vector [m/s^2].
        points: rows of `time` [s] and joint positions [rad] between which the arm moves; None: it rests.
    """
    chosen = Subject.of(package_yaml(subject.__file__, f"subjects/{name}"), f"{name}.yaml:")
    parameters = {} if points is None else {"reference": {"program": "joints", "points": points}}
    return HumanControl(describe(chosen), {"parameters": parameters}, 0, Pose(), gravity)


def strengths(name: str, joint: str) -> tuple[float, float]:
    """Return a subject's strength at a joint of the right arm in its positive and its negative direction [N m]."""
    person = control(name).person
    index = person.joints.index(f"right_{joint}")
    return person.strongest[index], -person.weakest[index]


def posture(person_joints: tuple[str, ...], **degrees: float) -> list[float]:
    """Return joint positions of the right arm [rad]; joints that are not named are at 0."""
    named = {f"right_{joint}": angle for joint, angle in degrees.items()}
    return [math.radians(named.get(joint, 0.0)) for joint in person_joints]
