"""Comparison of joint angles with those that the laboratory's software wrote into the same file.

The angles of Plug-in Gait are those of its own axes, which it builds from single markers; a constant difference between
both comes from the definitions, and is shown separately.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hric_core.geometry import FloatArray

PLUG_IN_GAIT = {
    "el_flex": ("ElbowAngles", 0, 1.0),
    "hip_flex": ("HipAngles", 0, 1.0),
    "hip_abd": ("HipAngles", 1, -1.0),
    "knee_flex": ("KneeAngles", 0, 1.0),
    "ankle_flex": ("AnkleAngles", 0, 1.0),
}
"""Name, column and sign of the angle by joint without its side, as in Vicon's Plug-in Gait Reference Guide."""
TRUNK = ("trunk_flex", "RSpineAngles", 0, 1.0)
"""Joint of the trunk, with name, column and sign of its angle."""


class AngleDifference(NamedTuple):
    """Difference of one joint angle from that of the laboratory's software.

    Attributes:
        joint: name of the joint.
        theirs: name of the angle in the file.
        frames: number of frames in which both are known.
        rms: root mean square of the difference [rad].
        offset: mean of the difference [rad].
        varying: root mean square of the difference without its mean [rad].
    """

    joint: str
    theirs: str
    frames: int
    rms: float
    offset: float
    varying: float


def compared(q: Mapping[str, FloatArray], angles: Mapping[str, FloatArray]) -> list[AngleDifference]:
    """Return the differences of the joints of which both angles are known.

    Args:
        q: angles by joint, shape (n,) each [rad]; NaN: not known.
        angles: angles of the file by name, shape (n, 3) each [deg].
    """
    rows = [TRUNK] + [
        (f"{side}_{joint}", f"{side[0].upper()}{name}", column, sign)
        for joint, (name, column, sign) in PLUG_IN_GAIT.items()
        for side in ("right", "left")
    ]
    found = []
    for joint, name, column, sign in rows:
        if joint not in q or name not in angles:
            continue
        off = q[joint] - sign * np.radians(angles[name][:, column])
        off = (off + np.pi) % (2.0 * np.pi) - np.pi
        if len(off := off[np.isfinite(off)]):
            rms, offset = float(np.sqrt(np.mean(off**2))), float(off.mean())
            found.append(AngleDifference(joint, name, len(off), rms, offset, float(off.std())))
    return found
