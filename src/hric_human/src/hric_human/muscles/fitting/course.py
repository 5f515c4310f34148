"""Where muscles go, to draw them: points of their paths in the resting posture, on the segments of our arm."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hric_control.geometry import FloatArray
from hric_human.muscles.anatomy import SEGMENTS, Course
from hric_human.muscles.fitting.fit import rounded
from hric_human.muscles.fitting.sample import R_LINK_OPENSIM

REST = {"sh_flex": math.radians(20.0), "sh_abd": math.radians(15.0), "el_flex": math.radians(80.0)}
"""The resting posture of `hric_human.control`; angles not named are 0 [rad]."""
NEAR = 1e-3
"""Points of a course that are nearer to each other are one [m]."""
Frames = Mapping[str, tuple[FloatArray, FloatArray]]
"""Of each of SEGMENTS: rotation of shape (3, 3) in x right, y up, z back, and origin [m], in the ground."""


def resting(joints: Sequence[str]) -> FloatArray:
    """Angles of joints in the resting posture, in which courses are taken, shape (m,) [rad]."""
    return np.array([REST.get(name, 0.0) for name in joints])


def course(points: Sequence[tuple[str, FloatArray]], segment_of: Callable[[str], str], frames: Frames) -> Course:
    """Of a muscle.

    Args:
        points: body and position in the ground [m], from end to end.
        segment_of: one of SEGMENTS of a body.
        frames: of the segments.
    """
    found, last = list[tuple[str, tuple[float, float, float]]](), None
    for body, position in points:
        segment = segment_of(body)
        if last is not None and last[0] == segment and np.linalg.norm(position - last[1]) < NEAR:
            continue
        R, origin = frames[segment]
        x, y, z = (R_LINK_OPENSIM @ R.T @ (position - origin)).tolist()
        found.append((segment, (rounded(x), rounded(y), rounded(z))))
        last = segment, position
    return tuple(found)


def frames_of(
    R_thorax: FloatArray, right: FloatArray, shoulder: FloatArray, elbow: FloatArray, wrist: FloatArray
) -> Frames:
    """As our segments lie: from joint to joint.

    Args:
        R_thorax: shape (3, 3).
        right: axis of flexion of the elbow, shape (3,).
        shoulder, elbow, wrist: centres, shape (3,) [m].
    """
    upper_arm, forearm = _along(shoulder - elbow, right), _along(elbow - wrist, right)
    return dict(zip(SEGMENTS, ((R_thorax, shoulder), (upper_arm, shoulder), (forearm, elbow)), strict=True))


def _along(bone: FloatArray, right: FloatArray) -> FloatArray:
    """Axes with up along a bone and right as near as that allows, shape (3, 3)."""
    up = bone / np.linalg.norm(bone)
    across = right - up * (up @ right)
    across /= np.linalg.norm(across)
    return np.array([across, up, np.cross(across, up)]).T
