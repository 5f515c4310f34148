"""A robot description as links and joints with numbers, for all joint types; what cannot be meant is refused with the element's name."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from xml.etree.ElementTree import Element

import numpy as np

from hric_control import urdf as xml
from hric_control.errors import DescriptionError
from hric_control.plants.spatial import FloatArray, MassProperties, transform

ONE_COORDINATE = ("revolute", "continuous", "prismatic")
MOVING = (*ONE_COORDINATE, "planar", "floating")
NO_LIMIT = 1e4
"""A range that ends beyond this has no end there [rad or m]: descriptions write 1e16 and the like. Our choice."""
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Mimic:
    """q = multiplier * q of `joint` + offset [rad or m]."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint of the description.

    Attributes:
        T_parent_joint: pose of the joint (and child) frame at q = 0 in the parent link, shape (4, 4) [m].
        axis: unit vector in the joint frame, shape (3,).
        lower, upper: range [rad or m]; infinite where there is none, -+NO_LIMIT where it has one end.
        effort: `<limit>` value [N m or N], infinite where there is none (also if it is zero).
        damping: viscous friction [N m s/rad or N s/m].
        friction: Coulomb friction [N m or N].
        velocity: `<limit>` value [rad/s or m/s], infinite where there is none (also if it is not above zero).
    """

    name: str
    type: str
    parent: str
    child: str
    T_parent_joint: FloatArray
    axis: FloatArray
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None
    velocity: float = math.inf


@dataclass(frozen=True)
class Link:
    """A link of the description.

    Attributes:
        mass: centre of mass and tensor about it in axes of the link; None without `<inertial>`.
        visuals, collisions: their XML elements.
    """

    name: str
    mass: MassProperties | None
    visuals: list[Element] = field(default_factory=list)
    collisions: list[Element] = field(default_factory=list)


@dataclass(frozen=True)
class Robot:
    """A description: links in document order, joints from the root outwards, colours of its named materials (red, green, blue, opacity)."""

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    colours: dict[str, tuple[float, ...]] = field(default_factory=dict)


def read(urdf_xml: str) -> Robot:
    """The robot of a pure URDF text.

    Raises:
        DescriptionError: not XML, not a tree, or an element that cannot be used; the message names it.
    """
    try:
        root = xml.parse(urdf_xml)
    except ValueError as error:  # e.g. an encoding that Python does not know
        raise DescriptionError(f"the robot description cannot be read: {error}") from error
    links = {link.name: link for link in map(_link, _named(root, "link"))}
    joints = {joint.name: joint for joint in map(_joint, _named(root, "joint"))}
    if not links:
        raise DescriptionError("the robot description has no <link>; a robot needs at least one")
    base = _check_tree(links, joints)
    for joint in joints.values():
        _check_mimic(joint, joints)
    colours = {element.get("name", ""): colour(element, f"material {element.get('name')}") for element in root.iter("material")}
    known = {name: rgba for name, rgba in colours.items() if rgba is not None}
    return Robot(root.get("name", "") or "robot", base, links, _from_root(base, joints), known)


def floats(element: Element, attribute: str, count: int, default: str, where: str) -> list[float]:
    """`count` finite numbers of an attribute.

    Raises:
        DescriptionError: other than that; the message begins with `where`.
    """
    words = element.get(attribute, default).split()
    place = f"{where}: {attribute} of <{element.tag}>"
    if len(words) != count:
        raise DescriptionError(f"{place} must be {count} numbers; got {element.get(attribute)!r}")
    return [xml.as_number(word, place) for word in words]


def origin(element: Element | None, where: str) -> FloatArray:
    """Pose of an `<origin>` child (identity without one), shape (4, 4) [m]."""
    tag = None if element is None else element.find("origin")
    if tag is None:
        return np.eye(4)
    return transform(floats(tag, "xyz", 3, "0 0 0", where), floats(tag, "rpy", 3, "0 0 0", where))


def colour(material: Element, where: str) -> tuple[float, ...] | None:
    """Red, green, blue, opacity of a `<material>`, each from 0 to 1; None where it only refers to a name or a texture."""
    tag = material.find("color")
    return None if tag is None else tuple(min(max(value, 0.0), 1.0) for value in floats(tag, "rgba", 4, "", where))


def _named(root: Element, kind: str) -> list[Element]:
    found: set[str] = set()
    for place, element in enumerate(root.findall(kind), 1):
        name = element.get("name", "")
        if not name:
            raise DescriptionError(f"<{kind}> number {place} has no name; give it one")
        if name in found:
            raise DescriptionError(f"{kind} {name!r} stands twice; names of {kind}s must differ")
        found.add(name)
    return root.findall(kind)


def _link(element: Element) -> Link:
    name = element.get("name", "")
    return Link(name, _mass(element.find("inertial"), f"link {name}"), element.findall("visual"), element.findall("collision"))


def _mass(inertial: Element | None, where: str) -> MassProperties | None:
    if inertial is None:
        return None
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        raise DescriptionError(f"{where}: <inertial> needs <mass value=...> and <inertia ixx=... ...>, or leave <inertial> out")
    xx, xy, xz, yy, yz, zz = (xml.number(tensor, name, where) for name in TENSOR)
    about_com = MassProperties(xml.number(mass, "value", where), np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return about_com.moved(origin(inertial, where))


def _joint(element: Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    where = f"joint {name}"
    if kind not in (*MOVING, "fixed"):
        raise DescriptionError(f"{where}: unknown type {kind!r}; valid: {', '.join((*MOVING, 'fixed'))}")
    parent, child = (_end(element, side, where) for side in ("parent", "child"))
    fixed = Joint(name, kind, parent, child, origin(element, where), _axis(element, kind, where))
    if kind not in ONE_COORDINATE:
        return fixed
    lower, upper, effort = _limits(element, kind, where)
    dynamics = element.find("dynamics")
    damping, friction = (0.0 if dynamics is None else xml.number(dynamics, loss, where, 0.0) for loss in ("damping", "friction"))
    if damping < 0.0 or friction < 0.0:
        raise DescriptionError(f"{where}: damping {damping} and friction {friction} must not be negative: they would drive the joint")
    with_losses = replace(fixed, damping=damping, friction=friction, velocity=_velocity(element, where))
    return replace(with_losses, lower=lower, upper=upper, effort=effort, mimic=_mimic(element, where))


def _end(element: Element, side: str, where: str) -> str:
    tag = element.find(side)
    if tag is None or not tag.get("link"):
        raise DescriptionError(f"{where}: no <{side} link=...>")
    return tag.get("link", "")


def _axis(element: Element, kind: str, where: str) -> FloatArray:
    tag = element.find("axis")
    axis = np.array([1.0, 0.0, 0.0] if tag is None else floats(tag, "xyz", 3, "1 0 0", where))
    length = float(np.linalg.norm(axis))
    if kind in (*ONE_COORDINATE, "planar"):
        if length < 1e-6:
            raise DescriptionError(f"{where}: its axis {axis.tolist()} has no length; give it a direction")
        return np.asarray(axis / length)
    return np.array([1.0, 0.0, 0.0])


def _limits(element: Element, kind: str, where: str) -> tuple[float, float, float]:
    limit = element.find("limit")
    if limit is None:
        if kind != "continuous":
            raise DescriptionError(f"{where}: a {kind} joint needs <limit lower=... upper=... effort=... velocity=...>")
        return -math.inf, math.inf, math.inf
    lower, upper, effort = (xml.number(limit, name, where, 0.0) for name in ("lower", "upper", "effort"))
    if effort < 0.0:
        raise DescriptionError(f"{where}: its effort limit {effort} is negative")
    effort = effort or math.inf
    if kind == "continuous":
        return -math.inf, math.inf, effort
    if lower > upper:
        raise DescriptionError(f"{where}: its lower limit {lower} is above its upper one {upper}")
    return *sensible_range(lower, upper), effort


def _velocity(element: Element, where: str) -> float:
    limit = element.find("limit")
    velocity = 0.0 if limit is None else xml.number(limit, "velocity", where, 0.0)
    return velocity if velocity > 0.0 else math.inf


def sensible_range(lower: float, upper: float) -> tuple[float, float]:
    """A range [rad or m] as `Joint` has it: infinite where both ends are beyond NO_LIMIT."""
    if lower <= -NO_LIMIT and upper >= NO_LIMIT:
        return -math.inf, math.inf
    return max(lower, -NO_LIMIT), min(upper, NO_LIMIT)


def _mimic(element: Element, where: str) -> Mimic | None:
    tag = element.find("mimic")
    if tag is None:
        return None
    return Mimic(tag.get("joint", ""), xml.number(tag, "multiplier", where, 1.0), xml.number(tag, "offset", where, 0.0))


def _check_mimic(joint: Joint, joints: dict[str, Joint]) -> None:
    chain = [joint.name]
    while (mimic := joints[chain[-1]].mimic) is not None:
        where = f"joint {chain[-1]}"
        source = joints.get(mimic.joint)
        if source is None:
            raise DescriptionError(f"{where}: it mimics {mimic.joint!r}, which is no joint; valid: {', '.join(sorted(joints))}")
        if source.type not in ONE_COORDINATE:
            raise DescriptionError(f"{where}: it mimics {source.name}, which is {source.type}; a joint can mimic {', '.join(ONE_COORDINATE)} ones")
        if source.name in chain:
            raise DescriptionError(f"{where}: the joints mimic each other in a circle: {' -> '.join((*chain, source.name))}")
        chain.append(source.name)


def _check_tree(links: dict[str, Link], joints: dict[str, Joint]) -> str:
    parents: dict[str, str] = {}
    for joint in joints.values():
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(f"joint {joint.name}: no link {link!r}; valid: {', '.join(sorted(links))}")
        if joint.child in parents:
            raise DescriptionError(
                f"link {joint.child} has two parent joints, {parents[joint.child]} and {joint.name}: a loop, which URDF cannot hold; remove one"
            )
        parents[joint.child] = joint.name
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        raise DescriptionError(f"the description needs one root link; it has {len(roots)}: {', '.join(roots) or 'its joints form a cycle'}")
    return roots[0]


def _from_root(root: str, joints: dict[str, Joint]) -> dict[str, Joint]:
    children: dict[str, list[Joint]] = {}
    for joint in joints.values():
        children.setdefault(joint.parent, []).append(joint)
    ordered: dict[str, Joint] = {}
    stack = list(reversed(children.get(root, [])))
    while stack:
        joint = stack.pop()
        ordered[joint.name] = joint
        stack.extend(reversed(children.get(joint.child, [])))
    if lost := sorted(set(joints) - set(ordered)):
        raise DescriptionError(f"joints {', '.join(lost)} form a cycle that does not hang on the root link {root}; a URDF is a tree")
    return ordered
