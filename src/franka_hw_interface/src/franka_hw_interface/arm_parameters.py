"""ROS parameters that the simulated and the real Franka arm share."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import panda_description
from franka_hw_interface.arm_services import CollisionThresholds
from hric_control.limits import ENFORCE_LIMITS, JointLimits, load_limits
from hric_core import parameters
from hric_core.node import Node
from hric_core.parameters import Parameter, either, section, text

ARM_ID: Any = text("panda", empty=False, name="arm_id", text="prefix of joints and links")


def _false(value: Any, where: str, joints: Sequence[str]) -> None:
    """Accept False, or an empty text, which means the same. Raises ValueError for anything else."""
    if value is not False and value != "":
        raise ValueError


def collision_config(default: Any, false_text: str, default_text: str = "") -> Any:
    """Return the parameter `collision_config`: thresholds of contact and collision, or false, which is read as None.

    Args:
        default: default value.
        false_text: meaning of false, for the parameter's documentation.
        default_text: text for the default in the documentation.
    """
    return either(
        Parameter("bool", "false", _false),
        section(CollisionThresholds),
        default=default,
        name="collision_config",
        default_text=default_text,
        unit="N m, N",
        text=f"eight lists, as franka_ros names them; `false`: {false_text}",
    )


def numbers(value: Any, n: int, where: str) -> list[float]:
    """Return a value as a list of n finite numbers; where: name of the parameter. Raises ParameterError."""
    return list(parameters.numbers(n).checked(value, where))


def read_arm_id(node: Node) -> str:
    """Return the parameter `arm_id`: the prefix of joint and link names."""
    return str(ARM_ID.read(node, "arm_id"))


def read_limits(
    urdf_xml: str, root_node: Node, node: Node, arm_id: str, joint_names: Sequence[str]
) -> list[JointLimits]:
    """Return the joint limits to enforce; the parameter `enforce_limits` of `node` selects the kinds.

    The limits come from the robot description, overridden by parameters `joint_limits/<joint>` below `root_node`; the
    default limit of the torque rate is Franka's.
    """
    kinds = ENFORCE_LIMITS.read(node, "enforce_limits")
    limits = load_limits(urdf_xml, root_node, joint_names, kinds)
    if "effort_rate" not in kinds:
        return limits
    arm_limits = panda_description.joint_limits(arm_id)
    return [
        replace(limit, effort_rate=arm_limits[limit.name].effort_rate) if math.isinf(limit.effort_rate) else limit
        for limit in limits
    ]
