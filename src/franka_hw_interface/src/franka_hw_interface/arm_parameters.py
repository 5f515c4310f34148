"""Parameters that the simulated and the real arm share, read and checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import panda_description
from hric_control.errors import ParameterError
from hric_control.joint_limits import KINDS, JointLimits, load_limits
from hric_control.limit_loading import DEFAULT_KINDS
from hric_control.node import Node


def numbers(value: Any, n: int, where: str) -> list[float]:
    """A list of n finite numbers.

    Raises:
        ParameterError: it is not one.
    """
    valid = isinstance(value, list | tuple) and all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in value)
    if not valid or len(value) != n:
        raise ParameterError(f"{where} must be a list of {n} finite numbers; got {value!r}")
    return [float(x) for x in value]


def read_arm_id(node: Node) -> str:
    """Prefix of joints and links."""
    value = node.param("arm_id", "panda")
    if not isinstance(value, str) or not value:
        raise ParameterError(f"{node.resolve('arm_id')} must be a non-empty string; got {value!r}")
    return value


def read_limits(urdf_xml: str, root_node: Node, node: Node, arm_id: str, joint_names: Sequence[str]) -> list[JointLimits]:
    """Limits to enforce: description, over it `joint_limits/<joint>`, and Franka's own torque rate where neither gives one.

    `enforce_limits`: true (all but acceleration and jerk), false, or a list of kinds.
    """
    value, where = node.param("enforce_limits", True), node.resolve("enforce_limits")
    if isinstance(value, bool):
        kinds: Sequence[str] = DEFAULT_KINDS if value else ()
    elif isinstance(value, list | tuple) and all(kind in KINDS for kind in value):
        kinds = value
    else:
        raise ParameterError(f"{where} must be true, false or a list of {', '.join(KINDS)}; got {value!r}")
    limits = load_limits(urdf_xml, root_node, joint_names, tuple(kinds))
    if "effort_rate" not in kinds:
        return limits
    own = panda_description.joint_limits(arm_id)
    return [replace(limit, effort_rate=own[limit.name].effort_rate) if math.isinf(limit.effort_rate) else limit for limit in limits]
