"""Joint limits from the URDF, overridden by parameters with ros_control's names."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from hric_control.limits.values import INFINITY, KINDS, JointLimits, check_kinds
from hric_core.errors import DescriptionError, ParameterError, check_known, message_about
from hric_core.magnitudes import likely_unit
from hric_core.node import Node
from hric_core.parameters import Settings, choice, either, flag, listing, number, refused
from hric_core.urdf import BOUNDED, Limit, SafetyController, read

URDF = "from the URDF"
FAR_OUTSIDE = 0.5
"""Largest distance beyond its position range at which a joint may start [rad or m] (project default, unconfirmed).

It allows for an arm that was pushed against its stops, or a pose that was rounded."""
# Name of a `has_..._limits` parameter -> parameters of its group -> (field of JointLimits, value for "not limited").
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


@dataclass(frozen=True)
class LimitParameters(Settings):
    """Parameters that override one joint's limits of the URDF, with the names of ros_control."""

    has_position_limits: bool | None = flag(
        None,
        default_text=URDF,
        text="`false`: no position limits; the other parameters `has_..._limits` do the same for their limits",
    )
    min_position: float | None = number(None, default_text=URDF, unit="rad or m", text="lower position limit")
    max_position: float | None = number(None, default_text=URDF, unit="rad or m", text="upper position limit")
    has_velocity_limits: bool | None = flag(None, default_text=URDF)
    max_velocity: float | None = number(None, minimum=0.0, default_text=URDF, unit="rad/s or m/s", text="largest speed")
    has_effort_limits: bool | None = flag(None, default_text=URDF)
    max_effort: float | None = number(None, minimum=0.0, default_text=URDF, unit="N m or N", text="largest effort")
    has_effort_rate_limits: bool | None = flag(None, default_text="`false`")
    max_effort_rate: float | None = number(
        None, minimum=0.0, default_text="not limited", unit="N m/s or N/s", text="largest rate of effort (rotatum)"
    )
    has_acceleration_limits: bool | None = flag(None, default_text="`false`")
    max_acceleration: float | None = number(
        None,
        minimum=0.0,
        default_text="not limited",
        unit="rad/s^2 or m/s^2",
        text="largest acceleration, for velocity and position commands, if the robot enforces it",
    )
    has_jerk_limits: bool | None = flag(None, default_text="`false`")
    max_jerk: float | None = number(
        None,
        minimum=0.0,
        default_text="not limited",
        unit="rad/s^3 or m/s^3",
        text="largest jerk, for planners; not enforced",
    )
    has_soft_limits: bool | None = flag(None, default_text=URDF)
    k_position: float | None = number(
        None,
        minimum=0.0,
        default_text=URDF,
        unit="1/s",
        text="allowed speed per distance to the soft position limit; 0: no soft limits",
    )
    k_velocity: float | None = number(
        None,
        minimum=0.0,
        default_text=URDF,
        unit="N m s/rad",
        text="allowed effort per difference to the allowed speed; 0: hard velocity limit",
    )
    soft_lower_limit: float | None = number(None, default_text=URDF, unit="rad or m", text="lower soft position limit")
    soft_upper_limit: float | None = number(None, default_text=URDF, unit="rad or m", text="upper soft position limit")
    angle_wraparound: bool = flag(False, text="`true`: no position limits, as the joint turns endlessly")


DEFAULT_KINDS = ("position", "velocity", "effort", "effort_rate", "soft")


def _kinds(enforced: bool | tuple[str, ...]) -> tuple[str, ...]:
    return enforced if isinstance(enforced, tuple) else DEFAULT_KINDS if enforced else ()


ENFORCE_LIMITS: Any = either(
    flag(),
    listing(choice(*KINDS)),
    default=True,
    made=_kinds,
    name="enforce_limits",
    text="kinds of limit to enforce; `true`: position, velocity, effort, effort_rate, soft; `false`: none",
)
"""Parameter `enforce_limits`: kinds of limit that a robot enforces, as the argument `use` of `load_limits`."""


