"""Robots that the server can emulate, Panda and FR3: descriptions, limits, protocol versions."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

import panda_description
from franka_hw_interface.limits import FrankaLimits, fr3_limits, franka_limits
from franka_sim.vacuum import with_pump
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, transform_from_rpy
from hric_core.geometry.transforms import rpy_from_rotation
from panda_description import config

JOINTS = 7
MAX_LOST_PACKETS = 20
"""Number of consecutive lost commands that ends a motion of the arm."""


@dataclass(frozen=True)
class RobotKind:
    """Kind of robot.

    Attributes:
        arm_id: prefix of joints and links.
        version: protocol version of its control box.
        urdf: function that returns the URDF for plant and box; arguments: with hand, with collision shapes.
        limited: function that replaces the limits in a URDF of the Panda by this robot's; arguments: URDF, arm_id.
        served_urdf: function that returns the URDF for clients, without a hand.
        limits: function that returns the limits of the arm.
        accelerometers: function that returns the poses of the accelerometers in their links, shape (4, 4), by name:
            those on the top, then those on the bottom of links 0 to 5.
    """

    arm_id: str
    version: int
    urdf: Callable[[bool, bool], str]
    limited: Callable[[str, str], str]
    served_urdf: Callable[[], str]
    limits: Callable[[], FrankaLimits]
    accelerometers: Callable[[], dict[str, FloatArray]] = dict

    def description(self, hand: bool, vacuum: bool, collision: bool) -> str:
        """Return the URDF for plant and control box.

        Args:
            hand: True: with a hand, unless there is a vacuum gripper.
            vacuum: True: with a vacuum gripper.
            collision: True: with collision shapes.
        """
        urdf_xml = self.urdf(hand and not vacuum, collision)
        return with_pump(urdf_xml, self.arm_id) if vacuum else urdf_xml


def _joint(root: ElementTree.Element, name: str) -> ElementTree.Element:
    if joints := [joint for joint in root.iterfind("joint") if joint.get("name") == name]:
        return joints[0]
    raise DescriptionError(f"the robot description has no joint {name}")


def fr3_limited(urdf_xml: str, arm_id: str) -> str:
    """Return a description of the Panda with the limits of the FR3.

    Args:
        urdf_xml: robot description.
        arm_id: prefix of the joint names.
    """
    root = ElementTree.fromstring(urdf_xml)
    values = config("limits_fr3")
    for i in range(JOINTS):
        joint = _joint(root, f"{arm_id}_joint{i + 1}")
        limits = {name: str(values[name][i]) for name in ("lower", "upper", "velocity", "effort")}
        for element in joint.iterfind("limit"):
            element.attrib.update(limits)
        for element in joint.iterfind("safety_controller"):
            element.attrib.update(soft_lower_limit=limits["lower"], soft_upper_limit=limits["upper"])
    return ElementTree.tostring(root, encoding="unicode")


def fr3_urdf(hand: bool = True, collision: bool = True) -> str:
    """Return the URDF of the FR3, with or without hand and collision shapes."""
    urdf_xml = panda_description.load(arm_id="fr3", inertials="fr3", hand=hand, meshes=False, collision=collision)
    return fr3_limited(urdf_xml, "fr3")


def fr3_accelerometers() -> dict[str, FloatArray]:
    """Return the poses of the FR3's accelerometers by the names of their links, such as `link0_accelerometer_top`."""
    rows = [(side, i, row) for side, rows in config("accelerometers_fr3").items() for i, row in enumerate(rows)]
    return {
        f"link{i}_accelerometer_{side}": transform_from_rpy(row["xyz"], [math.radians(x) for x in row["rpy"]])
        for side, i, row in rows
    }


def fr3_served_urdf() -> str:
    """Return the URDF for a client of protocol 10.

    It has the joints `joint1` to `joint7` with position-dependent velocity limits, the flange `link8`, inertial
    parameters and the frames of the accelerometers, but no hand: the mass of a hand is part of the state, and its
    finger joints would be mistaken for joints of the arm.
    """
    root = ElementTree.fromstring(fr3_urdf(hand=False, collision=False))
    values = config("limits_fr3")
    for i in range(JOINTS):
        limits = {name: str(values[name][i]) for name in ("velocity_offset", "deceleration_limit")}
        ElementTree.SubElement(_joint(root, f"fr3_joint{i + 1}"), "position_based_velocity_limits", limits)
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for kind in ("transmission", "gazebo"):
        for element in root.findall(kind):
            root.remove(element)
    for element in root.iter():
        for key in ("name", "link"):
            if key in element.attrib:
                element.attrib[key] = element.attrib[key].removeprefix("fr3_")
    for name, T in fr3_accelerometers().items():
        ElementTree.SubElement(root, "link", name=name)
        joint = ElementTree.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
        pose = {"xyz": T[:3, 3].tolist(), "rpy": rpy_from_rotation(T[:3, :3])}
        ElementTree.SubElement(joint, "origin", {key: " ".join(map(str, row)) for key, row in pose.items()})
        ElementTree.SubElement(joint, "parent", link=name.partition("_")[0])
        ElementTree.SubElement(joint, "child", link=name)
    return ElementTree.tostring(root, encoding="unicode")


def _panda_urdf(hand: bool, collision: bool) -> str:
    return panda_description.load(hand=hand, meshes=False, collision=collision)


ROBOTS: Mapping[str, RobotKind] = {
    "panda": RobotKind(
        "panda", 5, _panda_urdf, lambda urdf_xml, _: urdf_xml, lambda: _panda_urdf(False, False), franka_limits
    ),
    "fr3": RobotKind("fr3", 10, fr3_urdf, fr3_limited, fr3_served_urdf, fr3_limits, fr3_accelerometers),
}
"""Robots by the name that `--robot` selects."""
