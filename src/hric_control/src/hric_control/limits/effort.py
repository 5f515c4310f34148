"""Limiter of effort commands, applied between the controllers' update and the write to the robot."""

import logging
import math
import sys
from collections.abc import Iterable, Sequence
from typing import ClassVar

from hric_control.hardware_interface import JointCommands, JointStates
from hric_control.limits.counts import LimitCounts
from hric_control.limits.values import INFINITY, JointLimits
from hric_core.errors import HricError, check_known
from hric_core.native.vectors import touched

TOUCHED = 1e-12
"""Change of a command from which on it counts as limited."""

FINITE = sys.float_info.max
"""Bound used instead of infinity in the quick test of commands, so that an infinite command fails it."""

_log = logging.getLogger("hric")


def clamp(value: float, low: float, high: float) -> float:
    """Return `value` within [low, high]; `high` wins if low is above high."""
    return high if value > high else low if value < low else value


def counted(count: list[int], i: int, before: float, after: float) -> float:
    """Return `after`, and increase the count of joint `i` if a limit changed the command from `before`."""
    if abs(after - before) > TOUCHED:
        count[i] += 1
    return after


class Limiter:
    """Base class of the limiters of effort, velocity and position commands.

    Args:
        states: measured joint states.
        commands: commands that `enforce` limits in place.
        limits: one per joint, in the order of the states.
        counts: counts of limited commands, shared with other limiters of the robot; None: new ones.

    Raises:
        HricError: names or order of the limits differ from those of the joints.
    """

    _kind: ClassVar[str] = ""
    """Field of `LimitCounts` that counts a command which is not finite."""
    _bounds_command: ClassVar[bool] = False
    """True if `_low` and `_high` bound the command instead of the measured position."""

    def __init__(
        self,
        states: JointStates,
        commands: JointCommands,
        limits: Sequence[JointLimits],
        counts: LimitCounts | None = None,
    ) -> None:
        names = tuple(limit.name for limit in limits)
        if names != states.names:
            raise HricError(
                f"{type(self).__name__}: limits are for {', '.join(names) or 'no joint'}; the joints are "
                f"{', '.join(states.names)}"
            )
        self.states, self.commands = states, commands
        self.limits = tuple(limits)
        self.counts = LimitCounts(names, [limit.velocity for limit in limits]) if counts is None else counts
        n = len(names)
        self._selected = [True] * n
        self._previous = [math.nan] * n
        self._period, self._run = math.nan, -1
        self._been_inside = [False] * n  # True once a joint was inside its range: from then on its soft limits act
        self._speed = [0.0] * n  # speed of the last position command [rad/s or m/s]
        # Bounds within which no limit changes a command, see `native.vectors.touched`.
        self._low, self._high, self._bound, self._change = ([0.0] * n for _ in range(4))
        self._fastest, self._softness = [FINITE] * n, [0.0] * n

    def enforce(self, period: float) -> None:
        """Limit the commands in place; if no limit is near, this takes well below a microsecond for seven joints.

        Args:
            period: time since the last cycle [s].
        """
        counts, states, value, last = self.counts, self.states, self.commands.value, self._previous
        if period != self._period or counts.run != self._run:
            self._begin(period)
        counts.cycles += 1
        position = value if self._bounds_command else states.position
        bounds = self._fastest, self._softness, value, self._bound, last, self._change, counts.speed_max
        for i in touched(position, self._low, self._high, states.velocity, *bounds):
            value[i] = self._limit(i, states.position[i], states.velocity[i], value[i], last[i])
        last[:] = value

    def reset(self, previous: Sequence[float] | None = None) -> None:
        """Set the previous command, from which the next one may differ only by the rate limits.

        Args:
            previous: n commands, in force until now. None: not known; then the first effort command is not limited in
                rate, and the first velocity and position commands start from the measured state.
        """
        if previous is not None and len(previous) != len(self._previous):
            raise HricError(f"{type(self).__name__}.reset: {len(previous)} values for {len(self._previous)} joints")
        self._previous[:] = (
            [math.nan] * len(self._previous) if previous is None else [float(value) for value in previous]
        )

    def select(self, names: Iterable[str] | None) -> None:
        """Select the joints that are driven through this interface, whose commands are limited; None: all joints.

        For a newly selected joint the previous command counts as unknown, as after `reset(None)`."""
        selected = self.states.names if names is None else tuple(names)
        check_known("joint", selected, self.states.names, type(self).__name__)
        now = [name in selected for name in self.states.names]
        for i, (before, after) in enumerate(zip(self._selected, now, strict=True)):
            if after and not before:
                self._previous[i] = math.nan
        self._selected = now
        self._period = math.nan

    def check_start(self) -> None:
        """Log a warning for each joint that is outside its position range at the start of the run.

        `enforce` calls this in the first cycle after construction or `counts.clear()`."""
        self.counts.start_checked = True
        for i, (limit, position) in enumerate(zip(self.limits, self.states.position, strict=True)):
            if not limit.lower <= position <= limit.upper and not self.counts.started_outside[i]:
                self.counts.started_outside[i] = True
                _log.warning(
                    "joint %s starts at %.4f %s, outside its range [%.4f, %.4f]: it may only move inwards until it is "
                    "inside",
                    limit.name, position, limit.unit, limit.lower, limit.upper,
                )  # fmt: skip

    def _begin(self, period: float) -> None:
        """Prepare the limiter after a change of the period, of the selected joints, or a reset of the counts."""
        if not self.counts.start_checked:
            self.check_start()
        self._period, self._run = period, self.counts.run
        self._prepare(period)

    def _prepare(self, period: float) -> None:
        """Set the bounds of the quick test, within which no limit changes a command, e.g. `_low`, `_high`, `_bound`."""
        raise NotImplementedError

    def _limit(self, i: int, q: float, v: float, value: float, last: float) -> float:
        """Return the command of one joint within its limits; `last`: previous command, NaN if unknown."""
        counts, limit = self.counts, self.limits[i]
        last = last if math.isfinite(last) else self._first(i, q, v)
        if not math.isfinite(value + (last if self._bounds_command else q + v)):
            self._note_not_finite(i)
            return last if math.isfinite(last) else 0.0
        if not self._selected[i]:
            return value
        excess = max(limit.lower - q, q - limit.upper)
        if excess > counts.position_excess_max[i]:
            counts.position_excess_max[i] = excess
        return self._enforced(i, q, v, value, last)

    def _first(self, i: int, q: float, v: float) -> float:
        """Return the value used as previous command of joint `i` if that is unknown; NaN: the rate is not limited."""
        return math.nan

    def _enforced(self, i: int, q: float, v: float, value: float, last: float) -> float:
        """Return the command after all limits of the interface, applied in order and counted."""
        raise NotImplementedError

    def _note_not_finite(self, i: int) -> None:
        if not self.counts.not_finite[i]:
            _log.error(
                "joint %s: its command or measured state is not finite; the previous command stays in force (reported "
                "once)",
                self.limits[i].name,
            )
        self.counts.not_finite[i] += 1
        getattr(self.counts, self._kind)[i] += 1