def load_limits(
    urdf_xml: str, node: Node | None, joint_names: Sequence[str], use: Sequence[str] = DEFAULT_KINDS
) -> list[JointLimits]:
    """Return the limits of joints from the URDF, overridden by parameters; in the order of the names.

    Args:
        urdf_xml: robot description; `<limit>` and `<safety_controller>` of each joint are read.
        node: node whose parameters `joint_limits/<joint>/...` override the URDF; None: the URDF alone.
        joint_names: names of the joints.
        use: kinds of limit to return, of `limits.KINDS`; the others are set to "not limited".

    Raises:
        ParameterError, DescriptionError, UnknownNameError: a parameter, the description, or a joint's name is wrong;
            the message names joint and parameter or element.
    """
    check_kinds(tuple(use))
    joints = read(urdf_xml).joints
    check_known("joint", joint_names, joints, "the robot description")
    result = []
    for name in joint_names:
        where = f"joint_limits/{name}"
        parameters = node.param(where) if node is not None and node.has_param(where) else None
        source = "the robot description" if node is None or parameters is None else node.resolve(where)
        joint = joints[name]
        description = name, joint.type, joint.limit, joint.safety
        result.append(_of_joint(*description, json.dumps(parameters, default=str), source).only(tuple(use)))
    return result


def check_start(urdf_xml: str, joint_names: Sequence[str], q: Sequence[float], where: str) -> None:
    """Refuse a start pose in which a joint is further than `FAR_OUTSIDE` beyond its position range.

    Args:
        urdf_xml: robot description.
        joint_names: names of the joints.
        q: joint positions [rad or m].
        where: full name of the parameter with the pose.

    Raises:
        ParameterError: the pose is refused; the message names joint, range, and the unit that was probably meant.
    """
    for name, position, limit in zip(
        joint_names, q, load_limits(urdf_xml, None, joint_names, ("position",)), strict=True
    ):
        low, high = limit.lower - FAR_OUTSIDE, limit.upper + FAR_OUTSIDE
        if not low <= position <= high:
            valid = f"{low:g} to {high:g} [{limit.unit}], the joint's range and {FAR_OUTSIDE:g} beyond it"
            raise refused(f"{where}/{name}", position, valid + likely_unit(position, limit.unit, low, high))


@lru_cache(256)
def _of_joint(
    name: str, kind: str, limit: Limit | None, safety: SafetyController | None, parameters: str, where: str
) -> JointLimits:
    """Return the limits of a joint from its URDF elements and its parameters (as JSON text).

    The result is cached, as robot, controllers and the next run read the same limits."""
    values, overrides = _from_urdf(name, kind, limit, safety), json.loads(parameters)
    if overrides is not None:
        _override(values, overrides, where)
    try:
        return JointLimits(name=name, unit="m" if kind == "prismatic" else "rad", **values)
    except ParameterError as error:
        raise ParameterError(message_about(where, error)) from None


def _from_urdf(name: str, kind: str, limit: Limit | None, safety: SafetyController | None) -> dict[str, float]:
    values: dict[str, float] = {}
    if limit is not None:
        for field, value in (("velocity", limit.velocity), ("effort", limit.effort)):
            if value is None:
                raise DescriptionError(f"joint {name}: <limit> has no {field}")
            values[field] = value
    if safety is not None:
        values["k_velocity"], values["k_position"] = safety.k_velocity, safety.k_position
    if kind in BOUNDED:
        values |= {"lower": limit.lower, "upper": limit.upper} if limit else {}
        values |= {"soft_lower": safety.soft_lower, "soft_upper": safety.soft_upper} if safety else {}
    return values


def _override(values: dict[str, float], content: Any, where: str) -> None:
    parameters = LimitParameters.of(content, where)
    if parameters.angle_wraparound:
        values["lower"], values["upper"] = -INFINITY, INFINITY
    for switch, group in _GROUPS.items():
        _override_group(values, parameters, switch, group, where)


def _override_group(
    values: dict[str, float], parameters: LimitParameters, switch: str, group: dict[str, tuple[str, float]], where: str
) -> None:
    enabled = getattr(parameters, switch)
    for name, (field, unlimited) in group.items():
        if enabled is False:
            values[field] = unlimited
        elif getattr(parameters, name) is not None:
            values[field] = getattr(parameters, name)
        elif enabled and values.get(field, unlimited) == unlimited and not name.startswith("k_"):
            raise ParameterError(f"{where}: {switch} is true, but {name} is not set, and the URDF has no such limit")
