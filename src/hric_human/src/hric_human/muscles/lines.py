"""Where the muscles of a body are drawn: lines through points that its links take along.

A picture: which moment arms a muscle has is said by its length alone (`MuscleSet`). Points are those of the model in
the resting posture, so that in other postures a line may cut through a bone that the muscle's path goes around.
"""

from collections.abc import Sequence

import numpy as np

from hric_control.geometry import Vector
from hric_human.body import Body
from hric_human.body.segments import SIDES
from hric_human.muscles.anatomy import SEGMENTS, Anatomy

Points = tuple[tuple[str, Vector], ...]
"""Link, and place in its axes [m]."""
_TORSO, _UPPER_ARM, _FOREARM = SEGMENTS


def muscle_lines(body: Body, anatomy: Anatomy) -> dict[str, Points]:
    """Of the muscles of a body's arms, by name with the side ("right_bic_l"), scaled as its segments are."""
    return {
        f"{side}_{name}": tuple(_placed(body, anatomy, side, segment, place) for segment, place in muscle.course)
        for side in ("right", "left")
        if f"{side}_upper_arm" in body.segments
        for name, muscle in anatomy.muscles.items()
    }


def _placed(body: Body, anatomy: Anatomy, side: str, segment: str, place: Sequence[float]) -> tuple[str, Vector]:
    """A point of a right arm's model, on a side of the body; what lies on the trunk scales with the upper arm."""
    arm = body.segments[f"{side}_{_FOREARM if segment == _FOREARM else _UPPER_ARM}"]
    reference = anatomy.reference.get(arm.kind)
    p = np.array(place) * (arm.length / reference if reference else 1.0)
    p[1] *= SIDES[side] / SIDES["right"]
    link = arm.link
    if segment == _TORSO:
        link, p = arm.parent, p + arm.p_parent_link
    x, y, z = p.tolist()
    return link, (x, y, z)
