"""Gains of the Cartesian impedance controller: from the YAML, and live through dynamic_reconfigure."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from hric_control.errors import ParameterError
from hric_control.node import LiveParameter, Node
from hric_controllers.cartesian_law import Compliance
from hric_controllers.parameters import is_number

GAINS: dict[str, tuple[float, float, str]] = {
    "translational_stiffness": (200.0, 3000.0, "stiffness of the end effector's position [N/m]"),
    "rotational_stiffness": (10.0, 300.0, "stiffness of the end effector's orientation [N m/rad]"),
    "translational_damping_ratio": (1.0, 2.0, "times 2 sqrt(translational_stiffness) gives the damping [N s/m]"),
    "rotational_damping_ratio": (1.0, 2.0, "times 2 sqrt(rotational_stiffness) gives the damping [N m s/rad]"),
    "nullspace_stiffness": (0.5, 100.0, "stiffness of the posture in the null space [N m/rad]"),
}
"""name -> (default, largest, description). Defaults and the largest null-space stiffness: franka_ros's example; the largest Cartesian ones: what
libfranka allows the arm's own impedance (setCartesianImpedance); damping ratios up to 2: our choice. The least is 0."""


def read_compliance(node: Node) -> Compliance:
    """The gains of the YAML.

    Raises:
        ParameterError: not a number, or out of range.
    """
    return checked(node, {name: node.param(name, default) for name, (default, _, _) in GAINS.items()})


def checked(node: Node, values: dict[str, Any]) -> Compliance:
    """Gains from a value for each.

    Raises:
        ParameterError: not a number, or out of range.
    """
    for name, (_, largest, _) in GAINS.items():
        value = values[name]
        if not is_number(value) or not 0.0 <= value <= largest:
            raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a number from 0 to {largest:g}")
    return Compliance(**{name: float(values[name]) for name in GAINS})


def live_parameters(compliance: Compliance) -> list[LiveParameter]:
    """What to offer, with these gains as defaults."""
    now = asdict(compliance)
    return [LiveParameter(name, now[name], 0.0, largest, description) for name, (_, largest, description) in GAINS.items()]
