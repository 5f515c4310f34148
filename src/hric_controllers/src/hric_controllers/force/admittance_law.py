"""Virtual mass and damper at the end effector, moved by the wrench of its environment. No ROS.

Each axis is m dv/dt = F - d v - k x, with F the wrench that the environment exerts, filtered and less a dead band, and
x the displacement from the start. Velocity, acceleration and jerk are limited: the
acceleration is lowered, at the limited jerk, so early that the velocity does not exceed its limit.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class VirtualAxis:
    """Virtual mass, damping, stiffness and limits of one axis; a locked axis has an infinite mass.

    Attributes:
        mass: virtual mass [kg] or inertia [kg m^2].
        damping: virtual damping [N s/m] or [N m s/rad].
        stiffness: virtual stiffness towards the start [N/m] or [N m/rad].
        dead_band: wrench without effect [N] or [N m].
        velocity, acceleration, jerk: limits of the motion [m/s, m/s^2, m/s^3] or [rad/s, rad/s^2, rad/s^3].
    """

    mass: float
    damping: float
    stiffness: float
    dead_band: float
    velocity: float
    acceleration: float
    jerk: float


class AdmittanceLaw:
    """Motion of the axes under the wrench of the environment.

    Args:
        axes: the axes in order.
        filter_time: time constant of the first-order filter of the wrench [s]; 0: none.

    Attributes:
        position, velocity, acceleration: displacement from the start, its 1st and 2nd derivative, n floats each
            [m, m/s, m/s^2] or [rad, rad/s, rad/s^2]. Read-only.
        wrench: filtered wrench less dead band that moved the axes in the last cycle, n floats [N] or [N m].
    """

    def __init__(self, axes: Sequence[VirtualAxis], filter_time: float) -> None:
        self._axes, self._filter_time = axes, filter_time
        self.start([(-math.inf, math.inf)] * len(axes))

    def start(self, ranges: Sequence[tuple[float, float]]) -> None:
        """Put the axes at rest at displacement 0, and clear the filter.

        Args:
            ranges: lowest and highest displacement of each axis [m or rad]; an axis outside of its range moves back.
        """
        zero = [0.0] * len(self._axes)
        self._ranges = ranges
        self.position, self.velocity, self.acceleration = zero, zero, zero
        self.wrench, self._filtered = zero, zero

    def advance(self, wrench: Sequence[float], period: float, scale: float = 1.0) -> None:
        """Advance the motion of all axes by one cycle.

        Args:
            wrench: wrench that the environment exerts, n floats [N] or [N m].
            period: time since the last cycle [s].
            scale: speed scale, 0 to 1, by which the velocity limits are multiplied; at 0 the axes brake to rest.
        """
        share = 1.0 - math.exp(-period / self._filter_time) if self._filter_time > 0.0 else 1.0
        self._filtered = [old + share * (new - old) for old, new in zip(self._filtered, wrench, strict=True)]
        self.wrench = [
            math.copysign(max(0.0, abs(force) - axis.dead_band), force)
            for force, axis in zip(self._filtered, self._axes, strict=True)
        ]
        now = zip(self._axes, self._ranges, self.position, self.velocity, self.acceleration, strict=True)
        states = [
            _advanced(axis, force, _speeds(axis, reach, x, scale), (x, v, a), period)
            for force, (axis, reach, x, v, a) in zip(self.wrench, now, strict=True)
        ]
        self.position, self.velocity, self.acceleration = (list(values) for values in zip(*states, strict=True))


def _speeds(axis: VirtualAxis, reach: tuple[float, float], x: float, scale: float) -> tuple[float, float]:
    """Return the lowest and the highest velocity at a displacement x; both are small near an end of the range.

    A speed of r times the distance to the end brakes at r times the speed; r uses half the limit of acceleration.
    """
    top, rate = scale * axis.velocity, 0.5 * axis.acceleration / axis.velocity
    low, high = rate * (reach[0] - x), rate * (reach[1] - x)
    return max(-top, min(top, low)), min(top, max(-top, high))


def _advanced(
    axis: VirtualAxis, force: float, speeds: tuple[float, float], state: tuple[float, float, float], period: float
) -> tuple[float, float, float]:
    """Return position, velocity and acceleration of an axis after one period [s]."""
    x, v, a = state
    step, middle = axis.jerk * period, v + 0.5 * period * a
    low, high = (_towards(speed - middle, step, axis.jerk) for speed in speeds)
    goal = max(low, min(high, (force - axis.damping * v - axis.stiffness * x) / axis.mass))
    goal = max(-axis.acceleration, min(axis.acceleration, goal))
    new = max(a - step, min(a + step, goal))
    return x + period * (v + period * (2.0 * a + new) / 6.0), v + 0.5 * period * (a + new), new


def _towards(room: float, step: float, jerk: float) -> float:
    """Return the acceleration that changes the velocity by `room` [m/s or rad/s] while the jerk lowers it to 0.

    `step`: change of the acceleration in one cycle at this jerk [m/s^2 or rad/s^2].
    """
    return math.copysign(math.sqrt(step * step + 2.0 * jerk * abs(room)) - step, room)
