"""Motions of n axes to a target: an online trajectory generator with changing targets, or straight lines. No ROS.

The generator respects limits of velocity, acceleration and jerk. Each new target starts the time-optimal motion from
the present state to rest at this target (Berscheid and Kroeger 2021, "Jerk-limited real-time trajectory generation with
arbitrary target states", implemented in the library ruckig), so position, velocity and acceleration are continuous. All
axes arrive at one time: an axis with a short distance moves slowly, so that noise of the target across the direction of
motion shakes the arm less. A first-order filter of the target removes the rest of the noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, Synchronization, Trajectory

from hric_controllers.trajectory.trapezoid import TrapezoidProfile
from hric_core.errors import HricError
from hric_core.parameters import Settings, number

SETTLED = 1e-9
"""Distance from the target below which the filter of the target ends [m or rad]."""


@dataclass(frozen=True)
class MotionLimits(Settings):
    """Maximum velocity, acceleration and jerk of one axis, or of the Euclidean norm over several axes."""

    velocity: float = number(above=0.0, unit="m/s or rad/s")
    acceleration: float = number(above=0.0, unit="m/s^2 or rad/s^2")
    jerk: float = number(above=0.0, unit="m/s^3 or rad/s^3")

    def each_of(self, axes: int) -> "MotionLimits":
        """Return limits for each single one of `axes` axes, so that their Euclidean norm stays within these limits."""
        share = 1.0 / math.sqrt(axes)
        return MotionLimits(share * self.velocity, share * self.acceleration, share * self.jerk)


class OnlineTrajectoryGenerator:
    """Generator of a motion of n axes whose target may change at any time; fast enough for the control loop.

    Args:
        limits: limits of each axis.
        smoothing_time: time constant of the filter of the target [s]; 0: no filter.
        axes: number of axes n.
        time_step: duration of one computed step of the motion [s].

    Attributes:
        position, velocity, acceleration: present state of the axes, n floats each [m or rad, and s]. Read-only.
        rest: position in which the motion will end if no new target comes, n floats [m or rad].
        moving: True while the axes move.
    """

    def __init__(
        self, limits: MotionLimits, smoothing_time: float = 0.0, axes: int = 3, time_step: float = 1e-3
    ) -> None:
        if not math.isfinite(smoothing_time) or smoothing_time < 0.0:
            raise HricError(f"smoothing time is {smoothing_time!r}; valid: a number not below 0")
        self._n, self._step, self._scale, self._smoothing_time = axes, time_step, 1.0, smoothing_time
        self._share = 1.0 - math.exp(-time_step / smoothing_time) if smoothing_time > 0.0 else 1.0
        self._generator, self._input, self._output = (
            Ruckig(axes, time_step),
            InputParameter(axes),
            OutputParameter(axes),
        )
        self._input.max_velocity = [limits.velocity] * axes
        self._input.max_acceleration = [limits.acceleration] * axes
        self._input.max_jerk = [limits.jerk] * axes
        self._input.target_velocity = self._input.target_acceleration = [0.0] * axes
        self.start([0.0] * axes)

    def start(self, position: Sequence[float]) -> None:
        """Put the axes at rest at a position, n floats [m or rad]."""
        state, zero = self._input, [0.0] * self._n
        self.position = self.rest = self._goal = self._smooth = [float(value) for value in position]
        self.velocity, self.acceleration = zero, zero
        state.current_position, state.current_velocity, state.current_acceleration = self.position, zero, zero
        self.moving = False
        self._follow()

    def go(self, target: Sequence[float]) -> bool:
        """Begin the motion from the present state to rest at a target, n floats [m or rad].

        Always returns True, since any target is accepted. (`LineMotion.go` may return False.)
        """
        if self._input.control_interface is not ControlInterface.Position:
            self._smooth = self.position
            self._follow()
        self._goal = self.rest = [float(value) for value in target]
        self.moving = True
        return True

    def _follow(self) -> None:
        self._input.control_interface, self._input.synchronization = ControlInterface.Position, Synchronization.Time

    def stop(self) -> None:
        """Begin to bring the axes to rest, each as soon as the limits allow."""
        if not self.moving or self._input.control_interface is ControlInterface.Velocity:
            return
        # Each axis by itself: none has to wait for another.
        self._input.control_interface, self._input.synchronization = ControlInterface.Velocity, Synchronization.No
        stopping = Trajectory(self._n)
        self._generator.calculate(self._input, stopping)
        self.rest = self._goal = self._smooth = stopping.at_time(stopping.duration)[0]

    def advance(self, period: float, scale: float = 1.0) -> None:
        """Advance the motion by `period` [s], a multiple of the time step, at `scale` (0 to 1) of its speed.

        The attributes `velocity` and `acceleration` stay those at full speed: multiply the velocity by `scale`.
        """
        if scale != self._scale:
            self._set_scale(scale)
        if scale <= 0.0:
            return
        for _ in range(max(1, round(period / self._step))):
            if not self.moving:
                return
            self._advance_one()

    def _set_scale(self, scale: float) -> None:
        self._scale, step = scale, scale * self._step
        self._generator.delta_time = step
        self._share = 1.0 - math.exp(-step / self._smoothing_time) if self._smoothing_time > 0.0 else 1.0

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
        """End the motion with the axes at rest exactly at the target, without rounding error."""
        self.position = self.rest = self._input.current_position = self._goal
        self.moving = False
        self.velocity = self.acceleration = [0.0] * self._n
        self._follow()

    def _update(self) -> Result:
        """Compute one step of the motion and return the result of ruckig.

        If ruckig finds no common duration for all axes, each axis takes its own in this step.

        Raises:
            HricError: there is no motion to the target within the limits.
        """
        result: Result = self._generator.update(self._input, self._output)
        if result in (Result.Working, Result.Finished):
            return result
        before, self._input.synchronization = self._input.synchronization, Synchronization.No
        result = self._generator.update(self._input, self._output)
        self._input.synchronization = before
        if result not in (Result.Working, Result.Finished):
            raise HricError(
                f"no motion from {self.position} to {self._smooth} within the limits of velocity, acceleration and "
                f"jerk: ruckig returns {result.name}"
            )
        return result


class LineMotion:
    """Motion of n axes along a straight line with a trapezoidal velocity profile (thesis ch. 3.3).

    It accepts no new target before it ends. It has the methods of `OnlineTrajectoryGenerator` and can replace it.

    Args:
        velocity: maximum speed along the line [m/s] or [rad/s].
        acceleration: acceleration along the line [m/s^2] or [rad/s^2].
        axes: number of axes n.

    Attributes:
        position, velocity: present state of the axes, n floats each [m or rad, and s]. Read-only.
        rest: position in which the motion will end, n floats [m or rad].
        moving: True while the axes move.
    """

    def __init__(self, velocity: float, acceleration: float, axes: int = 3) -> None:
        self._profile, self._acceleration, self._n = TrapezoidProfile([velocity], [acceleration]), acceleration, axes
        self.start([0.0] * axes)

    def start(self, position: Sequence[float]) -> None:
        """Put the axes at rest at a position, n floats [m or rad]."""
        self.position = self.rest = self._begin = [float(value) for value in position]
        self.velocity = self._along = [0.0] * self._n
        self._time, self._braking, self.moving = 0.0, False, False

    def go(self, target: Sequence[float]) -> bool:
        """Begin the motion to a target (n floats [m or rad]) and return True.

        While an earlier motion runs, ignore the target and return False.
        """
        if self.moving:
            return False
        offset = [end - begin for begin, end in zip(self.position, target, strict=True)]
        length = math.hypot(*offset)
        if length == 0.0:
            return True
        self._begin, self._along = self.position, [x / length for x in offset]
        self.rest = [float(value) for value in target]
        self._time, self._braking, self.moving = 0.0, False, True
        self._profile.plan_from(0.0, [0.0], [0.0], [length])
        return True

    def stop(self) -> None:
        """Begin to bring the axes to rest on the line as soon as the acceleration allows."""
        if not self.moving or self._braking:
            return
        (s,), (v,) = self._profile.sample(self._time)
        end = min(s + 0.5 * v * v / self._acceleration, self._profile.goal[0])
        self._profile.plan_from(self._time, [s], [v], [end])
        self.rest, self._braking = self._at(end), True

    def advance(self, period: float, scale: float = 1.0) -> None:
        """Advance the motion by `period` [s] at the fraction `scale` (0 to 1) of its speed."""
        if not self.moving:
            return
        self._time += scale * period
        (s,), (v,) = self._profile.sample(self._time)
        self.moving = self._time < self._profile.end
        self.position = self._at(s) if self.moving else self.rest
        self.velocity = [v * x for x in self._along]

    def _at(self, s: float) -> list[float]:
        return [begin + s * x for begin, x in zip(self._begin, self._along, strict=True)]
