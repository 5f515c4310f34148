"""On-line retargeting: n axes follow a target that may change at any time, within limits of velocity, acceleration and jerk. No ROS.

Each change starts the time-optimal motion from the present state to rest at the new target (Berscheid and Kroeger 2021, "Jerk-limited real-time
trajectory generation with arbitrary target states", in its library ruckig), so position, velocity and acceleration have no jump. The axes arrive
together; an axis with a short way then takes it slowly, and noise across the motion shakes the arm less. The target passes a first-order filter,
for what is left of the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, Synchronization, Trajectory

from hric_control.errors import HricError

SETTLED = 1e-9
"""Distance from the target at which the filter of the target ends [m or rad]."""


@dataclass(frozen=True)
class MotionLimits:
    """Of one axis, or of several together (Euclidean norms).

    Attributes:
        velocity: [m/s] or [rad/s].
        acceleration: [m/s^2] or [rad/s^2].
        jerk: [m/s^3] or [rad/s^3].

    Raises:
        HricError: one that is not positive and finite.
    """

    velocity: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "jerk"):
            value = getattr(self, name)
            if not math.isfinite(value) or value <= 0.0:
                raise HricError(f"limit of {name} is {value!r}; valid: a positive number")

    def each_of(self, axes: int) -> MotionLimits:
        """Limits of each of so many axes that keep all of them together within these."""
        share = 1.0 / math.sqrt(axes)
        return MotionLimits(share * self.velocity, share * self.acceleration, share * self.jerk)


class Retargeter:
    """Motion of n axes; made for the control loop.

    Args:
        limits: of each axis.
        smoothing_time: time constant of the filter of the target [s]; 0: none.
        axes: n.
        time_step: of `advance` [s].

    Attributes:
        position, velocity, acceleration: of the motion, n floats each [m or rad and s]. Not to be written.
        rest: where the motion stands if no target follows, n floats.
        moving: whether it moves.
    """

    def __init__(self, limits: MotionLimits, smoothing_time: float = 0.0, axes: int = 3, time_step: float = 1e-3) -> None:
        if not math.isfinite(smoothing_time) or smoothing_time < 0.0:
            raise HricError(f"smoothing time is {smoothing_time!r}; valid: a number not below 0")
        self._n, self._step = axes, time_step
        self._share = 1.0 - math.exp(-time_step / smoothing_time) if smoothing_time > 0.0 else 1.0
        self._generator, self._input, self._output = Ruckig(axes, time_step), InputParameter(axes), OutputParameter(axes)
        self._input.max_velocity = [limits.velocity] * axes
        self._input.max_acceleration = [limits.acceleration] * axes
        self._input.max_jerk = [limits.jerk] * axes
        self._input.target_velocity = self._input.target_acceleration = [0.0] * axes
        self.start([0.0] * axes)

    def start(self, position: Sequence[float]) -> None:
        """Rest at a position."""
        state, zero = self._input, [0.0] * self._n
        self.position = self.rest = self._goal = self._smooth = [float(value) for value in position]
        self.velocity, self.acceleration = zero, zero
        state.current_position, state.current_velocity, state.current_acceleration = self.position, zero, zero
        self.moving = False
        self._follow()

    def go(self, target: Sequence[float]) -> bool:
        """Head for rest at a target, from the present state. True: it is always taken."""
        if self._input.control_interface is not ControlInterface.Position:
            self._smooth = self.position
            self._follow()
        self._goal = self.rest = [float(value) for value in target]
        self.moving = True
        return True

    def _follow(self) -> None:
        self._input.control_interface, self._input.synchronization = ControlInterface.Position, Synchronization.Time

    def stop(self) -> None:
        """Come to rest as soon as the limits allow."""
        if not self.moving or self._input.control_interface is ControlInterface.Velocity:
            return
        # Each axis by itself: none shall wait for another.
        self._input.control_interface, self._input.synchronization = ControlInterface.Velocity, Synchronization.No
        way = Trajectory(self._n)
        self._generator.calculate(self._input, way)
        self.rest = way.at_time(way.duration)[0]
        self._goal = self._smooth = self.rest

    def advance(self, period: float) -> None:
        """Lead the motion on by `period` [s], a multiple of the time step."""
        for _ in range(max(1, round(period / self._step))):
            if not self.moving:
                return
            self._advance_one()

    def _advance_one(self) -> None:
        if self._smooth is not self._goal:
            ahead = [s + self._share * (g - s) for s, g in zip(self._smooth, self._goal, strict=True)]
            near = max(abs(g - a) for g, a in zip(self._goal, ahead, strict=True)) < SETTLED
            self._smooth = self._goal if near else ahead
        self._input.target_position = self._smooth
        result = self._update()
        out = self._output
        self.position, self.velocity, self.acceleration = out.new_position, out.new_velocity, out.new_acceleration
        out.pass_to_input(self._input)
        if result is Result.Finished and self._smooth is self._goal:
            self._settle()

    def _settle(self) -> None:
        """The end: the target itself, without what rounding left."""
        self.position = self.rest = self._input.current_position = self._goal
        self.moving = False
        self.velocity = self.acceleration = [0.0] * self._n
        self._follow()

    def _update(self) -> Result:
        """One step of the motion; where no common duration of the axes is found, each goes its own way."""
        result: Result = self._generator.update(self._input, self._output)
        if result in (Result.Working, Result.Finished):
            return result
        before, self._input.synchronization = self._input.synchronization, Synchronization.No
        result = self._generator.update(self._input, self._output)
        self._input.synchronization = before
        if result not in (Result.Working, Result.Finished):
            raise HricError(f"no motion from {self.position} to {self._smooth} within the limits: {result.name}; the target is not followed")
        return result
