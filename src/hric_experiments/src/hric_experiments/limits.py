"""Limits of the joints as run.yaml keeps them: what is not limited is left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hric_control.joint_limits import load_limits
from hric_control.node import Node

FIELDS = ("lower", "upper", "velocity", "effort", "effort_rate")


def table(urdf_xml: str, node: Node | None, joint_names: Sequence[str]) -> dict[str, dict[str, float]]:
    """Limits per joint, from the description and the `joint_limits` parameters of the robot.

    Args:
        urdf_xml: robot description.
        node: the robot's namespace; None: the description alone.
        joint_names: which joints.

    Returns:
        Per joint any of lower, upper [rad], velocity [rad/s], effort [N m], effort_rate [N m/s].
    """
    result = {}
    for limits in load_limits(urdf_xml, node, joint_names):
        values = {field: float(getattr(limits, field)) for field in FIELDS}
        result[limits.name] = {field: value for field, value in values.items() if math.isfinite(value)}
    return result
