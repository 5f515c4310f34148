"""Parameters of the joint trajectory controllers, with the names of ros_controllers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hric_control import urdf
from hric_control.errors import ParameterError
from hric_control.node import Node
from hric_controllers.parameters import number
from hric_controllers.pid import PidGains
from hric_controllers.tolerances import GoalTolerances, Tolerance

_GAINS = ("p", "i", "d", "i_clamp")
_GAINS_IGNORED = ("antiwindup", "i_clamp_min", "i_clamp_max", "publish_state")
_GENERAL = ("goal_time", "stopped_velocity_tolerance")


def read_tolerances(node: Node, joints: Sequence[str]) -> GoalTolerances:
    """`constraints/goal_time` (0), `constraints/stopped_velocity_tolerance` (0.01), `constraints/<joint>/{trajectory, goal}` (0: no limit).

    Raises:
        ParameterError: a value below zero or not finite, an unknown name below `constraints`.
    """
    given = node.param("constraints", {})
    unknown = sorted(str(name) for name in given if name not in joints and name not in _GENERAL)
    if unknown:
        raise ParameterError(f"{node.resolve('constraints')} names {', '.join(unknown)}; valid: {', '.join((*_GENERAL, *joints))}")
    stopped = number(node, "constraints/stopped_velocity_tolerance", 0.01, minimum=0.0)
    path = tuple(Tolerance(number(node, f"constraints/{joint}/trajectory", 0.0, minimum=0.0)) for joint in joints)
    goal = tuple(Tolerance(number(node, f"constraints/{joint}/goal", 0.0, minimum=0.0), stopped) for joint in joints)
    return GoalTolerances(path, goal, number(node, "constraints/goal_time", 0.0, minimum=0.0))


def read_gains(node: Node, joints: Sequence[str]) -> list[PidGains]:
    """`gains/<joint>/{p, i, d, i_clamp}`; p is required.

    Raises:
        ParameterError: a joint without gains, an unknown name, a value below zero or not finite.
    """
    table = node.param("gains")
    where = node.resolve("gains")
    if not isinstance(table, dict):
        raise ParameterError(f"{where} is {table!r}; valid: {{<joint>: {{p, i, d, i_clamp}}}}")
    missing, unknown = [joint for joint in joints if joint not in table], [str(name) for name in table if name not in joints]
    if missing or unknown:
        wrong = [f"missing {', '.join(missing)}"] * bool(missing) + [f"unknown {', '.join(unknown)}"] * bool(unknown)
        raise ParameterError(f"{where} has {'; '.join(wrong)}; valid: one entry for each of {', '.join(joints)}")
    result = [_gains(table[joint], f"{where}/{joint}") for joint in joints]
    idle = [joint for joint, gains in zip(joints, result, strict=True) if gains.i > 0.0 and gains.i_clamp == 0.0]
    if idle:
        node.log_warn(f"{where}: i without i_clamp has no effect ({', '.join(idle)}); give i_clamp [N m]")
    return result


def _gains(entry: Any, where: str) -> PidGains:
    unknown = [str(name) for name in entry if name not in (*_GAINS, *_GAINS_IGNORED)] if isinstance(entry, dict) else []
    if not isinstance(entry, dict) or "p" not in entry or unknown:
        raise ParameterError(f"{where} is {entry!r}; valid: p (required), i, d, i_clamp")
    gains = PidGains(**{name: entry[name] for name in _GAINS if name in entry})
    gains.check(where)
    return gains


def continuous_joints(root_node: Node, joints: Sequence[str]) -> list[bool]:
    """Which joints the description calls continuous; none without a description."""
    urdf_xml = root_node.search_param("robot_description", "")
    elements = urdf.joints(urdf.parse(urdf_xml)) if urdf_xml else {}
    return [joint in elements and elements[joint].get("type") == "continuous" for joint in joints]
