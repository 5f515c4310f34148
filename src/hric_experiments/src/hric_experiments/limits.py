"""Limits of the joints as run.yaml keeps them: what is not limited is left out."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

from hric_control.joint_limits import load_limits
from hric_control.node import Node

MOVING = ("revolute", "prismatic", "continuous")
FIELDS = ("lower", "upper", "velocity", "effort", "effort_rate")


def table(urdf_xml: str, node: Node | None, joint_names: Sequence[str] | None = None) -> dict[str, dict[str, float]]:
    """Limits per joint, from the description and the `joint_limits` parameters of the robot.

    Args:
        urdf_xml: robot description.
        node: the robot's namespace; None: the description alone.
        joint_names: which joints; None: all that move by themselves.

    Returns:
        Per joint any of lower, upper [rad], velocity [rad/s], effort [N m], effort_rate [N m/s].
    """
    if joint_names is None:
        joints = ElementTree.fromstring(urdf_xml).findall("joint")
        joint_names = [joint.get("name", "") for joint in joints if joint.get("type") in MOVING and joint.find("mimic") is None]
    result: dict[str, dict[str, float]] = {}
    if not joint_names:
        return result
    for limits in load_limits(urdf_xml, node, joint_names):
        values = {field: float(getattr(limits, field)) for field in FIELDS}
        result[limits.name] = {field: value for field, value in values.items() if math.isfinite(value)}
    return result
