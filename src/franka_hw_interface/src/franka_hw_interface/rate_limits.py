"""Low-pass filters and rate limits of libfranka's control loops, for arms that are commanded without libfranka."""

import math
from collections.abc import Sequence

from franka_hw_interface.limits import FrankaLimits

PERIOD = 1e-3
"""Control period of libfranka [s]."""
MAX_CUTOFF = 1000.0
"""Cut-off frequency at and above which libfranka does not filter (lowpass_filter.h) [Hz]."""
MARGIN = 1e-3
"""Margin by which libfranka lowers every rate limit (rate_limiting.h)."""
ECHO_TOLERANCE = 1e-4
"""Maximum difference between the last sent command and the one in the arm's state [N m], [rad], [rad/s].

Within it the sent value is used: it is more exact, since the FR3 sends its state in single precision.
"""


def gain(cutoff_frequency: float) -> float:
    """Return the weight g of the new value u in libfranka's low-pass y = g u + (1 - g) y_last, for a cut-off [Hz].

    g = dt / (dt + 1 / (2 pi f)), as in lowpass_filter.h.
    """
    return 1.0 if cutoff_frequency >= MAX_CUTOFF else PERIOD / (PERIOD + 1.0 / (2.0 * math.pi * cutoff_frequency))


def _in_force(sent: list[float], echo: Sequence[float]) -> list[float]:
    return [a if abs(a - b) < ECHO_TOLERANCE else b for a, b in zip(sent, echo, strict=True)]


class TorqueSmoother:
    """Low-pass filter for torque commands, followed by a limit of the torque rate.

    Args:
        limits: limits of the arm, of which those of rates are used; None: rates are not limited.
        cutoff_frequency: cut-off frequency of the low-pass [Hz].
    """

    def __init__(self, limits: FrankaLimits | None, cutoff_frequency: float) -> None:
        self._gain = gain(cutoff_frequency)
        self._change = [math.inf] * 7 if limits is None else [(rate - MARGIN) * PERIOD for rate in limits.effort_rate]
        self._sent = [0.0] * 7

    def smooth(self, tau: Sequence[float], tau_J_d: Sequence[float]) -> list[float]:
        """Return the desired torques, filtered and limited in rate, 7 floats [N m].

        Args:
            tau: desired torques, 7 floats [N m].
            tau_J_d: last accepted torques, from the arm's state, 7 floats [N m].
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
    """Return a velocity within the limits of velocity, acceleration and jerk, like libfranka's limitRate for one joint.

    Args:
        desired: desired velocity [rad/s].
        v: present velocity [rad/s].
        a: present acceleration [rad/s^2].
        v_max: velocity limit [rad/s].
        a_max: acceleration limit [rad/s^2].
        j_max: jerk limit [rad/s^3].
        period: period of the commands [s].
    """
    jerk = ((desired - v) / period - a) / period
    acceleration = a + min(max(jerk, -j_max), j_max) * period
    # Near the velocity limit the acceleration must fall, or the jerk limit is exceeded when the limit is reached.
    high = min(j_max / a_max * (v_max - v), a_max)
    low = max(j_max / a_max * (-v_max - v), -a_max)
    return v + max(min(acceleration, high), low) * period


class JointSmoother:
    """Low-pass filter for joint position or velocity commands, with limits of velocity, acceleration and jerk.

    Commands that libfranka's limiter would accept pass unchanged. Position commands beyond the limits (steps, straight
    lines between waypoints) are approached differently: libfranka aims at the velocity (desired - q) / period, which
    overshoots and may oscillate about the goal forever. Here the distance is closed only as fast as the motion can be
    braked, in addition to the velocity of the desired motion.

    Args:
        limits: limits of the arm, of which those of rates are used; None: rates are not limited.
        cutoff_frequency: cut-off frequency of the low-pass [Hz].
        positions: True if the commands are positions; False: velocities.
        period: period of the commands [s].
    """

    def __init__(
        self, limits: FrankaLimits | None, cutoff_frequency: float, positions: bool, period: float = PERIOD
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
        """Return the commands to send, 7 floats [rad] or [rad/s].

        Args:
            desired: desired positions or velocities, 7 floats [rad] or [rad/s].
            q_d: present desired positions, from the arm's state, 7 floats [rad].
            dq_d: present desired velocities, from the arm's state, 7 floats [rad/s].
            ddq_d: present desired accelerations, from the arm's state, 7 floats [rad/s^2].
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
        """Return the velocity of the desired motion, plus a velocity that closes the distance to it [rad/s]."""
        period = self._period
        if not self._rows:
            return [(u - x) / period for u, x in zip(target, self._q, strict=True)]
        rows = zip(target, before, self._q, self._rows, strict=True)
        return [(u - y) / period + catching_up(y - x, row[1], period) for u, y, x, row in rows]

    def _take_what_is_in_force(self, q_d: Sequence[float], dq_d: Sequence[float], ddq_d: Sequence[float]) -> None:
        """Continue from the last sent command, or from the arm's state if it differs (a lost packet, a new motion)."""
        positions = zip(self._q if self._positions else self._dq, q_d if self._positions else dq_d, strict=True)
        same = all(abs(a - b) < ECHO_TOLERANCE for a, b in positions) and all(
            abs(a - b) < ECHO_TOLERANCE for a, b in zip(self._dq, dq_d, strict=True)
        )
        if not same:
            self._q, self._dq, self._ddq = list(q_d), list(dq_d), list(ddq_d)
            self._filtered = list(q_d if self._positions else dq_d)


def catching_up(distance: float, a_max: float, period: float) -> float:
    """Return the velocity [rad/s] towards a goal from which a quarter of the acceleration limit suffices to stop there.

    The rest of the acceleration limit is a reserve, since the jerk limit delays the braking.

    Args:
        distance: distance to the goal [rad].
        a_max: acceleration limit [rad/s^2].
        period: period of the commands [s].
    """
    return math.copysign(min(abs(distance) / period, math.sqrt(0.5 * a_max * abs(distance))), distance)
