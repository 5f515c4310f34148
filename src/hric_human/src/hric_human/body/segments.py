"""Rigid segments of a subject's body: joint, mass, and shape as a capsule.

Axes of all links at the zero pose (standing upright, arms hanging, thumbs forward) are those of REP 103: x forward, y
left, z up. A link's origin is the joint that moves it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray, MassProperties
from hric_human.body.anthropometry import DE_LEVA, DENSITY, scaled_lengths, scaled_masses
from hric_human.body.subject import Subject

ROOT = "human_base"
"""Root link, without mass, at the midpoint of the hip joints, or of the shoulder joints if there are only arms.

The simulation fixes it in the world or moves it.
"""
LINKS = {
    "pelvis": "waist",
    "torso": "torso",
    "head": "head",
    "upper_arm": "shoulder",
    "forearm": "elbow",
    "hand": "wrist",
    "thigh": "hip",
    "shank": "knee",
    "foot": "ankle",
}
"""Link name of each segment as in REP 155 (human description): its joint, with the prefix r_ or l_ on a side.

REP 155 also appends an identifier of the person; here the ROS namespace distinguishes people.
"""
SIDES = {"right": -1.0, "left": 1.0}
"""Sign of y on each side."""
_AXES = {"forearm": (1, 0, 2), "hand": (1, 0, 2), "foot": (2, 1, 0)}
"""Index of de Leva's radius of gyration (0 sagittal, 1 transverse, 2 longitudinal) about x, y and z of the link.

Only for segments with another order than 0, 1, 2: a forearm in mid-position is rotated by 90 deg from the table's, and
a foot lies along x.
"""


@dataclass(frozen=True)
class BodySegment:
    """Rigid body segment: its link, mass properties, and shape as a capsule.

    Attributes:
        name: name with the side, "right_forearm".
        kind: name without the side.
        link: link of the description.
        parent: link to which the segment's joint is attached.
        p_parent_link: position of the joint, in axes of the parent, shape (3,) [m].
        mass: mass properties in axes of the link.
        start, end: ends of the segment's axis, proximal and distal (of a foot: heel and toe), in axes of the link,
            shape (3,) [m].
        radius: radius of the capsule [m].
        caps: for start and end of the axis: 1 if the capsule's round cap ends there, 0 if the cap extends beyond,
            around a joint.
    """

    name: str
    kind: str
    link: str
    parent: str
    p_parent_link: FloatArray
    mass: MassProperties
    start: FloatArray
    end: FloatArray
    radius: float
    caps: tuple[int, int]

    @property
    def length(self) -> float:
        """Length of the segment's axis [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def straight(self) -> tuple[FloatArray, FloatArray]:
        """Ends of the capsule's cylindrical part, in axes of the link, each of shape (3,) [m]."""
        step = self.radius / self.length * (self.end - self.start)
        return self.start + self.caps[0] * step, self.end - self.caps[1] * step


def side_of(name: str) -> str:
    """Return "right", "left", or "" (middle), from the name of a segment, joint or link."""
    return {"right": "right", "r": "right", "left": "left", "l": "left"}.get(name.partition("_")[0], "")


def link_name(kind: str, side: str) -> str:
    """Return the link of a segment of a kind in LINKS ("r_elbow": right forearm); side: "right", "left" or ""."""
    return f"{side[0]}_{LINKS[kind]}" if side else LINKS[kind]


def capsule_radius(volume: float, length: float, inside: int) -> float:
    """Return the radius of a capsule of a given volume [m].

    volume / pi = length r^2 + (4/3 - inside) r^3 is for 1/r a cubic equation without a quadratic term, solved by
    Cardano's formula.

    Args:
        volume: volume [m^3].
        length: length of the axis [m].
        inside: number of caps (0, 1 or 2) that end at an end of the axis; the others extend beyond.

    Returns:
        the radius; NaN if the axis is too short for the caps inside.
    """
    p, q = math.pi * length / volume, math.pi * (4.0 / 3.0 - inside) / volume
    root = (0.5 * q + complex(0.25 * q * q - p**3 / 27.0) ** 0.5) ** (1.0 / 3.0)
    radius = 1.0 / (root + p / (3.0 * root)).real
    return radius if radius > 0.0 and inside * radius <= length else math.nan


