"""Checks of a commanded motion against its position, velocity, acceleration and jerk limits, by libfranka's names.

Derivatives are backward differences over one time step, as in libfranka's rate limiter (rate_limiting.h): commands
that the limiter accepts are accepted here.

Lost packets: the box bridges them with constant acceleration, which can lead to a velocity above the one that
libfranka's limiter allows (limit minus 3 ms times the acceleration limit). The limiter's next command then brakes at
once, by up to twice the acceleration limit in one step. So the jerk of the first command after a loss is checked only
if that command speeds the motion up.

Not reproduced: libfranka's Cartesian limiter takes the root of a negative number if the last twist is a rounding error
above its maximum speed and the next one has another direction. It then lets the acceleration grow without bound (seen
with libfranka 0.9.2), which no box could accept.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.config import MotionParameters
from panda_description import CartesianLimit


@dataclass(frozen=True, slots=True)
class RateErrors:
    """libfranka's error names for a violated position, velocity, acceleration or jerk limit."""

    position: str
    velocity: str
    acceleration: str
    jerk: str

    @classmethod
    def of(cls, generator: str) -> "RateErrors":
        """Return the error names that begin with `<generator>_`."""
        kinds = (
            "position_limits_violation",
            "velocity_limits_violation",
            "velocity_discontinuity",
            "acceleration_discontinuity",
        )
        return cls(*(f"{generator}_{kind}" for kind in kinds))

    def named(self, position: bool, velocity: bool, acceleration: bool, jerk: bool) -> Errors:
        """Return the error names of the violated limits."""
        flags = (
            (position, self.position),
            (velocity, self.velocity),
            (acceleration, self.acceleration),
            (jerk, self.jerk),
        )
        return frozenset(name for violated, name in flags if violated)


JOINT_ERRORS = RateErrors.of("joint_motion_generator")
CARTESIAN_ERRORS = RateErrors.of("cartesian_motion_generator")
CARTESIAN_JOINT_ERRORS = RateErrors.of("cartesian_motion_generator_joint")


_Row = tuple[Sequence[float], Sequence[float], str, float]
"""Values, their limits, the unit, and the tolerance factor on the limits."""


def _passed(what: str, value: float, limit: float, unit: str, tolerance: float = 1.0) -> str:
    """Return a text with the value and the exceeded limit; tolerance: factor by which the limit may be exceeded."""
    more = f" and {100.0 * (tolerance - 1.0):.0f} % more" if tolerance > 1.0 else ""
    return f"{what} at {value:.5g} {unit}, limit {limit:g} {unit}{more}"


def _worst(shares: Sequence[float]) -> int:
    """Return the index of the largest value; a value that is not finite counts as the largest."""
    return max(range(len(shares)), key=lambda i: shares[i] if math.isfinite(shares[i]) else math.inf)


class JointRates:
    """Check of a desired joint motion against the limits of the joints; NaN and infinity violate them.

    Attributes:
        reason: joints, values and limits of the last violations, as a text.

    Args:
        limits: limits of the arm.
        joint_names: joint names of the arm.
        errors: error names to report.
        parameters: tolerances.
        time_step: control period [s].
        with_jerk: True if the jerk is limited; False for joint motion from inverse kinematics (Franka's documentation
            lists position, velocity and acceleration there).
    """

    def __init__(
        self,
        limits: FrankaLimits,
        joint_names: Sequence[str],
        errors: RateErrors,
        parameters: MotionParameters,
        time_step: float,
        with_jerk: bool = True,
    ) -> None:
        self._errors, slack, self.reason = errors, parameters.position_tolerance, ""
        self._limits, self._names, self._parameters, self._dt = limits, joint_names, parameters, time_step
        self._range = [x - slack for x in limits.lower], [x + slack for x in limits.upper]
        self.lower, self.upper = self._range
        self.velocity = [x * parameters.velocity_tolerance for x in limits.velocity]
        self.acceleration = [x * parameters.acceleration_tolerance for x in limits.acceleration]
        jerk = [x * parameters.jerk_tolerance if with_jerk else math.inf for x in limits.jerk]
        self._acceleration_step = [x * time_step for x in jerk]
        self._velocity_step = [x * time_step for x in self.acceleration]
        self._position_step = [x * time_step for x in self.velocity]

    def start_anywhere(self, q: Sequence[float]) -> None:
        """Widen the position limits so that they include the start position q, 7 floats [rad]."""
        lower, upper = self._range
        self.lower = [min(low, x) for low, x in zip(lower, q, strict=True)]
        self.upper = [max(high, x) for high, x in zip(upper, q, strict=True)]

    def in_range(self, q: Sequence[float]) -> bool:
        """Return True if the joint positions, 7 floats [rad], are within their limits."""
        return all(low <= x <= high for low, x, high in zip(self.lower, q, self.upper, strict=True))

    def reachable(self, q: Sequence[float], q_d: Sequence[float]) -> bool:
        """Return True if every joint can move from q_d to q [rad] in one step within its velocity limit."""
        return all(abs(x - x_d) <= step for x, x_d, step in zip(q, q_d, self._position_step, strict=True))

    def can_stop(self, dq: Sequence[float]) -> bool:
        """Return True if the acceleration limits allow rest one step after dq, 7 floats [rad/s]."""
        return all(abs(v) <= step for v, step in zip(dq, self._velocity_step, strict=True))

    def violations(
        self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float], last_ddq: Sequence[float], after_loss: bool
    ) -> Errors:
        """Return the error names of the limits that the motion violates.

        Args:
            q: positions of this step, 7 floats [rad].
            dq: velocities of this step, 7 floats [rad/s].
            ddq: accelerations of this step, 7 floats [rad/s^2].
            last_ddq: accelerations of the previous step, 7 floats [rad/s^2].
            after_loss: True if the previous step bridged a lost packet.
        """
        position = velocity = acceleration = jerk = False
        limits = self.lower, self.upper, self.velocity, self.acceleration, self._acceleration_step
        rows = zip(*limits, q, dq, ddq, last_ddq, strict=True)
        for low, high, v_max, a_max, a_step, x, v, a, last_a in rows:
            if not low <= x <= high:
                position = True
            if not -v_max <= v <= v_max:
                velocity = True
            if not -a_max <= a <= a_max:
                acceleration = True
            if not -a_step <= a - last_a <= a_step and not (after_loss and (a - last_a) * v < 0.0):
                jerk = True
        if position or velocity or acceleration or jerk:
            reasons = self._too_large((velocity, acceleration, jerk), dq, ddq, last_ddq)
            self.reason = "; ".join([self.out_of_range(q), *reasons] if position else reasons)
            return self._errors.named(position, velocity, acceleration, jerk)
        return NO_ERRORS

    def out_of_range(self, q: Sequence[float]) -> str:
        """Return a text with the joint that is farthest beyond its position limits; q: 7 floats [rad]."""
        beyond = [max(low - x, x - high) for low, x, high in zip(self.lower, q, self.upper, strict=True)]
        i = _worst(beyond)
        return _passed(
            self._names[i], q[i], self._limits.lower[i] if q[i] < self.lower[i] else self._limits.upper[i], "rad"
        )

    def _too_large(
        self, violated: Sequence[bool], dq: Sequence[float], ddq: Sequence[float], last_ddq: Sequence[float]
    ) -> list[str]:
        """Return a text on the joint farthest beyond each violated limit of velocity, acceleration and jerk."""
        limits, tolerances = self._limits, self._parameters
        jerk = [(a - b) / self._dt for a, b in zip(ddq, last_ddq, strict=True)]
        rows: tuple[_Row, ...] = (
            (dq, limits.velocity, "rad/s", tolerances.velocity_tolerance),
            (ddq, limits.acceleration, "rad/s^2", tolerances.acceleration_tolerance),
            (jerk, limits.jerk, "rad/s^3", tolerances.jerk_tolerance),
        )
        reasons = []
        for passed, (values, limit, unit, tolerance) in zip(violated, rows, strict=True):
            if passed:
                i = _worst([abs(x) / bound for x, bound in zip(values, limit, strict=True)])
                reasons.append(_passed(self._names[i], values[i], limit[i], unit, tolerance))
        return reasons


