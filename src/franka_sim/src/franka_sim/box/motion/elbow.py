"""Elbow of a Cartesian motion: position of joint 3 and sign (side) of joint 4, commanded by the client or held."""

import math
from collections.abc import Sequence

from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.inverse_kinematics import ELBOW_JOINT, elbow_side
from franka_sim.box.rate_limits import SpaceRates

LIMIT_VIOLATION = frozenset({"cartesian_motion_generator_elbow_limit_violation"})
SIGN_INCONSISTENT = frozenset({"cartesian_motion_generator_elbow_sign_inconsistent"})
START_SIGN_INCONSISTENT = frozenset({"start_elbow_sign_inconsistent"})
START_INVALID = frozenset({"cartesian_motion_generator_start_elbow_invalid"})


class ElbowMotion:
    """Desired motion of the elbow (position of joint 3), and the check of its limits.

    Attributes:
        commanded: True if the client commands the elbow; otherwise joint 3 is held at `desired` if the pose allows.
        desired: position of joint 3 after this step [rad].
        reason: explanation of the last violations.
        position, velocity, acceleration: after the last accepted step [rad], [rad/s], [rad/s^2].

    Args:
        rates: limits of the elbow.
        time_step: control period [s].
    """

    def __init__(self, rates: SpaceRates, time_step: float) -> None:
        self._rates, self._dt = rates, time_step
        self.start([0.0] * 7)

    def start(self, q_d: Sequence[float]) -> None:
        """Start at rest at q_d, 7 floats [rad]."""
        self.position = self.desired = q_d[ELBOW_JOINT]
        self.velocity = self.acceleration = 0.0
        self._next = (0.0, 0.0)
        self._side, self.commanded, self.reason = elbow_side(q_d), False, ""

    def refused(self, elbow: tuple[float, float] | None, moving: bool) -> Errors:
        """Return the errors in the values of a commanded elbow; moving: False for the motion's first command."""
        if elbow is None:
            return NO_ERRORS
        if not math.isfinite(elbow[0]):
            return LIMIT_VIOLATION
        if elbow[1] != self._side:
            return SIGN_INCONSISTENT if moving else START_SIGN_INCONSISTENT
        if not moving and not self._rates.reachable([(elbow[0] - self.position) / self._dt]):
            return START_INVALID
        return NO_ERRORS

    def command(self, elbow: tuple[float, float] | None) -> None:
        """Read the elbow command of this step; if the client stops commanding the elbow, its position is held."""
        if elbow is None:
            if self.commanded:
                self.desired = self.position
            self.commanded = False
            return
        self.commanded, self.desired = True, elbow[0]
        velocity = (elbow[0] - self.position) / self._dt
        self._next = velocity, (velocity - self.velocity) / self._dt

    def bridge(self) -> None:
        """Bridge a lost packet: a commanded elbow continues with constant acceleration."""
        if self.commanded:
            velocity = self.velocity + self.acceleration * self._dt
            self._next, self.desired = (velocity, self.acceleration), self.position + velocity * self._dt

    def violations(self, after_loss: bool) -> Errors:
        """Return the error if a commanded elbow exceeds a limit; one name for velocity, acceleration and jerk."""
        if not self.commanded:
            return NO_ERRORS
        velocity, acceleration = self._next
        motion = [velocity], [acceleration], [self.acceleration]
        violated = self._rates.violated(*motion, after_loss)
        if not any(violated):
            return NO_ERRORS
        self.reason = "; ".join(self._rates.reasons(violated, *motion))
        return LIMIT_VIOLATION

    def side_violated(self, q: Sequence[float]) -> Errors:
        """Return an error if joint 4 of q (7 floats [rad]) is on another side than the commanded elbow."""
        return SIGN_INCONSISTENT if self.commanded and elbow_side(q) != self._side else NO_ERRORS

    def took(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> None:
        """Store an accepted step of the joints; 7 floats each [rad], [rad/s], [rad/s^2]."""
        self._side = elbow_side(q)
        if self.commanded:
            self.position, (self.velocity, self.acceleration) = self.desired, self._next
        else:
            self.position, self.velocity, self.acceleration = q[ELBOW_JOINT], dq[ELBOW_JOINT], ddq[ELBOW_JOINT]
