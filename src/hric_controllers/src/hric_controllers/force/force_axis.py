"""Force on a surface along one axis: approach, contact, loss of contact. No ROS.

With f the force that the arm exerts, v its velocity, both along the desired force w > 0, the push F along the axis is

    approach:  F = I + d_a (v_a - v),                    dI/dt = d_a (v_a - v) / T,  until f is the contact force
    contact:   F = I + r - d v - d_a max(0, v - v_a),    dI/dt = k_i (r - f)

I, which is limited, balances what disturbs the arm, such as friction; so the contact begins and ends without a jump. r
moves from the force at the first touch to w at a limited rate. F is limited by w in the approach, I + r by `limit`;
meanwhile I does not grow (anti-windup). If f stays below half of the contact force, the contact is lost, and the
approach begins again: the arm never moves much faster than v_a.

There is no proportional gain, as the estimate of f lags by some milliseconds: on a surface of stiffness k, a gain k_p
with a lag T acts as a negative damping of k_p k T. The integral acts as one of k_i m, with the mass m of the arm.
"""

import math
from dataclasses import dataclass

LOST_AFTER = 0.05
"""Time below half of the contact force after which the contact is lost; longer than a bounce [s].

Project default, unconfirmed."""
APPROACH_TIME = 0.2
"""Time constant T of the integral in the approach [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class ForceGains:
    """Gains of a force axis.

    Attributes:
        integral: k_i [1/s].
        integral_limit: largest size of I [N].
        damping: d, damping in contact [N s/m].
        approach_damping: d_a [N s/m].
        approach_speed: v_a [m/s].
        contact_force: force from which on there is contact [N].
        force_rate: rate at which r moves [N/s].
    """

    integral: float
    integral_limit: float
    damping: float
    approach_damping: float
    approach_speed: float
    contact_force: float
    force_rate: float


class ForceAxis:
    """Force controller of one axis.

    Attributes:
        touching: True in contact.
        reference: r, the force to which f is controlled now; 0 in the approach [N].
        approached: displacement along the desired force since the begin of this approach; 0 in contact [m].
    """

    def __init__(self, gains: ForceGains) -> None:
        self._gains = gains
        self.start()

    def start(self) -> None:
        """Restart with the approach, and clear the integral."""
        self.touching, self._integral, self.reference, self._apart = False, 0.0, 0.0, 0.0
        self.approached = 0.0

    def advance(
        self,
        desired: float,
        force: float,
        velocity: float,
        period: float,
        limit: float = math.inf,
        pace: float = 1.0,
    ) -> float:
        """Advance by one cycle and return the push F, signed along the axis [N].

        Args:
            desired: desired force along the axis, not 0 [N].
            force: force that the arm exerts along the axis [N].
            velocity: velocity of the end effector along the axis [m/s].
            period: time since the last cycle [s].
            limit: largest size of the push without damping [N].
            pace: speed scale, 0 to 1, by which the approach speed is multiplied.
        """
        gains, w = self._gains, abs(desired)
        approach_speed = gains.approach_speed * pace
        f, v = (math.copysign(1.0, desired) * value for value in (force, velocity))
        self._apart = self._apart + period if f < 0.5 * gains.contact_force else 0.0
        if self._apart >= LOST_AFTER:
            self.touching, self.reference = False, 0.0
        elif not self.touching and f >= gains.contact_force:
            self.touching, self.reference = True, min(f, w)
        self.approached = 0.0 if self.touching else self.approached + v * period
        damper = 0.0
        if self.touching:
            self.reference += _clamped(w - self.reference, gains.force_rate * period)
            rate = gains.integral * (self.reference - f) if self._apart == 0.0 else 0.0
            push = self.reference
            damper = gains.damping * v + gains.approach_damping * max(0.0, v - approach_speed)
        else:
            push = gains.approach_damping * (approach_speed - v)
            rate, limit = push / APPROACH_TIME, min(w, limit)
        if abs(push + self._integral) <= limit or (push + self._integral) * rate < 0.0:
            self._integral = _clamped(self._integral + rate * period, gains.integral_limit)
        return math.copysign(1.0, desired) * (_clamped(push + self._integral, limit) - damper)


def _clamped(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
