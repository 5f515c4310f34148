"""Lines that draw muscles: points of a model's muscle paths in the resting posture, attached to the arm's segments."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.muscles.anatomy import SEGMENTS, MusclePath
from hric_human.muscles.fitting.fit import rounded
from hric_human.muscles.fitting.sample import R_LINK_OPENSIM

REST = {"sh_flex": math.radians(20.0), "sh_abd": math.radians(15.0), "el_flex": math.radians(80.0)}
"""Joint angles of the resting posture of `hric_human.control`, in which lines are drawn; all others are 0 [rad]."""
NEAR = 1e-3
"""Distance below which points of a line are merged [m]."""
Frames = Mapping[str, tuple[FloatArray, FloatArray]]
"""Frame of each of SEGMENTS in the ground: rotation with axes x right, y up, z back, shape (3, 3), and origin [m]."""


def resting(joints: Sequence[str]) -> FloatArray:
    """Return the angles of joints in the resting posture, shape (m,) [rad]."""
    return np.array([REST.get(name, 0.0) for name in joints])


def muscle_path(
    points: Sequence[tuple[str, FloatArray]], segment_of: Callable[[str], str], frames: Frames
) -> MusclePath:
    """Return the points through which a muscle is drawn, in axes of the arm's segments.

    Args:
        points: body and position in the ground [m], from end to end.
        segment_of: function from a body to one of SEGMENTS.
        frames: frames of the segments.
    """
    path, last = list[tuple[str, tuple[float, float, float]]](), None
    for body, position in points:
        segment = segment_of(body)
        if last is not None and last[0] == segment and np.linalg.norm(position - last[1]) < NEAR:
            continue
        R, origin = frames[segment]
        x, y, z = (R_LINK_OPENSIM @ R.T @ (position - origin)).tolist()
        path.append((segment, (rounded(x), rounded(y), rounded(z))))
        last = segment, position
    return tuple(path)


def frames_of(
    R_thorax: FloatArray, right: FloatArray, shoulder: FloatArray, elbow: FloatArray, wrist: FloatArray
) -> Frames:
    """Return the frames of SEGMENTS in the ground; those of the arm are along the lines between joint centres.

    Args:
        R_thorax: rotation of the thorax in the ground, shape (3, 3).
        right: axis of elbow flexion in the ground, shape (3,).
        shoulder: joint centre in the ground, shape (3,) [m].
        elbow: joint centre in the ground, shape (3,) [m].
        wrist: joint centre in the ground, shape (3,) [m].
    """
    upper_arm, forearm = _along(shoulder - elbow, right), _along(elbow - wrist, right)
    return dict(zip(SEGMENTS, ((R_thorax, shoulder), (upper_arm, shoulder), (forearm, elbow)), strict=True))


def _along(bone: FloatArray, right: FloatArray) -> FloatArray:
    """Return unit axes right, up, back as columns, shape (3, 3): up along the bone, right near `right`."""
    up = bone / np.linalg.norm(bone)
    across = right - up * (up @ right)
    across /= np.linalg.norm(across)
    return np.array([across, up, np.cross(across, up)]).T
