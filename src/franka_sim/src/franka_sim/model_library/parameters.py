"""The arm's parameters as C constants, from the URDF."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from franka_hw_interface.urdf_chain import SerialChain, parse_chain
from hric_control import urdf
from hric_control.errors import DescriptionError, UnknownNameError

FloatArray = npt.NDArray[np.float64]

JOINTS = 7
_Z = np.array([0.0, 0.0, 1.0])


def arm_without_tool(urdf_xml: str, arm_id: str) -> str:
    """The URDF without what hangs on `<arm_id>_link8` and without that link's own mass: what is left is the arm, links 1 to 7.

    The counterpart is `KdlFrankaModel.ee_inertial`, exactly what is left out here.

    Raises:
        UnknownNameError: no such link.
    """
    robot, flange = urdf.parse(urdf_xml), f"{arm_id}_link8"
    links = {str(link.get("name")): link for link in robot.findall("link")}
    if flange not in links:
        raise UnknownNameError("link", flange, links, "the robot description")
    for inertial in links[flange].findall("inertial"):
        links[flange].remove(inertial)
    children: dict[str, list[tuple[ElementTree.Element, str]]] = {}
    for joint in urdf.joints(robot).values():
        parent, child = ("" if end is None else end.get("link", "") for end in (joint.find("parent"), joint.find("child")))
        children.setdefault(parent, []).append((joint, child))
    beyond = [flange]
    for link in beyond:
        for joint, child in children.pop(link, ()):
            robot.remove(joint)
            if child in links:
                robot.remove(links[child])
                beyond.append(child)
    return ElementTree.tostring(robot, encoding="unicode")


def arm_chain(urdf_xml: str, arm_id: str) -> SerialChain:
    """The seven links of the arm, without tool.

    Raises:
        DescriptionError: not seven joints that turn about their z axes.
    """
    chain = parse_chain(arm_without_tool(urdf_xml, arm_id), f"{arm_id}_link0", f"{arm_id}_link8")
    if len(chain.segments) != JOINTS:
        count = len(chain.segments)
        raise DescriptionError(f"the robot description: {count} moving joints between {chain.root} and {chain.tip}; a Franka arm has {JOINTS}")
    for segment in chain.segments:
        if segment.kind != "revolute" or not np.allclose(segment.axis, _Z, rtol=0.0, atol=1e-12):
            raise DescriptionError(
                f"joint {segment.joint} is {segment.kind} about {segment.axis.tolist()}; the joints of a Franka arm turn about z of their own frames"
            )
    return chain


def _array(name: str, rows: Iterable[FloatArray | float], width: int | None = None) -> str:
    """A C constant; repr of a float is exact."""
    if width is None:
        body = ", ".join(repr(float(np.asarray(row))) for row in rows)
        return f"static const double {name}[] = {{{body}}};\n"
    lines = ",\n  ".join("{" + ", ".join(repr(float(value)) for value in np.ravel(row)) + "}" for row in rows)
    return f"static const double {name}[][{width}] = {{\n  {lines}}};\n"


def c_parameters(urdf_xml: str, arm_id: str) -> str:
    """C declarations of the kinematics and inertias that `arm.c` works on; rotations and tensors row-major, SI units.

    Raises:
        DescriptionError, UnknownNameError: the URDF does not hold such an arm.
    """
    chain = arm_chain(urdf_xml, arm_id)
    poses, bodies = [segment.T_parent_joint for segment in chain.segments], [segment.inertial for segment in chain.segments]
    return "".join(
        [
            _array("JOINT_R", (T[:3, :3] for T in poses), 9),
            _array("JOINT_P", (T[:3, 3] for T in poses), 3),
            _array("LINK_MASS", (body.mass for body in bodies)),
            _array("LINK_COM", (body.com for body in bodies), 3),
            _array("LINK_INERTIA", (body.inertia for body in bodies), 9),
            _array("FLANGE_R", chain.T_last_tip[:3, :3].ravel().tolist()),
            _array("FLANGE_P", chain.T_last_tip[:3, 3].tolist()),
        ]
    )
