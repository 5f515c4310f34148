"""Parameters shared by several controllers, and checks of joint setpoints."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hric_control.limits import load_limits
from hric_core.errors import CommandError, ParameterError
from hric_core.node import Node
from hric_core.parameters import Settings, flag, number, per_joint, text


@dataclass(frozen=True)
class ArmSettings(Settings):
    """Parameter common to the controllers of a Franka arm: the name of the arm."""

    arm_id: str = text(valid="the arm's name, e.g. panda,", empty=False, text="the arm's name")


@dataclass(frozen=True)
class LawSettings(Settings):
    """Parameters common to the controllers that command efforts: added gravity and rotor inertia."""

    gravity: bool = flag(
        False,
        text="add g(q): from the robot's model interface if it has one, else by KDL from `robot_description`; "
        "refused on an arm that adds it itself",
    )
    rotor_inertia: tuple[float, ...] | None = per_joint(
        number(minimum=0.0, unit="kg m^2"),
        None,
        default_text="the robot's, else 0",
        text="seen at the joint; for the bounds of the gains",
    )


STRICT_GAINS: Any = flag(
    False, name="strict_gains", text="refuse gains with which the sampled loop is unstable, instead of a warning"
)


LOWEST_RATE, HIGHEST_RATE = 0.1, 1e4
"""Range of the rate of a state topic [Hz] (project default, unconfirmed).

A value below the range is probably a period in seconds, given by mistake; no control loop is faster than the range.
"""


def state_rate(default: float) -> Any:
    """Return the field of the parameter `state_publish_rate` for a settings class; `default`: default rate [Hz]."""
    return number(default, minimum=0.0, maximum=HIGHEST_RATE, unit="Hz", name="state_publish_rate", text="0: never")


def position_ranges(root_node: Node, joints: Sequence[str]) -> list[tuple[float, float]]:
    """Return the position range (lower, upper) of each joint [rad or m] from robot_description and `joint_limits`.

    Ranges are infinite if there is no robot_description.
    """
    urdf_xml = root_node.search_param("robot_description", "")
    if not urdf_xml:
        return [(-math.inf, math.inf)] * len(joints)
    return [(limits.lower, limits.upper) for limits in load_limits(urdf_xml, root_node, joints, use=("position",))]


def check_setpoint(
    values: Sequence[float], joints: Sequence[str], ranges: Sequence[tuple[float, float]]
) -> list[float]:
    """Return a setpoint of joint positions as n floats [rad or m], after checking it.

    Args:
        values: desired position of each joint [rad or m].
        joints: joint names, for the texts of errors.
        ranges: position range (lower, upper) of each joint [rad or m].

    Raises:
        CommandError: wrong number of values, or a value that is not finite or outside its joint's range; the text
            gives the valid values.
    """
    if len(values) != len(joints):
        raise CommandError(f"{len(values)} values; valid: {len(joints)}, for {', '.join(joints)}")
    wrong = []
    for joint, value, (low, high) in zip(joints, values, ranges, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            wrong.append(f"{joint} {value!r} is not a finite number")
        elif not low <= value <= high:
            wrong.append(f"{joint} {value:.6g} is outside {low:.6g} to {high:.6g}")
    if wrong:
        raise CommandError("; ".join(wrong))
    return [float(value) for value in values]


def initial_setpoint(
    values: Sequence[float] | None, joints: Sequence[str], ranges: Sequence[tuple[float, float]], where: str
) -> list[float] | None:
    """Return the setpoint that a parameter gives, n floats [rad or m], after checking it; None if it is not set.

    Args:
        values: value of the parameter, None if it is not set.
        joints: joint names, for the texts of errors.
        ranges: position range (lower, upper) of each joint [rad or m].
        where: full name of the parameter, for the texts of errors.

    Raises:
        ParameterError: wrong number of values, or a value that is not finite or outside its joint's range.
    """
    try:
        return None if values is None else check_setpoint(values, joints, ranges)
    except CommandError as error:
        raise ParameterError(f"{where}: {error}") from None
