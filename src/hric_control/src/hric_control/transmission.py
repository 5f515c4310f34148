"""Transmissions between actuators and joints, read from the robot description."""

import logging
from collections.abc import Collection
from dataclasses import dataclass
from xml.etree import ElementTree

from hric_core.errors import DescriptionError
from hric_core.urdf import read
from hric_core.urdf.elements import as_number, parse

LOG = logging.getLogger("hric.transmission")
SIMPLE = ("transmission_interface/SimpleTransmission", "SimpleTransmission")
"""Names of the only supported type of transmission."""
INTERFACES = ("EffortJointInterface", "VelocityJointInterface", "PositionJointInterface", "JointStateInterface")
"""Hardware interfaces that a transmission may name, with or without "hardware_interface/" in front."""


@dataclass(frozen=True)
class SimpleTransmission:
    """Transmission with a constant ratio between one actuator and one joint.

    With reduction n and offset x0: x_actuator = n (x_joint - x0), v_actuator = n v_joint, tau_actuator = tau_joint / n.
    A negative n reverses the direction.

    Attributes:
        reduction: reduction n, actuator turns per joint turn [1], not 0.
        offset: offset x0, joint position at which the actuator position is zero [rad].
    """

    reduction: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        if self.reduction == 0.0:
            raise DescriptionError("a transmission's mechanicalReduction must not be 0")

    def joint_to_actuator_effort(self, effort: float) -> float:
        """Return the actuator effort for a joint effort [N m]."""
        return effort / self.reduction

    def joint_to_actuator_velocity(self, velocity: float) -> float:
        """Return the actuator velocity for a joint velocity [rad/s]."""
        return velocity * self.reduction

    def joint_to_actuator_position(self, position: float) -> float:
        """Return the actuator position for a joint position [rad]."""
        return (position - self.offset) * self.reduction


@dataclass(frozen=True, kw_only=True)
class Transmission(SimpleTransmission):
    """`<transmission>` of a robot description, between one actuator and one joint.

    Attributes:
        name: name of the transmission.
        type: short type name, "SimpleTransmission".
        joint: joint name.
        interfaces: hardware interfaces of the joint, short names, e.g. ("EffortJointInterface",).
        actuator: actuator name.
    """

    name: str
    type: str
    joint: str
    interfaces: tuple[str, ...]
    actuator: str


def parse_transmissions(urdf_xml: str) -> list[Transmission]:
    """Return all simple transmissions of a URDF, in the order of the document.

    Transmissions of another type, and those without a hardware interface, are ignored with one warning, as in
    ros_control.

    Raises:
        DescriptionError: a transmission has an unknown interface, an unknown joint or a reduction of 0, or a joint has
            two transmissions.
    """
    robot = read(urdf_xml)
    elements = {element: _foreign(element) for element in robot.element.findall("transmission")}
    if foreign := "; ".join(filter(None, elements.values())):
        LOG.warning(
            "transmissions are ignored: %s; their joints can only be commanded if they have a transmission of type %s",
            foreign,
            SIMPLE[0],
        )
    result = [_transmission(element, robot.joints) for element, reason in elements.items() if not reason]
    seen: dict[str, str] = {}
    for transmission in result:
        if transmission.joint in seen:
            raise DescriptionError(
                f"joint {transmission.joint} has two transmissions: {seen[transmission.joint]} and {transmission.name}"
            )
        seen[transmission.joint] = transmission.name
    return result


def robot_sim_type(urdf_xml: str) -> str | None:
    """Return the RobotHW type in a URDF's element `<gazebo><plugin><robotSimType>`; None if there is none."""
    for plugin in parse(urdf_xml).findall("gazebo/plugin"):
        if plugin.get("name") == "gazebo_ros_control" or "gazebo_ros_control" in plugin.get("filename", ""):
            text = (plugin.findtext("robotSimType") or "").strip()
            if text:
                return text
    return None


def _short(name: str) -> str:
    return name.strip().replace("::", "/").rpartition("/")[2]


def _foreign(element: ElementTree.Element) -> str:
    """Return a description of a transmission whose type is not supported, or an empty text."""
    kind = (element.findtext("type") or element.get("type") or "(missing)").strip().replace("::", "/")
    simple = kind in SIMPLE
    if (
        simple
        and element.find("joint/hardwareInterface") is None
        and element.find("actuator/hardwareInterface") is None
    ):
        kind, simple = f"{kind} without <hardwareInterface>", False
    joints = ", ".join(joint.get("name", "") for joint in element.findall("joint"))
    return "" if simple else f"{element.get('name') or '(without a name)'} of type {kind} (joints {joints})"


def _transmission(element: ElementTree.Element, joints: Collection[str]) -> Transmission:
    name = element.get("name", "")
    where = f"transmission {name or '(without a name)'}"
    joint, actuator = _only(element, "joint", where), _only(element, "actuator", where)
    joint_name = joint.get("name", "")
    if joint_name not in joints:
        raise DescriptionError(f"{where}: no joint {joint_name!r}; valid: {', '.join(sorted(joints))}")
    reduction = _number(actuator, joint, "mechanicalReduction", 1.0, where)
    if reduction == 0.0:
        raise DescriptionError(f"{where}: mechanicalReduction must not be 0")
    return Transmission(
        reduction,
        _number(joint, actuator, "offset", 0.0, where),
        name=name,
        type=_short(SIMPLE[0]),
        joint=joint_name,
        interfaces=_interfaces(joint, actuator, where),
        actuator=actuator.get("name", ""),
    )


def _only(element: ElementTree.Element, tag: str, where: str) -> ElementTree.Element:
    elements = element.findall(tag)
    if len(elements) != 1:
        raise DescriptionError(f"{where}: a SimpleTransmission needs exactly one <{tag}>; it has {len(elements)}")
    return elements[0]


def _interfaces(joint: ElementTree.Element, actuator: ElementTree.Element, where: str) -> tuple[str, ...]:
    # Older descriptions have the interface in the actuator's element.
    elements = joint.findall("hardwareInterface") or actuator.findall("hardwareInterface")
    names = tuple(_short(element.text or "") for element in elements)
    valid = ", ".join(f"hardware_interface/{name}" for name in INTERFACES)
    for name in names:
        if name not in INTERFACES:
            raise DescriptionError(f"{where}: no hardware interface {name!r}; valid: {valid}")
    return tuple(dict.fromkeys(names))


def _number(first: ElementTree.Element, second: ElementTree.Element, tag: str, default: float, where: str) -> float:
    for element in (first, second):
        text = element.findtext(tag)
        if text is not None:
            return as_number(text.strip(), f"{where}: {tag}")
    return default