class Builder:
    """Builder of the segments of one subject.

    Attributes:
        lengths: segment lengths and joint distances by name [m]; measured ones replace the table's.
        masses: masses by segment, limbs of one side [kg]; measured ones replace the table's.
    """

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.lengths = scaled_lengths(subject.sex, subject.height) | dict(subject.lengths)
        self.masses = scaled_masses(subject.sex, subject.mass) | dict(subject.masses)

    def part(self, name: str, first: FloatArray, second: FloatArray) -> MassProperties:
        """Return the mass properties of a row of de Leva's table, placed between two points, each of shape (3,) [m]."""
        row, mass = DE_LEVA[self.subject.sex][name], self.masses[name]
        radii = self.lengths[name] * np.array([row.radii[axis] for axis in _AXES.get(name, (0, 1, 2))])
        return MassProperties(mass, first + row.com * (second - first), mass * np.diag(radii**2))

    def radius(self, rows: Sequence[str], length: float, inside: int) -> float:
        """Return the radius [m] of a capsule with the volume of one or several table rows. Raises ParameterError."""
        volume = sum(self.masses[row] / DENSITY[row] for row in rows)
        radius = capsule_radius(volume, length, inside)
        if math.isnan(radius):
            names = " and ".join(rows)
            raise ParameterError(
                f"subject {self.subject.code}: {1e3 * volume:.1f} l of {names} do not fit a capsule of {length:.3f} m; "
                f"valid: less mass, more height, or measured lengths or masses of {names}"
            )
        return radius

    def segment(
        self,
        kind: str,
        side: str,
        parent: str,
        at: FloatArray,
        parts: dict[str, MassProperties],
        axis: tuple[FloatArray, FloatArray],
        caps: tuple[int, int],
    ) -> BodySegment:
        """Return a segment of one or several rows of the table.

        Args:
            kind: name of the segment without the side.
            side: "right", "left" or "" (middle).
            parent: link to which the segment's joint is attached.
            at: position of the joint in axes of the parent, shape (3,) [m].
            parts: mass properties by row of the table, in axes of the link.
            axis: start and end of the segment's axis in axes of the link, shape (3,) each [m].
            caps: see `BodySegment`.
        """
        name = f"{side}_{kind}" if side else kind
        radius = self.radius(tuple(parts), float(np.linalg.norm(axis[1] - axis[0])), sum(caps))
        mass = sum(parts.values(), MassProperties())
        return BodySegment(name, kind, link_name(kind, side), parent, at, mass, *axis, radius, caps)

    def trunk(self) -> list[BodySegment]:
        """Return the segments pelvis, torso and head."""
        lower, middle, upper, head = (
            _up(self.lengths[name]) for name in ("lower_trunk", "middle_trunk", "upper_trunk", "head")
        )
        pelvis = self.part("lower_trunk", lower, _up(0.0))
        half = np.array([0.0, 0.5 * self.lengths["hip_width"], 0.0])
        waist = lower + np.array([self.subject.waist_forward, 0.0, 0.0])
        torso = {
            "upper_trunk": self.part("upper_trunk", middle + upper, middle),
            "middle_trunk": self.part("middle_trunk", middle, _up(0.0)),
        }
        skull = {"head": self.part("head", head, _up(0.0))}
        across = pelvis.com - half, pelvis.com + half
        return [
            self.segment("pelvis", "", ROOT, _up(0.0), {"lower_trunk": pelvis}, across, (0, 0)),
            self.segment("torso", "", LINKS["pelvis"], waist, torso, (_up(0.0), middle + upper), (1, 1)),
            self.segment("head", "", LINKS["torso"], middle + upper, skull, (_up(0.0), head), (0, 1)),
        ]

    def arm(self, side: str, parent: str, height: float) -> list[BodySegment]:
        """Return the segments of an arm; height: height of the shoulder above the parent link's origin [m]."""
        at = np.array([0.0, 0.5 * SIDES[side] * self.lengths["shoulder_width"], height])
        return self._hanging(side, parent, at, {"upper_arm": (0, 0), "forearm": (0, 0), "hand": (0, 1)})

    def leg(self, side: str) -> list[BodySegment]:
        """Return the segments thigh, shank and foot; the sole is one capsule radius below the foot's axis."""
        at = np.array([0.0, 0.5 * SIDES[side] * self.lengths["hip_width"], 0.0])
        upper = self._hanging(side, LINKS["pelvis"], at, {"thigh": (0, 0), "shank": (0, 0)})
        length = self.lengths["foot"]
        height = self.radius(["foot"], length, 2) - self.lengths["ankle_height"]
        heel = np.array([-self.lengths["heel_to_ankle"], 0.0, height])
        axis = heel, heel + np.array([length, 0.0, 0.0])
        parts = {"foot": self.part("foot", *axis)}
        ankle = _down(self.lengths["shank"])
        return [*upper, self.segment("foot", side, link_name("shank", side), ankle, parts, axis, (1, 1))]

    def _hanging(self, side: str, parent: str, at: FloatArray, caps: dict[str, tuple[int, int]]) -> list[BodySegment]:
        made = []
        for kind, ends in caps.items():
            axis = _up(0.0), _down(self.lengths[kind])
            made.append(self.segment(kind, side, parent, at, {kind: self.part(kind, *axis)}, axis, ends))
            parent, at = made[-1].link, axis[1]
        return made


def segments(subject: Subject) -> list[BodySegment]:
    """Return the segments of the subject's parts, from the root outwards. Raises ParameterError."""
    builder, made = Builder(subject), list[BodySegment]()
    lengths = builder.lengths
    parent, height = ROOT, 0.0
    for chain in subject.chains:
        side, _, limb = chain.rpartition("_")
        if limb == "trunk":
            made += builder.trunk()
            parent = LINKS["torso"]
            height = lengths["middle_trunk"] + lengths["upper_trunk"] - lengths["shoulder_drop"]
        elif limb == "arm":
            made += builder.arm(side, parent, height)
        else:
            made += builder.leg(side)
    return made


def _up(height: float) -> FloatArray:
    return np.array([0.0, 0.0, height])


def _down(length: float) -> FloatArray:
    return _up(-length)
