"""Synchronised trapezoidal velocity profiles: all joints come to rest at one instant. Plain Python floats.

The velocity of each joint changes from w to a cruise velocity c at constant acceleration a, stays constant, and returns
to zero. With T the common duration and x the distance to go, counted in the direction of travel (so that x is at least
the stopping distance w|w|/(2a)):

    x(c) = (c|c| - w|w|) / (2a) + c (T - |c - w|/a - c/a) + c^2 / (2a)

x grows with c, so c follows from x in closed form.
"""

import math
from collections.abc import Sequence

from hric_core.errors import HricError


def direction(distance: float, velocity: float, acceleration: float) -> float:
    """Return the direction of travel: +1 if the joint would stop below the goal by braking at once, -1 if above it.

    Args:
        distance: goal minus present position [rad].
        velocity: present velocity [rad/s].
        acceleration: maximum acceleration, positive [rad/s^2].
    """
    return 1.0 if distance >= 0.5 * velocity * abs(velocity) / acceleration else -1.0


def shortest_duration(distance: float, velocity: float, max_velocity: float, acceleration: float) -> float:
    """Return the minimum time in which one joint comes from its present velocity to rest at its goal [s].

    Args:
        distance: goal minus present position [rad].
        velocity: present velocity [rad/s]; may exceed `max_velocity`.
        max_velocity: maximum velocity, positive [rad/s].
        acceleration: maximum acceleration, positive [rad/s^2].
    """
    sign = direction(distance, velocity, acceleration)
    x, w = sign * distance, sign * velocity
    peak = math.sqrt(max(0.0, acceleration * x + 0.5 * w * w))
    if peak <= max_velocity:
        return (2.0 * peak - w) / acceleration
    # Reach max_velocity (from above if the joint is too fast), cruise, brake. The sign from `direction` ensures that
    # the distance of the ramps does not exceed x.
    ramps = (abs(max_velocity - w) * (max_velocity + w) + max_velocity**2) / (2.0 * acceleration)
    return (abs(max_velocity - w) + max_velocity) / acceleration + max(0.0, x - ramps) / max_velocity


def cruise_velocity(distance: float, velocity: float, acceleration: float, duration: float) -> float:
    """Return the signed cruise velocity with which one joint reaches its goal in a given time [rad/s].

    Args:
        distance: goal minus present position [rad].
        velocity: present velocity [rad/s].
        acceleration: acceleration of the ramps, positive [rad/s^2].
        duration: time to the goal [s], not below `shortest_duration`.
    """
    sign = direction(distance, velocity, acceleration)
    x, w, a = sign * distance, sign * velocity, acceleration
    stop = 0.5 * w * w / a
    spare = duration - w / a
    if w > 0.0 and x <= stop + w * spare:
        return sign * min(w, max(0.0, (x - stop) / spare)) if spare > 0.0 else 0.0
    total = a * duration + w
    return sign * 0.5 * (total - math.sqrt(max(0.0, total * total - 4.0 * (a * x + 0.5 * w * w))))


class TrapezoidProfile:
    """Trapezoidal velocity profile of n joints, from a present state to rest at a goal.

    `sample` is fast enough for the control loop.

    Args:
        max_velocity: maximum velocity of each joint [rad/s].
        max_acceleration: maximum acceleration of each joint [rad/s^2].

    Raises:
        HricError: a limit is not positive and finite, or the numbers of limits differ.
    """

    def __init__(self, max_velocity: Sequence[float], max_acceleration: Sequence[float]) -> None:
        if len(max_velocity) != len(max_acceleration):
            raise HricError(f"{len(max_velocity)} velocity, but {len(max_acceleration)} acceleration limits are given")
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
        """Make a profile that rests at `position` (n floats [rad]) from `time` [s] on."""
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
        """Make a profile from the state of the present one at `time` [s] to `goal` (n floats [rad]).

        Position and velocity stay continuous.
        """
        position, velocity = self.sample(time)
        self.plan_from(time, position, velocity, goal)

    def plan_from(
        self, time: float, position: Sequence[float], velocity: Sequence[float], goal: Sequence[float]
    ) -> None:
        """Make a profile from a given state to a goal.

        Args:
            time: start of the profile [s].
            position: positions at the start, n floats [rad].
            velocity: velocities at the start, n floats [rad/s].
            goal: goal positions, n floats [rad].
        """
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
        """Return start velocity, acceleration and cruise velocity of each joint for a start from rest.

        All joints have the phases of the slowest one, so the motion is a straight line in joint space. The cruise
        velocity is not computed from the duration, since without a cruise phase half of its digits would be lost.

        Args:
            distances: goal minus start position of each joint [rad].
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
