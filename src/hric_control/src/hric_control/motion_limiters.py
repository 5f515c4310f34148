"""Limits of velocity and position commands."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hric_control.effort_limiter import FINITE, TOUCHED, Limiter, clamp
from hric_control.hardware_interface import JointCommands, JointStates
from hric_control.limit_counts import LimitCounts
from hric_control.limit_values import INFINITY, JointLimits


def stopping_speed(distance: float, acceleration: float, period: float) -> float:
    """Largest speed from which a joint, braked at `acceleration` in steps of `period`, still stops within `distance`.

    In units of a dt (speed) and a dt^2 (distance), braking from n + f covers n (n + 1) / 2 + (n + 1) f, with n whole and 0 <= f < 1.
    Without an acceleration limit the whole distance may be covered in one step.

    Args:
        distance: to the limit [rad]; 0 when at or beyond it.
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
    """Least and greatest velocity that the position allows [rad/s]: the stop of the range, and the soft limits."""
    low = -stopping_speed(position - limit.lower, limit.acceleration, period)
    high = stopping_speed(limit.upper - position, limit.acceleration, period)
    if limit.has_soft_range:
        soft_low, soft_high = limit.soft_speeds(position)
        low, high = max(low, soft_low), min(high, soft_high)
    return min(low, max(high, 0.0)), max(high, min(low, 0.0))


class VelocityLimiter(Limiter):
    """Limits velocity commands: velocity bound, braking before the end of the range (soft limits bend it), acceleration last.

    Outside the range only inward velocity passes. Acceleration is the change of the command per cycle.
    """

    def enforce(self, period: float) -> None:
        """Limit the commands in place.

        Args:
            period: time since the last cycle [s].
        """
        counts, states, value = self.counts, self.states, self.commands.value
        if period != self._period or counts.run != self._run:
            self._begin(period)
        counts.cycles += 1
        for q, v, wanted, last, v_quick, (i, q_low, q_high, v_max, change) in zip(
            states.position, states.velocity, value, self._previous, self._v_quick, self._rows, strict=True
        ):
            if q_low <= q <= q_high and -v_quick <= v <= v_quick and -v_max <= wanted <= v_max and -change <= wanted - last <= change:
                continue
            value[i] = self._limit(i, q, v, wanted, last, change)
        self._previous[:] = value

    def _prepare(self, period: float) -> None:
        self._rows = []
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            if not chosen:
                self._rows.append((i, -INFINITY, INFINITY, FINITE, INFINITY))
                continue
            v, a = limit.velocity, limit.acceleration
            reach = v * period if a == INFINITY else v * period + 0.5 * v * v / a if a > 0.0 else INFINITY
            low = limit.lower + reach if limit.lower > -INFINITY else -INFINITY
            high = limit.upper - reach if limit.upper < INFINITY else INFINITY
            if limit.has_soft_range:
                reach = v / limit.k_position
                low, high = max(low, limit.soft_lower + reach), min(high, limit.soft_upper - reach)
            self._rows.append((i, low, high, min(v, FINITE), a * period))

    def _limit(self, i: int, q: float, v: float, value: float, last: float, change: float) -> float:
        counts, limit = self.counts, self.limits[i]
        last = last if math.isfinite(last) else v
        if not math.isfinite(value + q + v):
            self._not_finite(i, counts.velocity)
            return last if math.isfinite(last) else 0.0
        self._note_speed(i, abs(v))
        if not self._selected[i]:
            return value
        self._note_position(i, q)
        wanted, value = value, clamp(value, -limit.velocity, limit.velocity)
        fast = abs(value - wanted) > TOUCHED
        wanted, value = value, clamp(value, *_speeds(limit, q, self._period))
        if abs(value - wanted) > TOUCHED:
            counts.position[i] += 1
        wanted, value = value, clamp(value, last - change, last + change)
        if fast or abs(value - wanted) > TOUCHED:
            counts.velocity[i] += 1
        return value


class PositionLimiter(Limiter):
    """Limits position commands: range (soft limits bend the approach), then the change per cycle by velocity and acceleration.

    A command that begins outside the range is led back to it at the velocity limit, not in one jump.
    """

    def __init__(self, states: JointStates, commands: JointCommands, limits: Sequence[JointLimits], counts: LimitCounts | None = None) -> None:
        super().__init__(states, commands, limits, counts)
        self._speed = [0.0] * len(self.limits)

    def enforce(self, period: float) -> None:
        """Limit the commands in place.

        Args:
            period: time since the last cycle [s].
        """
        counts, states, value = self.counts, self.states, self.commands.value
        if period != self._period or counts.run != self._run:
            self._begin(period)
        counts.cycles += 1
        for q, v, wanted, last, v_quick, (i, low, high, change) in zip(
            states.position, states.velocity, value, self._previous, self._v_quick, self._rows, strict=True
        ):
            if -v_quick <= v <= v_quick and low <= wanted <= high and -change <= wanted - last <= change:
                continue
            value[i] = self._limit(i, q, wanted, last)
        self._previous[:] = value

    def _prepare(self, period: float) -> None:
        self._rows = []
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            if not chosen:
                self._rows.append((i, -FINITE, FINITE, INFINITY))
                continue
            low, high = max(limit.lower, -FINITE), min(limit.upper, FINITE)
            if limit.has_soft_range:
                reach = limit.velocity / limit.k_position
                low, high = max(low, limit.soft_lower + reach), min(high, limit.soft_upper - reach)
            # With an acceleration limit each command needs the speed before it: always the long way.
            change = limit.velocity * period if limit.acceleration == INFINITY else -1.0
            self._rows.append((i, low, high, change))

    def _limit(self, i: int, q: float, value: float, last: float) -> float:
        counts, limit, period = self.counts, self.limits[i], self._period
        if not math.isfinite(last):
            last, self._speed[i] = q, self.states.velocity[i]
        if not math.isfinite(value + last):
            self._not_finite(i, counts.position)
            return last if math.isfinite(last) else 0.0
        self._note_speed(i, abs(self.states.velocity[i]))
        if not self._selected[i]:
            return value
        self._note_position(i, q)
        wanted, value = value, clamp(value, limit.lower, limit.upper)
        if limit.has_soft_range:
            low, high = limit.soft_speeds(last)
            # Where they leave the whole speed, it is the velocity limit below that cuts, and that counts.
            low, high = low if low > -limit.velocity else -INFINITY, high if high < limit.velocity else INFINITY
            value = clamp(value, last + min(low, 0.0) * period, last + max(high, 0.0) * period)
        if abs(value - wanted) > TOUCHED:
            counts.position[i] += 1
        wanted, speed = value, clamp((value - last) / period, -limit.velocity, limit.velocity)
        if limit.acceleration < INFINITY:
            speed = self._accelerated(limit, speed, last, value, self._speed[i])
        value = value if abs(last + speed * period - value) <= TOUCHED else last + speed * period
        if abs(value - wanted) > TOUCHED:
            counts.velocity[i] += 1
        self._speed[i] = (value - last) / period
        return value

    def _accelerated(self, limit: JointLimits, speed: float, last: float, goal: float, before: float) -> float:
        """Speed of this cycle within the acceleration limit, slow enough to stop at the commanded position [rad/s]."""
        reach = stopping_speed(abs(goal - last), limit.acceleration, self._period)
        change = limit.acceleration * self._period
        return clamp(clamp(speed, -reach, reach), before - change, before + change)
