"""Conversion between the angles of this body and those that the International Society of Biomechanics recommends.

Most angles differ only by a sign or an offset, given in the table of `joints`. The shoulder's rotation order is X-Z-Y
here and Y-X-Y in ISB: plane of elevation (0: abduction, 90 deg: flexion), elevation (negative, as ISB writes it) and
axial rotation (internal +). Left sides are mirrored first, as ISB advises, so one formula serves both.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import rotation_about
from hric_human.body.joints import ROWS
from hric_human.body.segments import side_of

HERE = ("sh_flex", "sh_abd", "sh_rot")
THERE = ("sh_plane_of_elevation", "sh_elevation", "sh_axial_rotation")
_X, _Y, _Z = np.eye(3)
_R_ISB_DELFT: FloatArray = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Rotation from the shoulder axes used here (X right, Y up, Z back) to ISB's (X forward, Y up, Z right)."""
_SINGULAR = 1e-9
"""Sine or cosine of the middle angle below which the two others rotate about the same line."""


def to_isb(angles: Mapping[str, float]) -> dict[str, float]:
    """Convert joint angles to ISB's [rad]; a shoulder's are named as in THERE, all others like the joint.

    Args:
        angles: angles by joint [rad]; of a shoulder all three or none. At elevation 0 its plane of elevation is
            undefined and set to 0.
    """
    return _converted(angles, HERE, THERE, isb_shoulder, lambda angle, sign, offset: sign * angle + offset)


def from_isb(angles: Mapping[str, float]) -> dict[str, float]:
    """Convert ISB's angles to angles by joint [rad]; the inverse of `to_isb`, with sh_abd within +-90 deg."""
    return _converted(angles, THERE, HERE, shoulder_from_isb, lambda angle, sign, offset: sign * (angle - offset))


def _converted(
    angles: Mapping[str, float],
    from_names: Sequence[str],
    to_names: Sequence[str],
    shoulder: Callable[[float, float, float], tuple[float, float, float]],
    linear: Callable[[float, int, float], float],
) -> dict[str, float]:
    converted: dict[str, float] = {}
    for name, angle in angles.items():
        side, joint = _split(name)
        if joint == from_names[0]:
            first, second, third = (angles[side + each] for each in from_names)
            converted |= zip((side + each for each in to_names), shoulder(first, second, third), strict=True)
        elif joint not in from_names:
            sign, offset = ROWS[joint].isb or (1, 0.0)
            converted[name] = linear(angle, sign, math.radians(offset))
    return converted


def isb_shoulder(flex: float, abd: float, rot: float) -> tuple[float, float, float]:
    """Convert sh_flex, sh_abd, sh_rot [rad] to ISB's plane of elevation, elevation (-pi to 0), axial rotation [rad]."""
    R_delft = rotation_about(_X, flex) @ rotation_about(_Z, abd) @ rotation_about(_Y, rot)
    R = _R_ISB_DELFT @ R_delft @ _R_ISB_DELFT.T
    sine = math.hypot(R[1, 0], R[1, 2])
    elevation = -math.atan2(sine, R[1, 1])
    if sine < _SINGULAR:
        return 0.0, elevation, math.atan2(R[0, 2], R[0, 0])
    return math.atan2(-R[0, 1], -R[2, 1]), elevation, math.atan2(-R[1, 0], R[1, 2])


def shoulder_from_isb(plane: float, elevation: float, axial: float) -> tuple[float, float, float]:
    """Convert ISB's shoulder angles to sh_flex, sh_abd (within +-pi/2), sh_rot [rad]; at sh_abd +-pi/2 sh_flex is 0."""
    R_isb = rotation_about(_Y, plane) @ rotation_about(_X, elevation) @ rotation_about(_Y, axial)
    R = _R_ISB_DELFT.T @ R_isb @ _R_ISB_DELFT
    cosine = math.hypot(R[0, 0], R[0, 2])
    abd = math.atan2(-R[0, 1], cosine)
    if cosine < _SINGULAR:
        return 0.0, abd, math.atan2(-R[2, 0], R[2, 2])
    return math.atan2(R[2, 1], R[1, 1]), abd, math.atan2(R[0, 2], R[0, 0])


def _split(name: str) -> tuple[str, str]:
    side = side_of(name)
    return (f"{side}_", name.removeprefix(f"{side}_")) if side else ("", name)