class EffortLimiter(Limiter):
    """Limiter of effort commands by position, velocity and effort, and then by rate, so that they are continuous.

    Position: outside the range only an effort towards the range is allowed. With soft limits (gains k_position,
    k_velocity) the velocity bound decreases with the distance to the soft limit, v_max(q) = -k_position (q - soft), and
    the effort bound is -k_velocity (v - v_max(q)). A joint that started outside its range is not pushed inwards: its
    soft limits act once it has been inside. Velocity: above the limit only a braking effort is allowed; with k_velocity
    the effort bound is -k_velocity (v - v_max).
    """

    _kind = "effort"

    def check_start(self) -> None:
        """Log the joints that start outside their range; their soft limits are disabled until they have been inside."""
        super().check_start()
        self._been_inside[:] = [False] * len(self._been_inside)

    def _prepare(self, period: float) -> None:
        for i, (limit, chosen) in enumerate(zip(self.limits, self._selected, strict=True)):
            self._low[i], self._high[i], self._bound[i], self._change[i] = -INFINITY, INFINITY, FINITE, INFINITY
            self._fastest[i], self._softness[i] = FINITE, 0.0
            if chosen:
                full_range = max(limit.lower, -FINITE), min(limit.upper, FINITE)
                self._low[i], self._high[i] = (
                    limit.full_speed_range(*full_range) if limit.k_velocity > 0.0 else full_range
                )
                self._bound[i], self._change[i] = min(limit.effort, FINITE), limit.effort_rate * period
                self._fastest[i], self._softness[i] = min(limit.velocity, FINITE), limit.k_velocity

    def _enforced(self, i: int, q: float, v: float, value: float, last: float) -> float:
        counts, limit = self.counts, self.limits[i]
        tau = self._position_stage(limit, q, v, value, self._soft_acts(i, q))
        tau = counted(counts.position, i, value, tau)
        tau = counted(counts.velocity, i, tau, self._velocity_stage(limit, q, v, tau))
        tau = counted(counts.effort, i, tau, clamp(tau, -limit.effort, limit.effort))
        if math.isfinite(last):
            change = self._change[i]
            tau = counted(counts.effort_rate, i, tau, clamp(tau, last - change, last + change))
        return tau

    def _soft_acts(self, i: int, q: float) -> bool:
        """Return True if the soft limits of joint `i` act at position `q`.

        They would push a joint that started outside its range inwards with full effort, so they do not act until it has
        been inside."""
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
