"""The thesis's way of motion (ch. 3.3): a straight line with a trapezoidal velocity profile, and no new target before its end. No ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hric_controllers.trapezoid import TrapezoidProfile


class LineMotion:
    """Motion of n axes on straight lines; the faces are those of `Retargeter`.

    Args:
        velocity: along the line [m/s] or [rad/s].
        acceleration: along the line [m/s^2] or [rad/s^2].
        axes: n.

    Attributes:
        position, velocity: of the motion, n floats each. Not to be written.
        rest: where the line ends, n floats.
        moving: whether it moves.
    """

    def __init__(self, velocity: float, acceleration: float, axes: int = 3) -> None:
        self._profile, self._acceleration, self._n = TrapezoidProfile([velocity], [acceleration]), acceleration, axes
        self.start([0.0] * axes)

    def start(self, position: Sequence[float]) -> None:
        """Rest at a position."""
        self.position = self.rest = self._begin = [float(value) for value in position]
        self.velocity = self._along = [0.0] * self._n
        self._time, self._braking, self.moving = 0.0, False, False

    def go(self, target: Sequence[float]) -> bool:
        """Head for a target; false if the motion before has not ended: the target is then ignored."""
        if self.moving:
            return False
        way = [end - begin for begin, end in zip(self.position, target, strict=True)]
        length = math.hypot(*way)
        if length == 0.0:
            return True
        self._begin, self._along = self.position, [x / length for x in way]
        self.rest = [float(value) for value in target]
        self._time, self._braking, self.moving = 0.0, False, True
        self._profile.plan_from(0.0, [0.0], [0.0], [length])
        return True

    def stop(self) -> None:
        """Come to rest on the line as soon as the acceleration allows."""
        if not self.moving or self._braking:
            return
        (s,), (v,) = self._profile.sample(self._time)
        end = min(s + 0.5 * v * v / self._acceleration, self._profile.goal[0])
        self._profile.plan_from(self._time, [s], [v], [end])
        self.rest, self._braking = self._at(end), True

    def advance(self, period: float) -> None:
        """Lead the motion on by `period` [s]."""
        if not self.moving:
            return
        self._time += period
        (s,), (v,) = self._profile.sample(self._time)
        self.moving = self._time < self._profile.end
        self.position = self._at(s) if self.moving else self.rest
        self.velocity = [v * x for x in self._along]

    def _at(self, s: float) -> list[float]:
        return [begin + s * x for begin, x in zip(self._begin, self._along, strict=True)]
