"""Detection of a diverged simulation, by the same rule for all plants."""

import math
from collections.abc import Sequence

from hric_core.errors import FailureError

VELOCITY_FACTOR = 100.0
"""Ratio of a joint's speed to its velocity limit up to which it has not diverged [1] (project default, unconfirmed)."""
LOWEST_BOUND = 1000.0
"""Speed up to which no joint has diverged, whatever its velocity limit [rad/s or m/s] (project default, unconfirmed).

Gravity alone can move joints far beyond the limits of their drives: a rod of length L that falls from upright reaches
sqrt(6 g / L), 77 rad/s for 1 cm and 243 rad/s for 1 mm, and a sliding body reaches 1000 m/s after falling for 100 s. On
the other hand, no integrator can follow a rotation of 1 rad within a step of 1 ms."""


class DivergedError(FailureError):
    """Diverged simulation; the message names joint, simulation time and value in one line.

    Attributes:
        joint: joint name in the description.
        time: simulation time at the end of the step [s].
        quantity: "position", "speed" or "effort".
        value: value of the quantity, not finite or beyond its bound [rad or m, rad/s or m/s, N m or N].
    """

    def __init__(self, joint: str, time: float, quantity: str, value: float, unit: str, why: str) -> None:
        self.joint, self.time, self.quantity, self.value = joint, time, quantity, value
        super().__init__(f"the simulation diverged at {time:.3f} s: {quantity} of {joint} is {value:.4g} {unit}, {why}")


class Divergence:
    """Check for divergence after each step of a plant; it usually takes well under a microsecond.

    Args:
        joints: names of all moving joints, including passive ones.
        velocity_limits: velocity limits in the description, infinite if there is none, n floats [rad/s or m/s].
        prismatic: True for each prismatic joint, n values.
        time_step: time step of the plant [s].

    Attributes:
        quiet: speed up to which none of the joints has diverged [rad/s or m/s].
        steps: number of checked steps, and of those that needed no check.
    """

    def __init__(
        self, joints: Sequence[str], velocity_limits: Sequence[float], prismatic: Sequence[bool], time_step: float
    ) -> None:
        self._joints, self._limits = list(joints), list(velocity_limits)
        self._units = ["m" if slides else "rad" for slides in prismatic]
        self._bounds = [bound(limit) for limit in velocity_limits]
        self.quiet = min(self._bounds, default=math.inf)
        self._time_step, self.steps = time_step, 0

    def check(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Check the joint state; to be called once after each step.

        A step after which all is known to be finite and no faster than `quiet` needs no check, but counts in `steps`.

        Args:
            q: positions of all moving joints, n floats [rad or m].
            dq: velocities of all moving joints, n floats [rad/s or m/s].

        Raises:
            DivergedError: a joint's position or velocity is not finite, or its speed is beyond its bound.
        """
        self.steps += 1
        # A norm is NaN or infinite if an element is, and no joint is faster than the norm: so the check of every
        # single joint is rarely needed.
        if not (math.hypot(*dq) <= self.quiet and math.hypot(*q) < math.inf):
            self._look(q, dq)

    def check_efforts(self, efforts: Sequence[float]) -> None:
        """Check efforts before a step; an integrator with error control would hang if one was not finite.

        Args:
            efforts: efforts of all moving joints, n floats [N m or N].

        Raises:
            DivergedError: an effort is not finite.
        """
        if not math.hypot(*efforts) < math.inf:
            for joint, value, length in zip(self._joints, efforts, self._units, strict=True):
                if not math.isfinite(value):
                    unit = "N" if length == "m" else "N m"
                    raise DivergedError(joint, self.steps * self._time_step, "effort", value, unit, "not finite")

    def fail(self, dq: Sequence[float], why: str) -> DivergedError:
        """Return the error for a step that the integrator could not make.

        It names the joint whose speed is largest relative to its bound.

        Args:
            dq: velocities of all moving joints before the step [rad/s or m/s].
            why: error message of the integrator.
        """
        worst = self._fastest(dq)
        return DivergedError(
            self._joints[worst], self.steps * self._time_step, "speed", dq[worst], f"{self._units[worst]}/s", why
        )

    def _fastest(self, dq: Sequence[float]) -> int:
        return max(range(len(dq)), key=lambda i: abs(dq[i]) / self._bounds[i])

    def _look(self, q: Sequence[float], dq: Sequence[float]) -> None:
        time = self.steps * self._time_step
        for quantity, values, per in (("speed", dq, "/s"), ("position", q, "")):
            for joint, value, unit in zip(self._joints, values, self._units, strict=True):
                if not math.isfinite(value):
                    raise DivergedError(joint, time, quantity, value, unit + per, "not finite")
        i = self._fastest(dq)
        if abs(dq[i]) > self._bounds[i]:
            raise DivergedError(self._joints[i], time, "speed", dq[i], f"{self._units[i]}/s", self._reason(i))

    def _reason(self, i: int) -> str:
        limit, unit = self._limits[i], f"{self._units[i]}/s"
        limited = f"velocity limit {limit:g} {unit}" if math.isfinite(limit) else "no velocity limit"
        return f"beyond {self._bounds[i]:.4g} {unit} ({limited})"


def bound(velocity_limit: float) -> float:
    """Return the speed beyond which a joint has diverged [rad/s or m/s].

    Args:
        velocity_limit: velocity limit in the description, infinite if there is none [rad/s or m/s].
    """
    return max(VELOCITY_FACTOR * velocity_limit if math.isfinite(velocity_limit) else 0.0, LOWEST_BOUND)
