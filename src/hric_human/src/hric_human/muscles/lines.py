"""Lines that draw a body's muscles, through points fixed to its links, coloured by activation.

The lines are only a picture: moment arms follow from the muscle's length polynomial (`MuscleSet`). The points are valid
in the resting posture; in other postures a line may cut through a bone around which the muscle wraps.
"""

from collections.abc import Sequence

import numpy as np

from hric_core.geometry import FloatArray, Vector
from hric_human.body import Body
from hric_human.body.segments import SIDES
from hric_human.muscles.anatomy import SEGMENTS, Anatomy

Points = tuple[tuple[str, Vector], ...]
"""Points of a line: link, and position in axes of the link [m]."""
ACTIVATION_COLOURS = ((0.0, "#2b5fa8"), (0.1, "#35a79c"), (0.25, "#f2c14e"), (0.5, "#b3261e"))
"""Colour scale of activation [1]: linear between these stops, constant beyond the last (project default).

Reports and live views share it, so that runs can be compared by sight.
"""
_TORSO, _UPPER_ARM, _FOREARM = SEGMENTS
_STOPS = [value for value, _ in ACTIVATION_COLOURS]
_RGB = np.array([[int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for _, text in ACTIVATION_COLOURS])


def colour(activation: Sequence[float]) -> FloatArray:
    """Return the colours of n activations: red, green and blue from 0 to 1, shape (n, 3)."""
    return np.stack([np.interp(activation, _STOPS, part) for part in _RGB.T], axis=1)


def muscle_lines(body: Body, anatomy: Anatomy) -> dict[str, Points]:
    """Return the lines of a body's arm muscles, by name with the side ("right_bic_l"), scaled with its segments."""
    return {
        f"{side}_{name}": tuple(_placed(body, anatomy, side, segment, p) for segment, p in muscle.path)
        for side in ("right", "left")
        if f"{side}_upper_arm" in body.segments
        for name, muscle in anatomy.muscles.items()
    }


def _placed(body: Body, anatomy: Anatomy, side: str, segment: str, p_model: Sequence[float]) -> tuple[str, Vector]:
    """Transfer a point of the right arm's model to one side of the body; points on the trunk scale with the upper arm.

    Returns:
        link of the body, and position in axes of this link [m].
    """
    arm = body.segments[f"{side}_{_FOREARM if segment == _FOREARM else _UPPER_ARM}"]
    reference = anatomy.reference.get(arm.kind)
    p = np.array(p_model) * (arm.length / reference if reference else 1.0)
    p[1] *= SIDES[side] / SIDES["right"]
    link = arm.link
    if segment == _TORSO:
        link, p = arm.parent, p + arm.p_parent_link
    x, y, z = p.tolist()
    return link, (x, y, z)
