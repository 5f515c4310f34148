"""Joints of a body: one table with axis, positive sense, zero, range, and the corresponding angle of ISB.

A shoulder is three joints at one point, R_thorax_humerus = Rx(sh_flex) Rz(sh_abd) Ry(sh_rot) in axes X right, Y up, Z
back, the coordinates of the Delft shoulder model. It is singular at sh_abd 90 deg: there sh_flex and sh_rot rotate
about the same line, in a T-pose the arm's axis. A left joint is the mirror image of the right one, so that equal values
are mirrored poses.

ISB: Wu et al., J. Biomech. 35:543-548, 2002 (spine, hip, ankle) and 38:981-992, 2005 (shoulder, elbow, wrist), as
summarised in PMC10782867 table 2 for the arm, from memory for the rest; the knee is Grood & Suntay's 1983.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.body.segments import link_name

MIRROR = np.array([-1.0, 1.0, -1.0])
"""Factors of a right joint's axis (x, y, z) that give the left joint's; equal angles are then mirror-image poses."""

_AAOS = "AAOS, in Norkin & White's table A.1"
_VA_LEG = "38 CFR 4.71 plate II, as a summary of it"
_VA_SPINE = "38 CFR 4.71a plate V"
_VA_SPINE_OWN = f"{_VA_SPINE}, from memory, unconfirmed"
_OWN = "project default, unconfirmed"


@dataclass(frozen=True)
class JointRow:
    """Row of the table of joints: axis, range and ISB angle of one joint.

    Attributes:
        name: name without the side.
        moves: segment that the joint moves; of several joints with one segment, all but the last move auxiliary links.
        axis: axis of a right or middle joint at the zero pose, in axes of the body (x forward, y left, z up).
        lower, upper: range [deg].
        positive: direction of motion for a positive angle.
        zero: pose in which the angle is 0.
        isb: sign and offset [deg] of ISB's angle, isb = sign q + offset; None for the shoulder, see module `isb`.
        isb_angle: name and positive direction of ISB's angle.
        source: source of the range.
    """

    name: str
    moves: str
    axis: tuple[int, int, int]
    lower: float
    upper: float
    positive: str
    zero: str
    isb: tuple[int, float] | None
    isb_angle: str
    source: str


_SAME = (1, 0.0)
_OTHER = (-1, 0.0)
TRUNK = (
    JointRow("trunk_flex", "torso", (0, 1, 0), -30, 90, "forward", "upright", _OTHER, "extension +", _VA_SPINE),
    JointRow(
        "trunk_bend", "torso", (1, 0, 0), -30, 30, "to the right", "upright", _SAME, "bending right +", _VA_SPINE_OWN
    ),
    JointRow(
        "trunk_rot", "torso", (0, 0, 1), -30, 30, "to the left", "forward", _SAME, "rotation left +", _VA_SPINE_OWN
    ),
    JointRow("neck_flex", "head", (0, 1, 0), -45, 45, "forward", "upright", _OTHER, "extension +", _VA_SPINE),
    JointRow("neck_bend", "head", (1, 0, 0), -45, 45, "to the right", "upright", _SAME, "bending right +", _VA_SPINE),
    JointRow("neck_rot", "head", (0, 0, 1), -80, 80, "to the left", "forward", _SAME, "rotation left +", _VA_SPINE),
)
ARM = (
    JointRow("sh_flex", "upper_arm", (0, -1, 0), -60, 180, "arm forward", "hanging", None, "plane of elevation", _AAOS),
    JointRow(
        "sh_abd",
        "upper_arm",
        (-1, 0, 0),
        -45,
        180,
        "arm outward",
        "hanging",
        None,
        "elevation -",
        f"{_AAOS}; lower {_OWN}",
    ),
    JointRow(
        "sh_rot",
        "upper_arm",
        (0, 0, 1),
        -90,
        70,
        "inward (internal)",
        "elbow's axis sideward",
        None,
        "internal +",
        _AAOS,
    ),
    JointRow("el_flex", "forearm", (0, -1, 0), 0, 150, "hand to shoulder", "straight", _SAME, "flexion +", _AAOS),
    JointRow(
        "pro_sup",
        "forearm",
        (0, 0, 1),
        -80,
        80,
        "pronation",
        "mid-position, thumb forward",
        (1, 90.0),
        "pronation + from supinated",
        _AAOS,
    ),
    JointRow("wr_flex", "hand", (1, 0, 0), -70, 80, "towards the palm", "straight", _SAME, "flexion +", _AAOS),
    JointRow("wr_dev", "hand", (0, 1, 0), -20, 30, "to the little finger (ulnar)", "straight", _SAME, "ulnar +", _AAOS),
)
LEG = (
    JointRow("hip_flex", "thigh", (0, -1, 0), -30, 125, "thigh forward", "upright", _SAME, "flexion +", _VA_LEG),
    JointRow("hip_abd", "thigh", (-1, 0, 0), -25, 45, "thigh outward", "upright", _OTHER, "adduction +", _VA_LEG),
    JointRow("hip_rot", "thigh", (0, 0, 1), -60, 40, "inward (internal)", "knee forward", _SAME, "internal +", _VA_LEG),
    JointRow("knee_flex", "shank", (0, 1, 0), 0, 140, "heel to buttock", "straight", _SAME, "flexion +", _VA_LEG),
    JointRow(
        "ankle_flex",
        "foot",
        (0, -1, 0),
        -45,
        20,
        "toes up (dorsiflexion)",
        "sole level",
        _SAME,
        "dorsiflexion +",
        _VA_LEG,
    ),
    JointRow(
        "ankle_inv", "foot", (1, 0, 0), -15, 30, "sole inward (inversion)", "sole level", _SAME, "inversion +", _OWN
    ),
)
LIMBS = {"trunk": TRUNK, "arm": ARM, "leg": LEG}
ROWS = {row.name: row for limb in LIMBS.values() for row in limb}
_WORDS = {
    **{"sh": "shoulder", "el": "elbow", "wr": "wrist", "flex": "flexion", "abd": "abduction", "rot": "rotation"},
    **{"bend": "bending", "dev": "deviation", "inv": "inversion", "pro": "pronation and", "sup": "supination"},
}


def in_words(name: str) -> str:
    """Return the name of a joint in words: "right shoulder flexion" for right_sh_flex."""
    return " ".join(_WORDS.get(part, part) for part in name.split("_"))


@dataclass(frozen=True)
class BodyJoint:
    """Joint of a body.

    Attributes:
        name: name with the side, "right_el_flex".
        row: row of the joint in the table of joints.
        child: link that the joint moves directly; of several joints at one point, all but the last move an auxiliary
            link.
        link: link of the segment that the joint moves.
        axis: axis at the zero pose, in axes of the body, shape (3,).
        range: lower and upper end of the joint's range [rad].
    """

    name: str
    row: JointRow
    child: str
    link: str
    axis: FloatArray
    range: tuple[float, float]


def joints(chains: Sequence[str]) -> list[BodyJoint]:
    """Return the joints of chains such as "right_arm", in order."""
    made = []
    for chain in chains:
        side, _, limb = chain.rpartition("_")
        rows = LIMBS[limb]
        for row, after in zip(rows, (*rows[1:], None), strict=True):
            made.append(_joint(row, side, after is None or after.moves != row.moves))
    return made


def _joint(row: JointRow, side: str, last: bool) -> BodyJoint:
    link = link_name(row.moves, side)
    child = link if last else f"{link}_{row.name.partition('_')[2]}"
    axis = np.array(row.axis, dtype=np.float64) * (MIRROR if side == "left" else 1.0)
    name = f"{side}_{row.name}" if side else row.name
    return BodyJoint(name, row, child, link, axis, (math.radians(row.lower), math.radians(row.upper)))
