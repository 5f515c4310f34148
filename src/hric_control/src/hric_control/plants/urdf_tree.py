"""A URDF as links and joints with numbers in place of attributes; refuses what a physics engine could only guess."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from hric_control.errors import DescriptionError
from hric_control.plants.spatial import FloatArray, MassProperties, transform

MOVING_TYPES = ("revolute", "continuous", "prismatic")


@dataclass
class Link:
    """A link of the description.

    Attributes:
        mass: in the link frame; None when the description gives none.
        collisions, visuals: their XML elements.
    """

    name: str
    mass: MassProperties | None
    collisions: list[Element] = field(default_factory=list)
    visuals: list[Element] = field(default_factory=list)


@dataclass
class Joint:
    """A joint of the description.

    Attributes:
        T_parent_joint: pose of the joint (and child) frame at q = 0 in the parent link, shape (4, 4).
        axis: unit vector in the joint frame.
        lower, upper: range [rad or m], infinite where there is none.
        effort, velocity: the `<limit>` values [N m or N; rad/s or m/s], infinite where there are none.
        damping: viscous friction [N m s/rad or N s/m].
        friction: Coulomb friction [N m or N].
    """

    name: str
    type: str
    parent: str
    child: str
    T_parent_joint: FloatArray
    axis: tuple[float, ...]
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    friction: float


@dataclass
class UrdfTree:
    """A parsed description: links in document order, joints in the order of the tree from the root."""

    name: str
    root: str
    links: dict[str, Link]
    joints: list[Joint]


def _floats(element: Element | None, attribute: str, default: Sequence[float], where: str) -> list[float]:
    text = None if element is None else element.get(attribute)
    if text is None:
        return list(default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != len(default) or not all(map(math.isfinite, values)):
        raise DescriptionError(f'{where}: {attribute}="{text}" must be {len(default)} finite number(s)')
    return values


def origin(element: Element | None, where: str) -> FloatArray:
    """Pose of an `<origin>` element (identity when there is none), shape (4, 4)."""
    return transform(_floats(element, "xyz", (0.0, 0.0, 0.0), where), _floats(element, "rpy", (0.0, 0.0, 0.0), where))


def _mass(link: Element, where: str) -> MassProperties | None:
    inertial = link.find("inertial")
    if inertial is None:
        return None
    tensor = inertial.find("inertia")
    (mass,) = _floats(inertial.find("mass"), "value", (0.0,), where)
    if mass < 0.0:
        raise DescriptionError(f"{where}: mass {mass} kg is negative")
    xx, xy, xz, yy, yz, zz = (_floats(tensor, a, (0.0,), where)[0] for a in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    about_com = MassProperties(mass, np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return about_com.moved(origin(inertial.find("origin"), where))


def _limit(element: Element | None, attribute: str, where: str) -> float:
    value = _floats(element, attribute, (0.0,), where)[0] if element is not None and element.get(attribute) else 0.0
    return value if value > 0.0 else math.inf


def _joint(element: Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    where = f"joint {name}"
    if kind not in (*MOVING_TYPES, "fixed"):
        raise DescriptionError(f"{where}: type {kind!r} is not supported; valid: {', '.join((*MOVING_TYPES, 'fixed'))}")
    ends = [tag.get("link", "") if (tag := element.find(side)) is not None else "" for side in ("parent", "child")]
    axis = np.array(_floats(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where))
    length = float(np.linalg.norm(axis))
    if kind != "fixed" and length == 0.0:
        raise DescriptionError(f"{where}: its axis is zero")
    limit, dynamics = element.find("limit"), element.find("dynamics")
    (lower,) = _floats(limit, "lower", (0.0,), where)
    (upper,) = _floats(limit, "upper", (0.0,), where)
    bounded = kind in ("revolute", "prismatic") and limit is not None
    if bounded and lower > upper:
        raise DescriptionError(f"{where}: lower limit {lower} is above the upper one {upper}")
    return Joint(
        name,
        kind,
        ends[0],
        ends[1],
        origin(element.find("origin"), where),
        tuple((axis / (length or 1.0)).tolist()),
        lower if bounded else -math.inf,
        upper if bounded else math.inf,
        _limit(limit, "effort", where),
        _limit(limit, "velocity", where),
        _floats(dynamics, "damping", (0.0,), where)[0],
        _floats(dynamics, "friction", (0.0,), where)[0],
    )


def _from_root(links: dict[str, Link], joints: list[Joint]) -> tuple[str, list[Joint]]:
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(f"joint {joint.name}: no link {link!r}; valid: {', '.join(sorted(links))}")
    children: dict[str, list[Joint]] = {name: [] for name in links}
    for joint in joints:
        children[joint.parent].append(joint)
    roots = sorted(set(links) - {joint.child for joint in joints})
    if len(roots) != 1:
        raise DescriptionError(f"a description needs one root link; it has {len(roots)}: {', '.join(roots) or 'a closed loop'}")
    ordered = _depth_first(roots[0], children)
    if len({joint.child for joint in joints}) < len(joints) or len(ordered) < len(joints):
        raise DescriptionError("the links do not form a tree: a link has two parents, or joints close a loop")
    return roots[0], ordered


def _depth_first(root: str, children: dict[str, list[Joint]]) -> list[Joint]:
    ordered: list[Joint] = []
    stack = list(reversed(children[root]))
    while stack:
        joint = stack.pop()
        ordered.append(joint)
        stack.extend(reversed(children[joint.child]))
    return ordered


def parse_urdf(urdf_xml: str) -> UrdfTree:
    """Links and joints of a description.

    Args:
        urdf_xml: pure URDF (no xacro left in it).

    Raises:
        DescriptionError: not XML, not a tree, or an element that cannot be used; the message names it.
    """
    try:
        robot = ElementTree.fromstring(urdf_xml)
    except ElementTree.ParseError as error:
        raise DescriptionError(f"the description is not XML: {error}") from error
    if robot.tag != "robot":
        raise DescriptionError(f"the description starts with <{robot.tag}>; a URDF starts with <robot>")
    links: dict[str, Link] = {}
    for element in robot.findall("link"):
        name = element.get("name", "")
        if not name or name in links:
            raise DescriptionError(f"link names must exist and differ; got {name!r} after {', '.join(links) or 'none'}")
        links[name] = Link(name, _mass(element, f"link {name}"), element.findall("collision"), element.findall("visual"))
    joints = [_joint(element) for element in robot.findall("joint")]
    names = [joint.name for joint in joints]
    if len(set(names)) < len(names) or "" in names:
        raise DescriptionError(f"joint names must exist and differ; got {', '.join(map(repr, names))}")
    if not links:
        raise DescriptionError("the description has no link")
    root, ordered = _from_root(links, joints)
    return UrdfTree(robot.get("name", "robot"), root, links, ordered)
