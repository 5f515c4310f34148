"""Joint and Cartesian limits of the Franka arm as vectors; the numbers and sources are in panda_description."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import panda_description
from hric_control.limits import JointLimits
from panda_description import CartesianLimit

EPSILON = 1e-3
"""Margin by which libfranka lowers every rate limit (rate_limiting.h)."""
LOST_PACKETS_TIME = 3e-3
"""Duration of three lost packets of 1 ms [s].

libfranka lowers velocity limits by the change in this time at the acceleration limit.
"""

Vector = tuple[float, ...]


@dataclass(frozen=True)
class FrankaLimits:
    """Limits of the joints, the end effector and the elbow of a Franka arm.

    Attributes:
        lower, upper: position range, 7 floats [rad].
        velocity, acceleration, jerk: joint limits, 7 floats each [rad/s], [rad/s^2], [rad/s^3].
        effort, effort_rate: limits of joint torque and torque rate, 7 floats each [N m], [N m/s].
        translation, rotation, elbow: velocity, acceleration and jerk of the end effector and of the elbow.
    """

    lower: Vector
    upper: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector
    effort: Vector
    effort_rate: Vector
    translation: CartesianLimit
    rotation: CartesianLimit
    elbow: CartesianLimit

    def within(self, joints: Sequence[JointLimits]) -> "FrankaLimits":
        """Return limits whose positions and velocities are also within those of a robot description, one per joint."""
        return replace(
            self,
            lower=tuple(max(x, joint.lower) for x, joint in zip(self.lower, joints, strict=True)),
            upper=tuple(min(x, joint.upper) for x, joint in zip(self.upper, joints, strict=True)),
            velocity=tuple(min(v, joint.velocity) for v, joint in zip(self.velocity, joints, strict=True)),
        )

    def with_margins(self) -> "FrankaLimits":
        """Return limits lowered by libfranka's margins; its rate limiter does not change a command within them."""
        velocity = tuple(
            v - EPSILON - LOST_PACKETS_TIME * a for v, a in zip(self.velocity, self.acceleration, strict=True)
        )
        return replace(
            self,
            velocity=velocity,
            acceleration=_lowered(self.acceleration),
            jerk=_lowered(self.jerk),
            effort_rate=_lowered(self.effort_rate),
            translation=_with_margins(self.translation),
            rotation=_with_margins(self.rotation),
            elbow=_with_margins(self.elbow),
        )


def _lowered(values: Vector) -> Vector:
    return tuple(value - EPSILON for value in values)


def _with_margins(limit: CartesianLimit) -> CartesianLimit:
    velocity = limit.velocity - EPSILON - LOST_PACKETS_TIME * limit.acceleration
    return CartesianLimit(velocity, limit.acceleration - EPSILON, limit.jerk - EPSILON)


def franka_limits() -> FrankaLimits:
    """Return the nominal limits of the Panda, without libfranka's margins."""
    joints = list(panda_description.joint_limits().values())
    names = ("lower", "upper", "velocity", "acceleration", "jerk", "effort", "effort_rate")
    values: dict[str, Any] = {name: tuple(float(getattr(joint, name)) for joint in joints) for name in names}
    return FrankaLimits(**(values | panda_description.cartesian_limits()))
