"""Reading a controller's parameters: every refusal gives the full name and what would be valid. And the rhythm of what it publishes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from hric_control.errors import ParameterError
from hric_control.joint_limits import load_limits
from hric_control.node import REQUIRED, Node


def is_number(value: Any) -> bool:
    """Whether the value is a finite int or float (and not a bool)."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def joint_names(node: Node, parameter: str = "joints") -> list[str]:
    """The names in `parameter`: at least one, all different.

    Raises:
        ParameterError: missing or not such a list.
    """
    value = node.param(parameter)
    if isinstance(value, str):
        value = [value]
    good = isinstance(value, list) and value and all(isinstance(name, str) and name for name in value) and len(set(value)) == len(value)
    if not good:
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: a list of joint names, all different")
    return list(value)


def number(node: Node, parameter: str, default: float | Any = REQUIRED, *, minimum: float = -math.inf, above: float = -math.inf) -> float:
    """A finite number.

    Args:
        minimum: smallest valid value.
        above: the value must be greater than this.

    Raises:
        ParameterError: missing, not a finite number, or too small.
    """
    value = node.param(parameter, default)
    if not is_number(value) or value < minimum or value <= above:
        bound = f", not below {minimum:g}" if minimum > -math.inf else f", above {above:g}" if above > -math.inf else ""
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: a finite number{bound}")
    return float(value)


def flag(node: Node, parameter: str, default: bool) -> bool:
    """True or false.

    Raises:
        ParameterError: something else.
    """
    value = node.param(parameter, default)
    if not isinstance(value, bool):
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: true, false")
    return value


def per_joint(
    node: Node, parameter: str, joints: Sequence[str], default: float | Any = REQUIRED, *, minimum: float = -math.inf, above: float = -math.inf
) -> list[float]:
    """One number for all joints, a list in the order of the joints, or a dict joint -> number.

    Args:
        minimum: smallest valid value.
        above: the values must be greater than this.

    Raises:
        ParameterError: missing, wrong length or joint names, or a value that is not a finite number in range; names the joint.
    """
    value = node.param(parameter, default)
    where = node.resolve(parameter)
    values = _spread(value, joints, where)
    bound = f", not below {minimum:g}" if minimum > -math.inf else f", above {above:g}" if above > -math.inf else ""
    for joint, item in zip(joints, values, strict=True):
        if not is_number(item) or item < minimum or item <= above:
            raise ParameterError(f"{where} of {joint} is {item!r}; valid: a finite number{bound}")
    return [float(item) for item in values]


def _spread(value: Any, joints: Sequence[str], where: str) -> list[Any]:
    if isinstance(value, Mapping):
        missing, unknown = [j for j in joints if j not in value], [str(k) for k in value if k not in joints]
        if missing or unknown:
            wrong = "; ".join(filter(None, [f"missing {', '.join(missing)}" * bool(missing), f"unknown {', '.join(unknown)}" * bool(unknown)]))
            raise ParameterError(f"{where} has {wrong}; valid: one value for each of {', '.join(joints)}")
        return [value[joint] for joint in joints]
    if isinstance(value, list | tuple):
        if len(value) != len(joints):
            raise ParameterError(f"{where} has {len(value)} values; valid: {len(joints)}, for {', '.join(joints)}")
        return list(value)
    return [value] * len(joints)


def position_ranges(root_node: Node, joints: Sequence[str]) -> list[tuple[float, float]]:
    """(lower, upper) of each joint from the description and the parameters `joint_limits`; infinite without a description [rad or m]."""
    urdf_xml = root_node.search_param("robot_description", "")
    if not urdf_xml:
        return [(-math.inf, math.inf)] * len(joints)
    return [(limits.lower, limits.upper) for limits in load_limits(urdf_xml, root_node, joints, use=("position",))]


class Every:
    """True at a fixed rate of run time, without drift.

    Args:
        rate: [Hz]; 0 means never.
    """

    __slots__ = ("_next", "_period")

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate if rate > 0.0 else math.inf
        self._next = -math.inf if rate > 0.0 else math.inf

    def restart(self) -> None:
        """Due at the next call."""
        if self._period < math.inf:
            self._next = -math.inf

    def due(self, time: float) -> bool:
        """Whether a period has passed; `time`: run time [s]."""
        if time < self._next - 1e-9:
            return False
        self._next += self._period
        if self._next <= time:  # the first call, or the loop was away
            self._next = time + self._period
        return True
