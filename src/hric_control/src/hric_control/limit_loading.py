"""Reading joint limits: URDF first, parameters over it, with ros_control's names."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

from hric_control import urdf
from hric_control.errors import DescriptionError, ParameterError, UnknownNameError
from hric_control.limit_values import INFINITY, JointLimits, check_kinds
from hric_control.node import Node

# Switch of a group of parameters -> parameter -> (field, value that means "not limited").
_GROUPS: dict[str, dict[str, tuple[str, float]]] = {
    "has_position_limits": {"min_position": ("lower", -INFINITY), "max_position": ("upper", INFINITY)},
    "has_velocity_limits": {"max_velocity": ("velocity", INFINITY)},
    "has_effort_limits": {"max_effort": ("effort", INFINITY)},
    "has_effort_rate_limits": {"max_effort_rate": ("effort_rate", INFINITY)},
    "has_acceleration_limits": {"max_acceleration": ("acceleration", INFINITY)},
    "has_jerk_limits": {"max_jerk": ("jerk", INFINITY)},
    "has_soft_limits": {
        "k_position": ("k_position", 0.0),
        "k_velocity": ("k_velocity", 0.0),
        "soft_lower_limit": ("soft_lower", -INFINITY),
        "soft_upper_limit": ("soft_upper", INFINITY),
    },
}
_WRAPAROUND = "angle_wraparound"
_KNOWN = {_WRAPAROUND, *_GROUPS, *(name for group in _GROUPS.values() for name in group)}

DEFAULT_KINDS = ("position", "velocity", "effort", "effort_rate", "soft")


def load_limits(urdf_xml: str, node: Node | None, joint_names: Sequence[str], use: Sequence[str] = DEFAULT_KINDS) -> list[JointLimits]:
    """The limits of the joints, in order.

    Args:
        urdf_xml: robot description; `<limit>` and `<safety_controller>` of each joint are read.
        node: its parameters `joint_limits/<joint>/...` go before the URDF; None: the URDF alone.
        joint_names: which joints.
        use: kinds to keep, of `joint_limits.KINDS`; the others are returned as not limited.

    Raises:
        ParameterError, DescriptionError, UnknownNameError: with the joint and the parameter or element.
    """
    check_kinds(tuple(use))
    elements = urdf.joints(urdf.parse(urdf_xml))
    result = []
    for name in joint_names:
        if name not in elements:
            raise UnknownNameError("joint", name, elements, "the robot description")
        values = _from_urdf(name, elements[name])
        where = f"joint_limits/{name}"
        if node is not None and node.has_param(where):
            _override(values, node.param(where), node.resolve(where))
            limits = _build(name, values, node.resolve(where))
        else:
            limits = _build(name, values, "the robot description")
        result.append(limits.only(tuple(use)))
    return result


def _build(name: str, values: Mapping[str, Any], where: str) -> JointLimits:
    try:
        return JointLimits(name=name, **values)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None


def _from_urdf(name: str, joint: ElementTree.Element) -> dict[str, Any]:
    kind = joint.get("type")
    values: dict[str, Any] = {"unit": "m" if kind == "prismatic" else "rad"}
    where = f"joint {name}"
    limit = joint.find("limit")
    if limit is not None:
        values["velocity"], values["effort"] = urdf.number(limit, "velocity", where), urdf.number(limit, "effort", where)
        if kind in ("revolute", "prismatic"):
            values["lower"], values["upper"] = urdf.number(limit, "lower", where, 0.0), urdf.number(limit, "upper", where, 0.0)
    elif kind in ("revolute", "prismatic"):
        raise DescriptionError(f"{where} is {kind} and has no <limit>")
    safety = joint.find("safety_controller")
    if safety is not None:
        values["k_velocity"], values["k_position"] = urdf.number(safety, "k_velocity", where), urdf.number(safety, "k_position", where, 0.0)
        if kind in ("revolute", "prismatic"):
            values["soft_lower"] = urdf.number(safety, "soft_lower_limit", where, 0.0)
            values["soft_upper"] = urdf.number(safety, "soft_upper_limit", where, 0.0)
    return values


def _override(values: dict[str, Any], parameters: Any, where: str) -> None:
    if not isinstance(parameters, Mapping):
        raise ParameterError(f"{where} must be a set of parameters; got {parameters!r}")
    unknown = sorted(str(key) for key in set(parameters) - _KNOWN)
    if unknown:
        raise ParameterError(f"{where}: unknown parameter {', '.join(unknown)}; valid: {', '.join(sorted(_KNOWN))}")
    if _flag(parameters, _WRAPAROUND, where):
        values["lower"], values["upper"] = -INFINITY, INFINITY
    for switch, group in _GROUPS.items():
        _override_group(values, parameters, switch, group, where)


def _override_group(values: dict[str, Any], parameters: Mapping[str, Any], switch: str, group: dict[str, tuple[str, float]], where: str) -> None:
    wanted = _flag(parameters, switch, where)
    for name, (field, unlimited) in group.items():
        if wanted is False:
            values[field] = unlimited
        elif name in parameters:
            values[field] = _number(parameters[name], f"{where}/{name}")
        elif wanted and values.get(field, unlimited) == unlimited and not name.startswith("k_"):
            raise ParameterError(f"{where}: {switch} is true, but {name} is not given, and the URDF has none")


def _flag(parameters: Mapping[str, Any], name: str, where: str) -> bool | None:
    value = parameters.get(name)
    if value is not None and not isinstance(value, bool):
        raise ParameterError(f"{where}/{name} must be true or false; got {value!r}")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(f"{where} must be a finite number; got {value!r}")
    return float(value)
