"""The largest derivative gain that a sampled torque loop tolerates.

A torque -Kd_i dq_i, held over one period dt, changes the velocity of joint i by dt ((M + B)^-1)_ii Kd_i dq_i; beyond twice the velocity itself
the loop diverges:  Kd_i <= 2 / (dt ((M + B)^-1)_ii), with M the mass matrix at the present pose and B the rotor inertia.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_control.errors import HricError, ParameterError
from hric_control.hardware_interface import JointStateInterface
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_controllers.dynamics import chain_dynamics
from hric_controllers.parameters import per_joint


def largest_kd(mass: npt.NDArray[np.float64], rotor_inertia: Sequence[float], period: float) -> list[float]:
    """Bound of each derivative gain, n floats [N m s/rad].

    Args:
        mass: joint-space mass matrix, shape (n, n) [kg m^2].
        rotor_inertia: reflected to the joints, n floats [kg m^2].
        period: of the control loop [s].
    """
    inverse = np.linalg.inv(mass + np.diag(rotor_inertia))
    return [2.0 / (period * float(value)) for value in np.diagonal(inverse)]


def unstable(joints: Sequence[str], kd: Sequence[float], bounds: Sequence[float]) -> str:
    """The joints whose gain exceeds its bound, as text; empty if none does."""
    pairs = zip(joints, kd, bounds, strict=True)
    return ", ".join(f"{joint} {gain:.4g} (at most {bound:.3g})" for joint, gain, bound in pairs if gain > bound)


def control_period(robot_hw: RobotHW) -> float:
    """Period of the robot's loop; 1 ms, as the arm has it, if the robot does not tell [s]."""
    loop: Any = getattr(robot_hw, "loop", None)
    return float(getattr(loop, "time_step", 0.001))


def rotor_inertia(robot_hw: RobotHW, node: Node, joints: Sequence[str]) -> tuple[list[float], str]:
    """Rotor inertia of the joints [kg m^2] and where it comes from: the parameter `rotor_inertia`, else the robot, else zero.

    Raises:
        ParameterError: the parameter is not valid.
    """
    if node.has_param("rotor_inertia"):
        return per_joint(node, "rotor_inertia", joints, minimum=0.0), "parameter rotor_inertia"
    told = getattr(robot_hw, "rotor_inertia", None)
    if told is None:
        return [0.0] * len(joints), "taken as 0, since neither the parameter rotor_inertia nor the robot gives it"
    index = robot_hw.get(JointStateInterface).states.index
    return [float(told[index[joint]]) for joint in joints], "from the robot"


class KdCheck:
    """Checks derivative gains against the bound at the present pose.

    Args:
        strict: refuse what exceeds it; otherwise the text is for a warning.
    """

    def __init__(self, mass: npt.NDArray[np.float64], inertia: tuple[list[float], str], period: float, strict: bool) -> None:
        self._bounds = largest_kd(mass, inertia[0], period)
        self._source, self._period, self._strict = inertia[1], period, strict

    def warning(self, joints: Sequence[str], kd: Sequence[float]) -> str:
        """What to tell the user about these gains; empty if nothing.

        Raises:
            ParameterError: strict, and a gain exceeds its bound.
        """
        culprits = unstable(joints, kd, self._bounds)
        if not culprits:
            return ""
        text = (
            f"derivative gain too large for a {1e3 * self._period:g} ms loop at this pose: {culprits}; "
            f"bound 2 / (dt ((M+B)^-1)_ii), rotor inertia B {self._source}"
        )
        if self._strict:
            raise ParameterError(f"{text}; strict_gains refuses it")
        return f"{text}: expect chatter"


def make_check(robot_hw: RobotHW, root_node: Node, node: Node, joints: Sequence[str], strict: bool) -> Callable[[Sequence[float]], str]:
    """A function of the derivative gains that gives the text to warn with, empty if they are fine; any thread but the loop's.

    Raises:
        HricError: strict, and the dynamics of these joints cannot be had. (Not strict: that is logged, and nothing is checked.)
    """
    inertia, period = rotor_inertia(robot_hw, node, joints), control_period(robot_hw)
    try:
        dynamics = chain_dynamics(robot_hw, root_node, joints)
    except HricError as error:
        if strict:
            raise
        node.log_info(f"derivative gains are not checked: {error}")
        return lambda kd: ""
    return lambda kd: KdCheck(dynamics.mass(), inertia, period, strict).warning(joints, kd)
