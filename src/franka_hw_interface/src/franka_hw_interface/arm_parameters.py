"""Parameters shared by the simulated and the real arm."""

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
    """Accept False, or an empty text instead."""
    if value is not False and value != "":
        raise ValueError


def collision_config(default: Any, false_text: str, default_text: str = "") -> Any:
    """Return the parameter `collision_config`: eight lists, or false, read as None; false_text: meaning of false."""
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
    """Return a list of n finite numbers. Raises ParameterError if the value is something else."""
    return list(parameters.numbers(n).checked(value, where))


def read_arm_id(node: Node) -> str:
    """Return the prefix of joints and links."""
    return str(ARM_ID.read(node, "arm_id"))


def read_limits(
    urdf_xml: str, root_node: Node, node: Node, arm_id: str, joint_names: Sequence[str]
) -> list[JointLimits]:
    """Return the limits to enforce, of the kinds in the parameter `enforce_limits` of `node`.

    They come from the description, overridden by `joint_limits/<joint>`; the default torque rate is Franka's.
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