class SpaceRates:
    """Check of the rates of one Cartesian quantity: translation, rotation (3 floats each) or elbow (1 float).

    The Euclidean norms of velocity, acceleration and jerk are compared with their limits.

    Args:
        what: name of the quantity, for messages.
        unit: unit of its position, m or rad.
        limit: maximum velocity, acceleration and jerk.
        parameters: tolerances.
        time_step: control period [s].
    """

    def __init__(
        self, what: str, unit: str, limit: CartesianLimit, parameters: MotionParameters, time_step: float
    ) -> None:
        self._what, self._unit, self._limit, self._parameters, self._dt = what, unit, limit, parameters, time_step
        self.velocity = limit.velocity * parameters.velocity_tolerance
        self.acceleration = limit.acceleration * parameters.acceleration_tolerance
        self._acceleration_step = limit.jerk * parameters.jerk_tolerance * time_step
        self._velocity_step = self.acceleration * time_step

    def reachable(self, v: Sequence[float]) -> bool:
        """Return True if the velocity v, 1 or 3 floats [m/s] or [rad/s], is within its limit."""
        return math.hypot(*v) <= self.velocity

    def can_stop(self, v: Sequence[float]) -> bool:
        """Return True if the acceleration limit allows the motion to stop within one step from the velocity v."""
        return math.hypot(*v) <= self._velocity_step

    def violated(
        self, v: Sequence[float], a: Sequence[float], last_a: Sequence[float], after_loss: bool
    ) -> tuple[bool, bool, bool]:
        """Return (velocity, acceleration, jerk), each True if its limit is violated.

        Args:
            v: velocity of this step, 1 or 3 floats.
            a: acceleration of this step, 1 or 3 floats.
            last_a: acceleration of the previous step, 1 or 3 floats.
            after_loss: True if the previous step bridged a lost packet; a jerk that brakes is then allowed.
        """
        change = [x - x_last for x, x_last in zip(a, last_a, strict=True)]
        jerk = not math.hypot(*change) <= self._acceleration_step
        if jerk and after_loss and sum(j * x for j, x in zip(change, v, strict=True)) < 0.0:
            jerk = False
        return not math.hypot(*v) <= self.velocity, not math.hypot(*a) <= self.acceleration, jerk

    def reasons(
        self, violated: Sequence[bool], v: Sequence[float], a: Sequence[float], last_a: Sequence[float]
    ) -> list[str]:
        """Return a text with value and limit for each True in `violated` (velocity, acceleration, jerk)."""
        jerk = [(x - x_last) / self._dt for x, x_last in zip(a, last_a, strict=True)]
        limit, tolerances, unit = self._limit, self._parameters, self._unit
        rows: tuple[_Row, ...] = (
            (v, [limit.velocity], f"{unit}/s", tolerances.velocity_tolerance),
            (a, [limit.acceleration], f"{unit}/s^2", tolerances.acceleration_tolerance),
            (jerk, [limit.jerk], f"{unit}/s^3", tolerances.jerk_tolerance),
        )
        checks = zip(violated, rows, strict=True)
        return [
            _passed(self._what, math.hypot(*x), bound[0], unit, tolerance)
            for passed, (x, bound, unit, tolerance) in checks
            if passed
        ]
