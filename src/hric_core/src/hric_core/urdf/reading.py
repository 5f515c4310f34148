"""Reader of a URDF text; errors about invalid content name the element."""

from collections.abc import Mapping
from functools import lru_cache
from xml.etree.ElementTree import Element, register_namespace

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties, tensor
from hric_core.urdf.elements import number, numbers, origin, parse
from hric_core.urdf.limit_units import check_limit_units
from hric_core.urdf.robot import (
    BOUNDED,
    JOINT_TYPES,
    ONE_COORDINATE,
    Joint,
    Limit,
    Link,
    Mimic,
    Robot,
    SafetyController,
)
from hric_core.urdf.shapes import Colour, Shape, read_colour, read_shape

TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
ROTOR_INERTIA, GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"
"""Elements of an actuator with the inertia of its rotor [kg m^2] and the ratio of its gear, as Drake defines them."""
register_namespace("drake", "http://drake.mit.edu")  # descriptions that ElementTree has changed keep the prefix


def read(urdf_xml: str, source: str = "") -> Robot:
    """Return the robot that a URDF text describes. It is cached by the text, so it must not be changed.

    As in urdfdom, the first of several `<origin>`, `<inertial>`, `<axis>` or `<limit>` elements counts, and unknown
    elements and attributes are ignored.

    Args:
        urdf_xml: URDF text, with xacro expanded.
        source: name of the file, with which error messages begin; empty if there is only one description.

    Raises:
        DescriptionError: not XML; an unknown version; not one tree (several roots, a cycle, a joint to a missing link);
            a missing or duplicate name; an `<inertial>` without `<mass>` or `<inertia>`, or with a negative mass; an
            unknown joint type, an axis of length 0, limits that are missing, crossed, or in degrees or mm, negative
            damping or friction, a wrong mimic; an unknown geometry; a text that is not a finite number. The message
            names the element.
    """
    try:
        return _robot(urdf_xml)
    except DescriptionError as error:
        if not source:
            raise
        raise DescriptionError(f"{source}: {error}") from error


@lru_cache(maxsize=32)  # a bring-up reads the same description a dozen times
def _robot(urdf_xml: str) -> Robot:
    root = parse(urdf_xml)
    materials = [
        (element.get("name", ""), read_colour(element, f"material {element.get('name')}"))
        for element in root.iter("material")
    ]
    colours = {name: colour for name, colour in materials if colour is not None}
    links = {link.name: link for link in (_link(element, colours) for element in _named(root, "link"))}
    rotors = _rotors(root)
    joints = {joint.name: joint for joint in (_joint(element, rotors) for element in _named(root, "joint"))}
    if not links:
        raise DescriptionError("the robot description has no <link>; a robot needs at least one")
    base = _check_tree(links, joints)
    for joint in joints.values():
        _check_mimic(joint, joints)
    check_limit_units(joints.values())
    return Robot(root.get("name", "") or "robot", base, links, _from_root(base, joints), root)


def _named(root: Element, kind: str) -> list[Element]:
    names: set[str] = set()
    for index, element in enumerate(root.findall(kind), 1):
        name = element.get("name", "")
        if not name:
            raise DescriptionError(f"<{kind}> number {index} of the robot description has no name; give it one")
        if name in names:
            raise DescriptionError(f"{kind} {name!r} is defined twice; names of {kind}s must differ")
        names.add(name)
    return root.findall(kind)


def _link(element: Element, colours: Mapping[str, Colour]) -> Link:
    name = element.get("name", "")
    where = f"link {name}"

    def shapes(purpose: str) -> tuple[Shape, ...]:
        numbered = enumerate(element.findall(purpose), 1)
        return tuple(read_shape(shape, f"{where}: <{purpose}> number {number}", colours) for number, shape in numbered)

    return Link(name, _mass(element.find("inertial"), where), shapes("visual"), shapes("collision"))


def _mass(inertial: Element | None, where: str) -> MassProperties | None:
    if inertial is None:
        return None
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise DescriptionError(
            f"{where}: <inertial> needs <mass value=...> and <inertia ixx=... ...>, or leave <inertial> out"
        )
    about_com = tensor(*(number(inertia, name, where) for name in TENSOR))
    value = number(mass, "value", where)
    if value < 0.0:
        raise DescriptionError(f"{where}: its mass {value} kg is negative; correct its <inertial>")
    return MassProperties(value, np.zeros(3), about_com).moved(origin(inertial, where))


def _rotors(root: Element) -> dict[str, float]:
    """Return rotor inertias by joint, reflected to it [kg m^2 or kg], from Drake's elements in transmissions."""
    rotors = {}
    for transmission in root.iterfind("transmission"):
        for joint in transmission.iterfind("joint"):
            for tag in transmission.iter(ROTOR_INERTIA):
                where, ratio = f"rotor of joint {joint.get('name')}", next(transmission.iter(GEAR_RATIO), None)
                reduction = 1.0 if ratio is None else number(ratio, "value", where)
                rotors[joint.get("name", "")] = inertia = number(tag, "value", where) * reduction**2
                if inertia < 0.0:
                    raise DescriptionError(f"{where}: its inertia {inertia} kg m^2 is negative")
    return rotors


