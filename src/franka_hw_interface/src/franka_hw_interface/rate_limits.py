"""What libfranka's control loops do to joint commands, for arms that are commanded without them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

PERIOD = 1e-3
"""libfranka's control period [s]."""
MAX_CUTOFF = 1000.0
"""From this cut-off frequency on libfranka does not filter (lowpass_filter.h) [Hz]."""
MARGIN = 1e-3
"""libfranka works with every limit of rate less this much (rate_limiting.h)."""
ECHO_TOLERANCE = 1e-4
"""The FR3 echoes in single precision: within this the value sent last counts as the one in force, which is more exact
[N m], [rad], [rad/s]."""


@dataclass(frozen=True)
class RateLimits:
    """Largest rates per joint, 7 floats each.

    Attributes:
        effort_rate: [N m/s].
        velocity, acceleration, jerk: [rad/s], [rad/s^2], [rad/s^3].
    """

    effort_rate: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    jerk: tuple[float, ...]


def gain(cutoff_frequency: float) -> float:
    """Weight of the new value in y = g u + (1 - g) y_last, g = dt / (dt + 1 / (2 pi f)) (lowpass_filter.h)."""
    return 1.0 if cutoff_frequency >= MAX_CUTOFF else PERIOD / (PERIOD + 1.0 / (2.0 * math.pi * cutoff_frequency))


def _in_force(sent: list[float], echo: Sequence[float]) -> list[float]:
    return [a if abs(a - b) < ECHO_TOLERANCE else b for a, b in zip(sent, echo, strict=True)]


class TorqueSmoother:
    """Low-pass, then at most the torque rate limit per millisecond away from the torque in force.

    Args:
        limits: None: rates are not limited.
        cutoff_frequency: of the low-pass [Hz].
    """

    def __init__(self, limits: RateLimits | None, cutoff_frequency: float) -> None:
        self._gain = gain(cutoff_frequency)
        self._change = [math.inf] * 7 if limits is None else [(rate - MARGIN) * PERIOD for rate in limits.effort_rate]
        self._sent = [0.0] * 7

    def smooth(self, tau: Sequence[float], tau_J_d: Sequence[float]) -> list[float]:
        """The torque to send, 7 floats [N m].

        Args:
            tau: desired, 7 floats [N m].
            tau_J_d: in force, as the arm echoes it, 7 floats [N m].
        """
        g, last = self._gain, _in_force(self._sent, tau_J_d)
        filtered = tau if g == 1.0 else [g * u + (1.0 - g) * y for u, y in zip(tau, last, strict=True)]
        self._sent = [
            min(max(u, y - change), y + change) for u, y, change in zip(filtered, last, self._change, strict=True)
        ]
        return self._sent


def limited_velocity(
    desired: float, v: float, a: float, v_max: float, a_max: float, j_max: float, period: float = PERIOD
) -> float:
    """Velocity within the limits of velocity, acceleration and jerk, as libfranka's limitRate for one joint.

    Args:
        desired: [rad/s].
        v, a: velocity and acceleration in force [rad/s], [rad/s^2].
        v_max, a_max, j_max: limits.
        period: of the commands [s].
    """
    jerk = ((desired - v) / period - a) / period
    acceleration = a + min(max(jerk, -j_max), j_max) * period
    # Near the velocity limit the acceleration must fall, so that the jerk limit is not broken when it is reached.
    high = min(j_max / a_max * (v_max - v), a_max)
    low = max(j_max / a_max * (-v_max - v), -a_max)
    return v + max(min(acceleration, high), low) * period


class JointSmoother:
    """The same for joint positions or velocities, with limits of velocity, acceleration and jerk.

    What libfranka's own limiter would pass, passes unchanged. Positions that it would not (straight lines between way
    points, steps) it catches up with at (desired - q) / period, which overshoots and may circle around the goal for
    ever; here the distance is closed no faster than it can be braked away, beside the velocity of the desired motion.

    Args:
        limits: None: rates are not limited.
        cutoff_frequency: of the low-pass [Hz].
        positions: whether the commands are positions; False: velocities.
        period: of the commands [s].
    """

    def __init__(
        self, limits: RateLimits | None, cutoff_frequency: float, positions: bool, period: float = PERIOD
    ) -> None:
        self._gain, self._positions, self._period = gain(cutoff_frequency), positions, period
        self._rows: list[tuple[float, float, float]] = []
        if limits is not None:
            rows = zip(limits.velocity, limits.acceleration, limits.jerk, strict=True)
            self._rows = [(v - MARGIN, a - MARGIN, j - MARGIN) for v, a, j in rows]
        self._q, self._dq, self._ddq = [0.0] * 7, [0.0] * 7, [0.0] * 7
        self._filtered = [0.0] * 7

    def smooth(
        self, desired: Sequence[float], q_d: Sequence[float], dq_d: Sequence[float], ddq_d: Sequence[float]
    ) -> list[float]:
        """What to send, 7 floats [rad] or [rad/s].

        Args:
            desired: 7 floats [rad] or [rad/s].
            q_d, dq_d, ddq_d: in force, as the arm echoes them, 7 floats each.
        """
        self._take_what_is_in_force(q_d, dq_d, ddq_d)
        g, before, period = self._gain, self._filtered, self._period
        target = self._filtered = (
            list(desired) if g == 1.0 else [g * u + (1.0 - g) * y for u, y in zip(desired, before, strict=True)]
        )
        velocity = self._velocity(target, before) if self._positions else target
        if self._rows:
            rows = zip(velocity, self._dq, self._ddq, self._rows, strict=True)
            velocity = [limited_velocity(u, v, a, *row, period) for u, v, a, row in rows]
        self._ddq = [(u - v) / period for u, v in zip(velocity, self._dq, strict=True)]
        self._dq = velocity
        self._q = [x + v * period for x, v in zip(self._q, velocity, strict=True)]
        return self._q if self._positions else velocity

    def _velocity(self, target: list[float], before: list[float]) -> list[float]:
        """Velocity of the desired motion, and what closes the distance to it [rad/s]."""
        period = self._period
        if not self._rows:
            return [(u - x) / period for u, x in zip(target, self._q, strict=True)]
        rows = zip(target, before, self._q, self._rows, strict=True)
        return [(u - y) / period + catching_up(y - x, row[1], period) for u, y, x, row in rows]

    def _take_what_is_in_force(self, q_d: Sequence[float], dq_d: Sequence[float], ddq_d: Sequence[float]) -> None:
        """What was sent last, unless the arm reports something else (a lost packet, a new motion)."""
        positions = zip(self._q if self._positions else self._dq, q_d if self._positions else dq_d, strict=True)
        same = all(abs(a - b) < ECHO_TOLERANCE for a, b in positions) and all(
            abs(a - b) < ECHO_TOLERANCE for a, b in zip(self._dq, dq_d, strict=True)
        )
        if not same:
            self._q, self._dq, self._ddq = list(q_d), list(dq_d), list(ddq_d)
            self._filtered = list(q_d if self._positions else dq_d)


def catching_up(distance: float, a_max: float, period: float) -> float:
    """Velocity towards a point that can be braked to nothing at a quarter of the limit of acceleration, which leaves
    room for the limit of jerk.

    Args:
        distance: [rad].
        a_max: [rad/s^2].
        period: of the commands [s].
    """
    return math.copysign(min(abs(distance) / period, math.sqrt(0.5 * a_max * abs(distance))), distance)
