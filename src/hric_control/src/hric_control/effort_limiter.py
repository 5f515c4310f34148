"""Limits of effort commands, enforced between the controllers' update and the write to the robot."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterable, Sequence

from hric_control.errors import HricError, UnknownNameError
from hric_control.hardware_interface import JointCommands, JointStates
from hric_control.limit_counts import LimitCounts
from hric_control.limit_values import INFINITY, JointLimits
from hric_control.vectors import near, smaller, within

TOUCHED = 1e-12
"""A limit was touched when it changed the command by more than this."""

FINITE = sys.float_info.max
"""Bound of the quick tests where there is no limit, so that an infinite command is caught too."""

_log = logging.getLogger("hric")


def clamp(value: float, low: float, high: float) -> float:
    """`value` within [low, high]; `high` wins where they cross."""
    return high if value > high else low if value < low else value


class Limiter:
    """What the limiters of all three interfaces share: the joints, the counts, the start outside the range.

    Args:
        states: measured state, of which the limits depend.
        commands: written in place by `enforce`.
        limits: one per joint, in the order of the states.
        counts: shared with other limiters of the robot, or None for an own one.

    Raises:
        HricError: the limits are not those of the joints.
    """

    def __init__(self, states: JointStates, commands: JointCommands, limits: Sequence[JointLimits], counts: LimitCounts | None = None) -> None:
        names = tuple(limit.name for limit in limits)
        if names != states.names:
            raise HricError(f"{type(self).__name__}: limits are for {', '.join(names) or 'no joint'}; the joints are {', '.join(states.names)}")
        self.states, self.commands = states, commands
        self.limits = tuple(limits)
        self.counts = LimitCounts(names, [limit.velocity for limit in limits]) if counts is None else counts
        self._selected = [True] * len(names)
        self._previous = [math.nan] * len(names)
        self._period, self._run = math.nan, -1
        self._v_near = [INFINITY] * len(names)  # speed below which the velocity limit cannot act
        self._v_quick = [0.0] * len(names)  # the same, but not above the largest speed seen, so that a new record takes the long way

    def reset(self, previous: Sequence[float] | None = None) -> None:
        """Set the command that the rate limits start from.

        Args:
            previous: n commands, in force until now. None: not known; the first effort command passes the rate limit, the first velocity and
                position commands start from the measured state.
        """
        if previous is not None and len(previous) != len(self._previous):
            raise HricError(f"{type(self).__name__}.reset: {len(previous)} values for {len(self._previous)} joints")
        self._previous[:] = [math.nan] * len(self._previous) if previous is None else [float(value) for value in previous]

    def select(self, names: Iterable[str] | None) -> None:
        """Enforce on these joints only (those driven through this interface now); None: on all. Newly selected ones start as after `reset(None)`."""
        wanted = self.states.names if names is None else tuple(names)
        for name in wanted:
            if name not in self.states.index:
                raise UnknownNameError("joint", name, self.states.names, type(self).__name__)
        now = [name in wanted for name in self.states.names]
        for i, (before, after) in enumerate(zip(self._selected, now, strict=True)):
            if after and not before:
                self._previous[i] = math.nan
        self._selected = now
        self._period = math.nan

    def check_start(self) -> None:
        """Say once which joints begin outside their range; `enforce` calls it in the first cycle after construction or `counts.clear()`."""
        self.counts.start_checked = True
        for i, (limit, position) in enumerate(zip(self.limits, self.states.position, strict=True)):
            if not limit.lower <= position <= limit.upper and not self.counts.started_outside[i]:
                self.counts.started_outside[i] = True
                _log.warning(
                    "%s starts at %.4f %s, outside its range [%.4f, %.4f]: until it is inside it may only move inwards",
                    limit.name, position, limit.unit, limit.lower, limit.upper,
                )  # fmt: skip

    def _begin(self, period: float) -> None:
        """Rarely called head of `enforce`: another period, another selection, or counts that were cleared."""
        if not self.counts.start_checked:
            self.check_start()
        self._period, self._run = period, self.counts.run
        self._prepare(period)
        for i in range(len(self.limits)):
            self._set_quick(i)

    def _prepare(self, period: float) -> None:
        """Set `_v_near` and what else bounds the quick tests: the bounds within which no limit can touch a command."""
        raise NotImplementedError

    def _set_quick(self, i: int) -> None:
        self._v_quick[i] = min(self.counts.speed_max[i], self._v_near[i])

    def _note_speed(self, i: int, speed: float) -> None:
        if speed > self.counts.speed_max[i]:
            self.counts.speed_max[i] = speed
            self._set_quick(i)

    def _note_position(self, i: int, position: float) -> None:
        limit = self.limits[i]
        excess = max(limit.lower - position, position - limit.upper)
        if excess > self.counts.position_excess_max[i]:
            self.counts.position_excess_max[i] = excess

    def _not_finite(self, i: int, kind: list[int]) -> None:
        if not self.counts.not_finite[i]:
            _log.error("the command or the state of %s is not a number; the command before it stays in force", self.limits[i].name)
        self.counts.not_finite[i] += 1
        kind[i] += 1


class EffortLimiter(Limiter):
    """Limits effort commands: position, then velocity, then effort, and the rate of effort last, so that what is sent is always continuous.

    Position: outside the range only inward effort passes. With soft limits (k_position, k_velocity) the velocity bound shrinks with the distance to
    the soft limit, v_max(q) = -k_position (q - soft), and the effort bound with the speed that is left, -k_velocity (v - v_max(q)). A joint that
    started outside its range is not pushed in: its soft limits act once it has been inside.
    Velocity: above the limit only braking effort passes; with k_velocity the bound is -k_velocity (v - v_max).
    """

    def __init__(self, states: JointStates, commands: JointCommands, limits: Sequence[JointLimits], counts: LimitCounts | None = None) -> None:
        super().__init__(states, commands, limits, counts)
        self._tau_quick = [0.0] * len(self.limits)
        self._q_low, self._q_high, self._change = ([0.0] * len(self.limits) for _ in range(3))
        self._been_inside = [False] * len(self.limits)

    def enforce(self, period: float) -> None:
        """Limit the commands in place. About 1 us for seven joints when no limit is near.

        Args:
            period: time since the last cycle [s].
        """
        counts, states, value = self.counts, self.states, self.commands.value
        if period != self._period or counts.run != self._run:
            self._begin(period)
        counts.cycles += 1
        last, change = self._previous, self._change
        # The tests let through what no limit can touch; anything else, also what is not a number, takes the long way.
        if not (
            within(states.position, self._q_low, self._q_high)
            and smaller(states.velocity, self._v_quick)
            and smaller(value, self._tau_quick)
            and near(value, last, change)
        ):
            rows = zip(states.position, states.velocity, value, last, change, strict=True)
            value[:] = [self._limit(i, *row) for i, row in enumerate(rows)]
        last[:] = value

    def check_start(self) -> None:
        """Say once which joints begin outside their range."""
        super().check_start()
        self._been_inside[:] = [False] * len(self._been_inside)

    def _prepare(self, period: float) -> None:
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            self._q_low[i], self._q_high[i] = _quick_range(limit) if chosen else (-INFINITY, INFINITY)
            self._change[i] = limit.effort_rate * period if chosen else INFINITY
            # A soft velocity limit bounds the effort by the speed that is left: leave some of it for the quick test.
            near_limit = limit.velocity if limit.k_velocity == 0.0 else 0.75 * limit.velocity
            self._v_near[i] = near_limit if chosen else INFINITY

    def _set_quick(self, i: int) -> None:
        super()._set_quick(i)
        limit = self.limits[i]
        self._tau_quick[i] = FINITE
        if self._selected[i]:
            soft = limit.k_velocity * (limit.velocity - self._v_quick[i]) if limit.k_velocity > 0.0 else FINITE
            self._tau_quick[i] = min(limit.effort, soft, FINITE)

    def _limit(self, i: int, q: float, v: float, tau: float, last: float, change: float) -> float:
        counts, limit = self.counts, self.limits[i]
        if not math.isfinite(tau + q + v):
            self._not_finite(i, counts.effort)
            return last if math.isfinite(last) else 0.0
        speed = abs(v)
        self._note_speed(i, speed)
        if not self._selected[i] or self._is_free(i, q, speed, tau, last):
            return tau
        self._note_position(i, q)
        wanted, tau = tau, self._position_stage(limit, q, v, tau, self._soft_acts(i, q))
        if abs(tau - wanted) > TOUCHED:
            counts.position[i] += 1
        wanted, tau = tau, self._velocity_stage(limit, q, v, tau)
        if abs(tau - wanted) > TOUCHED:
            counts.velocity[i] += 1
        wanted, tau = tau, clamp(tau, -limit.effort, limit.effort)
        if abs(tau - wanted) > TOUCHED:
            counts.effort[i] += 1
        if math.isfinite(last):
            wanted, tau = tau, clamp(tau, last - change, last + change)
            if abs(tau - wanted) > TOUCHED:
                counts.effort_rate[i] += 1
        return tau

    def _is_free(self, i: int, q: float, speed: float, tau: float, last: float) -> bool:
        """Whether no limit acts: a joint with soft velocity limits often comes here although it is far from them."""
        q_low, q_high, change, limit = self._q_low[i], self._q_high[i], self._change[i], self.limits[i]
        left = limit.velocity - speed
        return (
            q_low <= q <= q_high and left >= 0.0 and abs(tau) <= limit.effort and -change <= tau - last <= change
            and (limit.k_velocity == 0.0 or abs(tau) <= limit.k_velocity * left)
        )  # fmt: skip

    def _soft_acts(self, i: int, q: float) -> bool:
        """Whether the soft range counts: not yet for a joint that started outside, which it would push in with all its might."""
        if self.limits[i].lower <= q <= self.limits[i].upper:
            self._been_inside[i] = True
        return self._been_inside[i] or not self.counts.started_outside[i]

    @staticmethod
    def _position_stage(limit: JointLimits, q: float, v: float, tau: float, soft: bool = True) -> float:
        low, high = -INFINITY, INFINITY
        if soft and limit.has_soft_range and limit.k_velocity > 0.0:
            v_low, v_high = limit.soft_speeds(q)
            low = -limit.k_velocity * (v - v_low) if v_low > -limit.velocity else low
            high = -limit.k_velocity * (v - v_high) if v_high < limit.velocity else high
        if q < limit.lower:
            low = max(low, 0.0)
            high = max(high, low)
        elif q > limit.upper:
            high = min(high, 0.0)
            low = min(low, high)
        return clamp(tau, low, high)

    @staticmethod
    def _velocity_stage(limit: JointLimits, q: float, v: float, tau: float) -> float:
        if limit.velocity == INFINITY:
            return tau
        if limit.k_velocity > 0.0:
            low, high = -limit.k_velocity * (v + limit.velocity), -limit.k_velocity * (v - limit.velocity)
        else:
            low = 0.0 if v < -limit.velocity else -INFINITY
            high = 0.0 if v > limit.velocity else INFINITY
        # Braking must not become an outward push while the joint is outside its range.
        if q > limit.upper:
            low = min(low, 0.0)
        elif q < limit.lower:
            high = max(high, 0.0)
        return clamp(tau, low, high)


def _quick_range(limit: JointLimits) -> tuple[float, float]:
    """Positions between which neither the range nor the soft limits act [rad]."""
    if not (limit.has_soft_range and limit.k_velocity > 0.0):
        return limit.lower, limit.upper
    reach = limit.velocity / limit.k_position
    return max(limit.lower, limit.soft_lower + reach), min(limit.upper, limit.soft_upper - reach)
