"""Limiters of velocity and position commands."""

import math

from hric_control.limits.effort import FINITE, TOUCHED, Limiter, clamp, counted
from hric_control.limits.values import INFINITY, JointLimits


def stopping_speed(distance: float, acceleration: float, period: float) -> float:
    """Return the largest speed [rad/s] from which a joint can still stop within a distance, if braked once per period.

    With speed in units of a dt and distance in units of a dt^2, braking from speed n + f (n whole, 0 <= f < 1) takes
    the distance n (n + 1) / 2 + (n + 1) f. Without an acceleration limit the whole distance may be covered in one step.

    Args:
        distance: distance to the limit [rad]; 0 if the joint is at or beyond it.
        acceleration: largest deceleration [rad/s^2].
        period: cycle time [s].
    """
    if distance <= 0.0:
        return 0.0
    if distance == INFINITY:
        return INFINITY
    if acceleration == INFINITY:
        return distance / period
    step = acceleration * period
    if step == 0.0:
        return 0.0
    units = distance / (step * period)
    n = math.floor(math.sqrt(0.25 + 2.0 * units) - 0.5)
    return step * (n + (units - 0.5 * n * (n + 1)) / (n + 1))


def _speeds(limit: JointLimits, position: float, period: float) -> tuple[float, float]:
    """Return the smallest and largest velocity [rad/s] that range and soft limits allow at a position [rad]."""
    low = -stopping_speed(position - limit.lower, limit.acceleration, period)
    high = stopping_speed(limit.upper - position, limit.acceleration, period)
    if limit.has_soft_range:
        soft_low, soft_high = limit.soft_speeds(position)
        low, high = max(low, soft_low), min(high, soft_high)
    return min(low, max(high, 0.0)), max(high, min(low, 0.0))


class VelocityLimiter(Limiter):
    """Limiter of velocity commands by velocity limit, position range, soft limits, and last acceleration.

    The command is limited so that the joint can brake before the end of its range; outside the range only a velocity
    towards the range is allowed. The acceleration limit acts on the change of the command per cycle.
    """

    _kind = "velocity"

    def _prepare(self, period: float) -> None:
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            if not chosen:
                self._low[i], self._high[i], self._bound[i], self._change[i] = -INFINITY, INFINITY, FINITE, INFINITY
                continue
            v, a = limit.velocity, limit.acceleration
            reach = v * period if a == INFINITY else v * period + 0.5 * v * v / a if a > 0.0 else INFINITY
            low = limit.lower + reach if limit.lower > -INFINITY else -INFINITY
            high = limit.upper - reach if limit.upper < INFINITY else INFINITY
            self._low[i], self._high[i] = limit.full_speed_range(low, high)
            self._bound[i], self._change[i] = min(v, FINITE), a * period

    def _first(self, i: int, q: float, v: float) -> float:
        return v

    def _enforced(self, i: int, q: float, v: float, value: float, last: float) -> float:
        counts, limit, change = self.counts, self.limits[i], self._change[i]
        fastest = clamp(value, -limit.velocity, limit.velocity)
        stoppable = counted(counts.position, i, fastest, clamp(fastest, *_speeds(limit, q, self._period)))
        allowed = clamp(stoppable, last - change, last + change)
        if abs(fastest - value) > TOUCHED or abs(allowed - stoppable) > TOUCHED:
            counts.velocity[i] += 1
        return allowed


class PositionLimiter(Limiter):
    """Limiter of position commands by range and soft limits; the change per cycle by velocity and acceleration limits.

    If the joint starts outside its range, the command moves back into the range at the velocity limit, without a jump.
    """

    _kind = "position"
    _bounds_command = True

    def _prepare(self, period: float) -> None:
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            self._low[i], self._high[i], self._bound[i], self._change[i] = -FINITE, FINITE, FINITE, INFINITY
            if chosen:
                low, high = max(limit.lower, -FINITE), min(limit.upper, FINITE)
                self._low[i], self._high[i] = limit.full_speed_range(low, high)
                # With an acceleration limit each command depends on the last speed, so the quick test must fail.
                self._change[i] = limit.velocity * period if limit.acceleration == INFINITY else -1.0

    def _first(self, i: int, q: float, v: float) -> float:
        self._speed[i] = v
        return q

    def _enforced(self, i: int, q: float, v: float, value: float, last: float) -> float:
        counts, limit, period = self.counts, self.limits[i], self._period
        goal = clamp(value, limit.lower, limit.upper)
        if limit.has_soft_range:
            low, high = limit.soft_speeds(last)
            # If the soft limits allow the full speed, only the velocity limit below acts, and is counted.
            low, high = low if low > -limit.velocity else -INFINITY, high if high < limit.velocity else INFINITY
            goal = clamp(goal, last + min(low, 0.0) * period, last + max(high, 0.0) * period)
        counted(counts.position, i, value, goal)
        speed = clamp((goal - last) / period, -limit.velocity, limit.velocity)
        if limit.acceleration < INFINITY:
            speed = self._accelerated(limit, speed, last, goal, self._speed[i])
        reached = goal if abs(last + speed * period - goal) <= TOUCHED else last + speed * period
        self._speed[i] = (reached - last) / period
        return counted(counts.velocity, i, goal, reached)

    def _accelerated(self, limit: JointLimits, speed: float, last: float, goal: float, before: float) -> float:
        """Return a speed within the acceleration limit, slow enough to stop at the commanded position [rad/s]."""
        reach = stopping_speed(abs(goal - last), limit.acceleration, self._period)
        change = limit.acceleration * self._period
        return clamp(clamp(speed, -reach, reach), before - change, before + change)
