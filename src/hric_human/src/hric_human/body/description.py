"""Description of a subject's body: its URDF and the tables that belong to it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_core.geometry import FloatArray, MassProperties, homogeneous
from hric_core.summation import total
from hric_core.urdf import Shape, write_inertial, write_origin, write_shape
from hric_human.body.joints import BodyJoint, joints
from hric_human.body.markers import AttachedMarker, markers
from hric_human.body.regions import Region, regions
from hric_human.body.segments import ROOT, BodySegment, Builder, segments
from hric_human.body.subject import Subject

JOINT_SHARE = 0.01
"""Mass of each auxiliary link as share of its segment's mass [1]; project default, unconfirmed.

Several joints at one point (a shoulder) need auxiliary links between them, and engines need a mass in each. These links
are balls around the joint centre, whose inertia is the same in any rotation. The segment is lighter by their mass, so
the sum has the table's mass and inertia in any pose.
"""
MAX_EFFORT, MAX_VELOCITY = 300.0, 20.0
"""Limits [N m], [rad/s] of all joints, which URDF requires (project default, unconfirmed).

The strength of the person is limited separately, see `hric_human.control.strength`.
"""
COLOURS = {
    "head": (0.80, 0.64, 0.54, 1.0),
    "torso": (0.57, 0.66, 0.76, 1.0),
    "pelvis": (0.45, 0.52, 0.63, 1.0),
    "upper_arm": (0.66, 0.73, 0.55, 1.0),
    "forearm": (0.86, 0.76, 0.54, 1.0),
    "hand": (0.79, 0.55, 0.52, 1.0),
    "thigh": (0.62, 0.56, 0.70, 1.0),
    "shank": (0.50, 0.68, 0.65, 1.0),
    "foot": (0.62, 0.61, 0.58, 1.0),
}
"""Colour of each segment in the URDF: red, green, blue, opacity, 0 to 1 each."""
KEPT = 8
"""Number of bodies that are kept in memory: a run and its verdict need the same one several times."""
SEATED = {"hip_flex": 90.0, "knee_flex": 90.0}
"""Joint angles that are not zero in the seated rest pose, on both sides [deg]."""


@dataclass(frozen=True)
class Body:
    """Articulated body of a subject: its URDF, and its joints, segments, regions and markers by name.

    Attributes:
        subject: subject from whom the body was generated.
        urdf: URDF as text; its root link is `human_base`.
        joints: joints by name, in order.
        segments: segments by name, from the root outwards.
        regions: regions of ISO/TS 15066, by link.
        markers: markers by name.
        rest: angles of the rest pose that are not zero, by joint [rad].
        base_height: height of `human_base` above the floor in the rest pose [m]; counts legs that the URDF lacks.
    """

    subject: Subject
    urdf: str
    joints: Mapping[str, BodyJoint]
    segments: Mapping[str, BodySegment]
    regions: Mapping[str, tuple[Region, ...]]
    markers: Mapping[str, AttachedMarker]
    rest: Mapping[str, float]
    base_height: float

    @property
    def total_mass(self) -> float:
        """Sum of the masses of the modelled segments [kg]."""
        return total(segment.mass.mass for segment in self.segments.values())


@dataclass(frozen=True)
class SubjectKey:
    """Key of a cache for a subject, compared by its text, since a subject's mappings have no hash."""

    subject: Subject = field(compare=False)
    text: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", repr(self.subject))


def describe(subject: Subject) -> Body:
    """Generate the body of a subject; bodies are shared, so nothing in them must be changed.

    Raises:
        ParameterError: a segment whose mass is too large for a capsule of its length.
    """
    return _described(SubjectKey(subject))


