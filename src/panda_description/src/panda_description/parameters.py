"""Typed access to the numbers in config/: limits, friction, inertial parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hric_control.errors import UnknownNameError
from panda_description.files import config
from panda_description.inertia import LinkInertia, judge, steiner_term, tensor

INERTIAL_SETS = ("barycentric", "thesis")
HAND_LINKS = {"hand", "leftfinger", "rightfinger"}


@dataclass(frozen=True)
class JointLimit:
    """Limits of one joint.

    Args:
        lower, upper: position range [rad].
        velocity: [rad/s].
        acceleration: [rad/s^2].
        jerk: [rad/s^3].
        effort: [N m].
        effort_rate: rotatum [N m/s].
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    jerk: float
    effort: float
    effort_rate: float


@dataclass(frozen=True)
class CartesianLimit:
    """Largest velocity, acceleration and jerk: [m/s], [m/s^2], [m/s^3] for translation, [rad/s], [rad/s^2], [rad/s^3] for rotation and elbow."""

    velocity: float
    acceleration: float
    jerk: float


def joint_limits(arm_id: str = "panda") -> dict[str, JointLimit]:
    """Limits by full joint name, joints 1 to 7 in order."""
    return {f"{arm_id}_{joint}": JointLimit(**values) for joint, values in config("joint_limits")["joints"].items()}


def joint_limit_parameters(arm_id: str = "panda") -> dict[str, dict[str, bool | float]]:
    """The same limits under ros_control's parameter names, by full joint name: what stands below `joint_limits/` on a parameter server."""
    names = {
        "max_velocity": "velocity",
        "max_acceleration": "acceleration",
        "max_jerk": "jerk",
        "max_effort": "effort",
        "max_effort_rate": "effort_rate",
    }
    found: dict[str, dict[str, bool | float]] = {}
    for joint, limit in joint_limits(arm_id).items():
        entry: dict[str, bool | float] = {"has_position_limits": True, "min_position": limit.lower, "max_position": limit.upper}
        for parameter, field in names.items():
            entry[f"has_{parameter.removeprefix('max_')}_limits"] = True
            entry[parameter] = getattr(limit, field)
        found[joint] = entry
    return found


def cartesian_limits() -> dict[str, CartesianLimit]:
    """Limits of `translation`, `rotation` and `elbow`."""
    return {name: CartesianLimit(**values) for name, values in config("cartesian_limits").items()}


def friction_parameters(arm_id: str = "panda") -> dict[str, dict[str, float]]:
    """Identified friction by full joint name: phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the sigmoid in config/friction.yaml."""
    return {f"{arm_id}_{joint}": dict(values) for joint, values in config("friction")["sigmoid"].items()}


def ignored_pairs(arm_id: str = "panda", hand: bool = True) -> list[tuple[str, str]]:
    """Pairs of links that a simulator must not test for self-collision, beside those that share a joint; see config/collision.yaml."""
    pairs = config("collision")["ignored_pairs"]
    return [(f"{arm_id}_{first}", f"{arm_id}_{second}") for first, second in pairs if hand or {first, second}.isdisjoint(HAND_LINKS)]


def inertials(name: str = "barycentric") -> dict[str, LinkInertia]:
    """Inertial parameters of a set by part: link0 to link7, hand, finger (each).

    Args:
        name: `barycentric` or `thesis`.
    """
    if name not in INERTIAL_SETS:
        raise UnknownNameError("set of inertials", name, INERTIAL_SETS, "panda_description")
    parts = {part: _link_inertia(values) for part, values in config("inertials_barycentric")["links"].items()}
    return parts if name == "barycentric" else parts | _thesis(parts)


def unphysical(name: str) -> dict[str, list[str]]:
    """Parts of a set that no body can have, with the reasons."""
    verdicts = {part: judge(link.inertia).reasons() for part, link in inertials(name).items()}
    return {part: reasons for part, reasons in verdicts.items() if reasons}


def _link_inertia(values: dict[str, dict[str, float]]) -> LinkInertia:
    com = values["com"]
    return LinkInertia(float(values["mass"]), np.array([com["x"], com["y"], com["z"]]), tensor(**values["inertia"]))  # type: ignore[arg-type]


def _thesis(parts: dict[str, LinkInertia]) -> dict[str, LinkInertia]:
    """The parts that the thesis's set changes, as config/inertials_thesis.yaml says."""
    rule = config("inertials_thesis")
    changed = {}
    for part in rule["links"]:
        link = parts[part]
        own = rule["com_overrides"].get(part, {})
        com = np.array([own.get(axis, value) for axis, value in zip("xyz", link.com, strict=True)])
        changed[part] = LinkInertia(link.mass, com, link.inertia + rule["steiner"] * steiner_term(link.mass, com))
    return changed