def _joint(element: Element, rotors: Mapping[str, float]) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    where = f"joint {name}"
    if kind not in JOINT_TYPES:
        raise DescriptionError(f"{where}: unknown type {kind!r}; valid: {', '.join(JOINT_TYPES)}")
    frame = (
        _end(element, "parent", where),
        _end(element, "child", where),
        origin(element, where),
        _axis(element, kind, where),
    )
    if kind not in ONE_COORDINATE:
        return Joint(name, kind, *frame)
    dynamics = element.find("dynamics")
    damping, friction = (
        0.0 if dynamics is None else number(dynamics, loss, where, 0.0) for loss in ("damping", "friction")
    )
    if damping < 0.0 or friction < 0.0:
        raise DescriptionError(
            f"{where}: damping {damping} and friction {friction} must not be negative: they would drive the joint"
        )
    return Joint(
        name,
        kind,
        *frame,
        _limit(element, kind, where),
        damping,
        friction,
        _mimic(element, where),
        _safety(element, where),
        rotors.get(name),
    )


def _end(element: Element, side: str, where: str) -> str:
    tag = element.find(side)
    if tag is None or not tag.get("link"):
        raise DescriptionError(f"{where}: no <{side} link=...>")
    return tag.get("link", "")


def _axis(element: Element, kind: str, where: str) -> FloatArray:
    tag = element.find("axis")
    if tag is None or kind not in (*ONE_COORDINATE, "planar"):
        return np.array([1.0, 0.0, 0.0])
    axis = np.array(numbers(tag, "xyz", 3, "1 0 0", where))
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise DescriptionError(f"{where}: its axis {axis.tolist()} has length 0; give it a direction")
    return np.asarray(axis / length)


def _limit(element: Element, kind: str, where: str) -> Limit | None:
    tag = element.find("limit")
    if tag is None:
        if kind in BOUNDED:
            raise DescriptionError(f"{where}: a {kind} joint needs <limit lower=... upper=... effort=... velocity=...>")
        return None
    effort, velocity = (number(tag, name, where) if name in tag.attrib else None for name in ("effort", "velocity"))
    limit = Limit(number(tag, "lower", where, 0.0), number(tag, "upper", where, 0.0), effort, velocity)
    if effort is not None and effort < 0.0:
        raise DescriptionError(f"{where}: its effort limit {effort} is negative")
    if kind in BOUNDED and limit.lower > limit.upper:
        raise DescriptionError(f"{where}: its lower limit {limit.lower} is above its upper one {limit.upper}")
    return limit


def _mimic(element: Element, where: str) -> Mimic | None:
    tag = element.find("mimic")
    if tag is None:
        return None
    return Mimic(tag.get("joint", ""), number(tag, "multiplier", where, 1.0), number(tag, "offset", where, 0.0))


def _safety(element: Element, where: str) -> SafetyController | None:
    tag = element.find("safety_controller")
    if tag is None:
        return None
    rest = (number(tag, name, where, 0.0) for name in ("k_position", "soft_lower_limit", "soft_upper_limit"))
    return SafetyController(number(tag, "k_velocity", where), *rest)


def _check_mimic(joint: Joint, joints: dict[str, Joint]) -> None:
    chain = [joint.name]
    while (mimic := joints[chain[-1]].mimic) is not None:
        where = f"joint {chain[-1]}"
        source = joints.get(mimic.joint)
        if source is None:
            raise DescriptionError(
                f"{where}: it mimics {mimic.joint!r}, which is not a joint; valid: {', '.join(sorted(joints))}"
            )
        if source.type not in ONE_COORDINATE:
            valid = ", ".join(ONE_COORDINATE)
            raise DescriptionError(f"{where}: it mimics {source.name}, a {source.type} joint; valid types: {valid}")
        if source.name in chain:
            raise DescriptionError(
                f"{where}: the joints mimic each other in a circle: {' -> '.join((*chain, source.name))}"
            )
        chain.append(source.name)


def _check_tree(links: dict[str, Link], joints: dict[str, Joint]) -> str:
    parents: dict[str, str] = {}
    for joint in joints.values():
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(f"joint {joint.name}: no link {link!r}; valid: {', '.join(sorted(links))}")
        if joint.child in parents:
            both = f"{parents[joint.child]} and {joint.name}"
            raise DescriptionError(
                f"link {joint.child} has two parent joints, {both}; a URDF must be a tree: remove one"
            )
        parents[joint.child] = joint.name
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        names = ", ".join(roots) or "its joints form a cycle"
        raise DescriptionError(f"the robot description needs one root link; it has {len(roots)}: {names}")
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
        raise DescriptionError(
            f"joints {', '.join(lost)} form a cycle that is not connected to the root link {root}; a URDF must be a "
            "tree"
        )
    return ordered