@lru_cache(maxsize=KEPT)
def _described(key: SubjectKey) -> Body:
    subject = key.subject
    made, moved = segments(subject), joints(subject.chains)
    seated = subject.posture == "seated"
    rest = {joint.name: math.radians(SEATED[joint.row.name]) for joint in moved if seated and joint.row.name in SEATED}
    return Body(
        subject,
        _urdf(f"human_{subject.code}", made, moved),
        {joint.name: joint for joint in moved},
        {segment.name: segment for segment in made},
        regions(made, subject.dominant_hand),
        {marker.name: marker for marker in markers(made)},
        rest,
        _base_height(subject, seated),
    )


def _base_height(subject: Subject, seated: bool) -> float:
    lengths = Builder(subject).lengths
    legs = lengths["ankle_height"] + lengths["shank"] + lengths["thigh"] * (not seated)
    if "trunk" in subject.chains:
        return legs
    return (
        legs + sum(lengths[name] for name in ("lower_trunk", "middle_trunk", "upper_trunk")) - lengths["shoulder_drop"]
    )


def _urdf(name: str, made: list[BodySegment], moved: list[BodyJoint]) -> str:
    robot = Element("robot", name=name)
    SubElement(robot, "link", name=ROOT)
    for segment in made:
        joints = [joint for joint in moved if joint.link == segment.link]
        mass, ball = segment.mass, _ball(segment)
        for joint in joints[:-1]:
            write_inertial(SubElement(robot, "link", name=joint.child), ball.mass, np.eye(4), ball.inertia)
            mass += MassProperties(-ball.mass, -ball.com, -ball.inertia)
        _write_segment(robot, segment, mass)
        if not joints:
            _write_joint(robot, f"{segment.link}_joint", "fixed", segment.parent, segment.link, segment.p_parent_link)
        parent, at = segment.parent, segment.p_parent_link
        for joint in joints:
            _write_motion(_write_joint(robot, joint.name, "revolute", parent, joint.child, at), joint)
            parent, at = joint.child, np.zeros(3)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _ball(segment: BodySegment) -> MassProperties:
    """Return the mass properties of an auxiliary link: a ball of the segment's radius about the joint centre."""
    mass = JOINT_SHARE * segment.mass.mass
    return MassProperties(mass, np.zeros(3), 0.4 * mass * segment.radius**2 * np.eye(3))


def _write_segment(robot: Element, segment: BodySegment, mass: MassProperties) -> None:
    link = SubElement(robot, "link", name=segment.link)
    write_inertial(link, mass.mass, homogeneous(np.eye(3), mass.com), mass.inertia)
    for purpose in ("visual", "collision"):
        for shape in _capsule(segment):
            write_shape(link, purpose, shape, shape.T_link_shape)


def _capsule(segment: BodySegment) -> list[Shape]:
    """Return a cylinder with a ball at each end, since URDF has no capsule."""
    start, end = segment.straight
    R, length, colour = _rotation_along(end - start), float(np.linalg.norm(end - start)), COLOURS[segment.kind]
    cylinder = Shape(
        segment.link, "cylinder", (segment.radius, length), homogeneous(R, 0.5 * (start + end)), "", colour
    )
    balls = [
        Shape(segment.link, "sphere", (segment.radius,), homogeneous(np.eye(3), p), "", colour) for p in (start, end)
    ]
    return [cylinder, *balls]


def _rotation_along(direction: FloatArray) -> FloatArray:
    """Return a rotation that turns z along one of the axes, shape (3, 3)."""
    return np.roll(np.eye(3), int(np.argmax(np.abs(direction))) + 1, axis=0)


def _write_joint(robot: Element, name: str, kind: str, parent: str, child: str, at: FloatArray) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    write_origin(joint, homogeneous(np.eye(3), at))
    return joint


def _write_motion(element: Element, joint: BodyJoint) -> None:
    SubElement(element, "axis", xyz=" ".join(f"{value:g}" for value in joint.axis + 0.0))
    lower, upper = map(repr, joint.range)
    SubElement(element, "limit", lower=lower, upper=upper, effort=repr(MAX_EFFORT), velocity=repr(MAX_VELOCITY))
