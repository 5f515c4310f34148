"""Synchronised trapezoidal velocity profiles: all joints arrive at rest at the same instant.

Per joint the velocity goes from w to a cruise velocity c at constant acceleration a, stays there, and returns to zero.
With T the common duration and x the distance to go, counted in the direction of travel (so that x is at least the
stopping distance w|w|/(2a)):

    x(c) = (c|c| - w|w|) / (2a) + c (T - |c - w|/a - c/a) + c^2 / (2a)

This grows with c, so c follows from x in closed form. Everything is plain Python floats.
"""

import math
from collections.abc import Sequence

from hric_core.errors import HricError


def direction(distance: float, velocity: float, acceleration: float) -> float:
    """Return +1 or -1: the side of the goal on which braking at once would leave the joint.

    Args:
        distance: goal minus present position [rad].
        velocity: present velocity [rad/s].
        acceleration: limit, positive [rad/s^2].
    """
    return 1.0 if distance >= 0.5 * velocity * abs(velocity) / acceleration else -1.0


def shortest_duration(distance: float, velocity: float, max_velocity: float, acceleration: float) -> float:
    """Return the minimum time from `velocity` to rest at `distance` [s].

    Args:
        distance: goal minus present position [rad].
        velocity: present velocity, may exceed the limit [rad/s].
        max_velocity: limit, positive [rad/s].
        acceleration: limit, positive [rad/s^2].
    """
    sign = direction(distance, velocity, acceleration)
    x, w = sign * distance, sign * velocity
    peak = math.sqrt(max(0.0, acceleration * x + 0.5 * w * w))
    if peak <= max_velocity:
        return (2.0 * peak - w) / acceleration
    # Reach the limit (from above if the joint is too fast), cruise, brake. The ramps never exceed x: see `direction`.
    ramps = (abs(max_velocity - w) * (max_velocity + w) + max_velocity**2) / (2.0 * acceleration)
    return (abs(max_velocity - w) + max_velocity) / acceleration + max(0.0, x - ramps) / max_velocity


def cruise_velocity(distance: float, velocity: float, acceleration: float, duration: float) -> float:
    """Return the signed cruise velocity [rad/s] with which `distance` takes `duration`, at least the shortest one."""
    sign = direction(distance, velocity, acceleration)
    x, w, a = sign * distance, sign * velocity, acceleration
    stop = 0.5 * w * w / a
    spare = duration - w / a
    if w > 0.0 and x <= stop + w * spare:
        return sign * min(w, max(0.0, (x - stop) / spare)) if spare > 0.0 else 0.0
    total = a * duration + w
    return sign * 0.5 * (total - math.sqrt(max(0.0, total * total - 4.0 * (a * x + 0.5 * w * w))))


class TrapezoidProfile:
    """Profile of n joints from a present state to rest at a goal; `sample` is made for the control loop.

    Args:
        max_velocity: n limits [rad/s].
        max_acceleration: n limits [rad/s^2].

    Raises:
        HricError: a limit that is not positive and finite, or lengths that differ.
    """

    def __init__(self, max_velocity: Sequence[float], max_acceleration: Sequence[float]) -> None:
        if len(max_velocity) != len(max_acceleration):
            raise HricError(f"{len(max_velocity)} velocity limits for {len(max_acceleration)} acceleration limits")
        for kind, values in (("velocity", max_velocity), ("acceleration", max_acceleration)):
            if not all(math.isfinite(value) and value > 0.0 for value in values):
                raise HricError(f"profile {kind} limits must be positive and finite; got {list(values)}")
        self._v, self._a = [float(v) for v in max_velocity], [float(a) for a in max_acceleration]
        self._start = 0.0
        self._goal = [0.0] * len(self._v)
        self._zero = [0.0] * len(self._v)
        self._phases: list[tuple[float, ...]] = []
        self.duration = 0.0

    def hold(self, time: float, position: Sequence[float]) -> None:
        """Rest at `position` [rad] from `time` [s] on."""
        self._start, self._goal, self._phases, self.duration = time, list(position), [], 0.0

    @property
    def goal(self) -> list[float]:
        """Goal position of the profile, n floats [rad]."""
        return self._goal[:]

    @property
    def end(self) -> float:
        """End time of the profile [s]."""
        return self._start + self.duration

    def plan(self, time: float, goal: Sequence[float]) -> None:
        """Go to `goal` [rad] from the profile's state at `time` [s]: position and velocity stay continuous."""
        position, velocity = self.sample(time)
        self.plan_from(time, position, velocity, goal)

    def plan_from(
        self, time: float, position: Sequence[float], velocity: Sequence[float], goal: Sequence[float]
    ) -> None:
        """Go from a given state, n floats each [rad], [rad/s], to `goal` [rad], starting at `time` [s]."""
        distances = [end - begin for begin, end in zip(position, goal, strict=True)]
        self._start, self._goal = time, list(goal)
        if any(velocity) or not any(distances):
            limits = list(zip(distances, velocity, self._v, self._a, strict=True))
            self.duration = max(shortest_duration(x, w, v, a) for x, w, v, a in limits)
            motions = [(w, a, cruise_velocity(x, w, a, self.duration)) for x, w, _, a in limits]
        else:
            motions = self._from_rest(distances)
        self._phases = [_phases(begin, *motion, self.duration) for begin, motion in zip(position, motions, strict=True)]

    def _from_rest(self, distances: Sequence[float]) -> list[tuple[float, float, float]]:
        """Return start velocity, acceleration and cruise velocity of each joint, synchronised on a straight line.

        All joints share the phases of the slowest one. The cruise velocity is not computed from the duration: without a
        cruise phase that would lose half of its digits.
        """
        rate_v = min(v / abs(x) for x, v in zip(distances, self._v, strict=True) if x)
        rate_a = min(a / abs(x) for x, a in zip(distances, self._a, strict=True) if x)
        self.duration = shortest_duration(1.0, 0.0, rate_v, rate_a)
        peak = min(rate_v, math.sqrt(rate_a))
        return [(0.0, rate_a * abs(x) if x else a, peak * x) for x, a in zip(distances, self._a, strict=True)]

    def sample(self, time: float) -> tuple[list[float], list[float]]:
        """Return positions [rad] and velocities [rad/s] at `time` [s], n floats each; do not modify these lists."""
        t = time - self._start
        if t >= self.duration:
            return self._goal, self._zero
        position: list[float] = []
        velocity: list[float] = []
        for begin, w, a1, t1, p1, cruise, t2, p2, a2 in self._phases:
            if t < t1:
                position.append(begin + t * (w + 0.5 * a1 * t))
                velocity.append(w + a1 * t)
            elif t < t2:
                position.append(p1 + cruise * (t - t1))
                velocity.append(cruise)
            else:
                u = t - t2
                position.append(p2 + u * (cruise + 0.5 * a2 * u))
                velocity.append(cruise + a2 * u)
        return position, velocity


def _phases(begin: float, w: float, a: float, cruise: float, duration: float) -> tuple[float, ...]:
    t1 = abs(cruise - w) / a
    t2 = max(t1, duration - abs(cruise) / a)
    a1 = math.copysign(a, cruise - w)
    p1 = begin + 0.5 * (w + cruise) * t1
    return begin, w, a1, t1, p1, cruise, t2, p1 + cruise * (t2 - t1), -math.copysign(a, cruise)
