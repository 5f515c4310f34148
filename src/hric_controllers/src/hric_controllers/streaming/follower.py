"""Smooth motion of n axes behind targets that arrive at any rate, late, twice or not at all. No ROS.

Targets at 10 to 50 Hz would be steps for an arm. They are played back at a constant delay, as in telephony, such that
the next target is mostly there: a line through the targets around the delayed time gives position and velocity of the
stream. A critically damped filter of third order follows it, and where the filter would exceed a limit of velocity,
acceleration or jerk, the time-optimal motion takes its place (Berscheid and Kroeger 2021, library ruckig). A lost
target is bridged at the velocity of the stream. If none comes for `PATIENCE` periods, the axes come to rest at the last
target.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from hric_core.errors import HricError

KEPT = 16
"""Number of targets from which the period is computed and the line is drawn (project default, unconfirmed)."""
PATIENCE = 2.5
"""Periods without a target after which the axes come to rest (project default: three of ten targets may be lost)."""
LONGEST_PERIOD = 0.5
"""Time between two targets [s] beyond which they are setpoints, each with rest at its end (project default)."""
DELAYS = 64
"""Number of targets whose least delay maps their stamps to robot time (project default, unconfirmed)."""
JITTER = 0.06
"""Half width of the line through targets without stamps, at least [s]; it averages the jitter of their arrival (project
default)."""
FASTEST, SLOWEST = 60.0, 15.0
"""Range of the corner frequency of the filter, 3 over the period of the stream [rad/s] (project default)."""

Ranges = Sequence[tuple[float, float]]
States = list[tuple[float, float, float]]
"""Position, velocity and acceleration of each axis [m or rad, and s]."""


@dataclass(frozen=True)
class StreamLimits:
    """Largest velocity, acceleration and jerk of each axis, n floats each [m or rad, and s]."""

    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    jerk: tuple[float, ...]


class TargetStream:
    """Newest targets of a stream with their times.

    Attributes:
        period: mean time between the newest targets [s]; 0 while there is one only.
        smoothed: time over which the playback averages [s]; 0 while there is one target only.
        delay: delay of the playback [s].
        last: newest target; its time is `last_time` [s of robot time].
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all targets."""
        self._targets: deque[tuple[float, Sequence[float]]] = deque(maxlen=KEPT)
        self._delays: deque[float] = deque(maxlen=DELAYS)
        self._stamp: float | None = None
        self.period, self.smoothed, self.delay, self.last_time = 0.0, 0.0, 0.0, -math.inf
        self.last: Sequence[float] = ()

    def add(self, time: float, target: Sequence[float], stamp: float | None) -> bool:
        """Add a target; return False if it is as old as the one before, or older.

        Args:
            time: robot time at which it arrived [s].
            target: n floats [m or rad].
            stamp: time for which it holds, by any clock [s]; None: it has none, and the time of arrival counts.
        """
        if stamp is not None and self._stamp is not None:
            if abs(stamp - self._stamp) > LONGEST_PERIOD:  # a new stream, or another clock
                self._delays.clear()
            elif stamp <= self._stamp:
                return False
        self._stamp = stamp
        if stamp is not None:
            self._delays.append(time - stamp)
        begun = time if stamp is None else stamp + min(self._delays)
        if not 0.0 <= begun - self.last_time <= LONGEST_PERIOD:
            self._targets.clear()
        self._targets.append((begun, target))
        self.last_time, self.last = begun, target
        self.period = (begun - self._targets[0][0]) / max(1, len(self._targets) - 1)
        if stamp is None:
            self.smoothed = self.delay = max(self.period, JITTER) if self.period else 0.0
        else:
            self.smoothed, self.delay = self.period, self.period + max(self._delays) - min(self._delays)
        return True

    def at(self, time: float, tops: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return position and velocity of the stream at a robot time [s] less the delay, n floats each.

        tops: largest velocities, n floats, at which the line is at most continued: targets of two senders may be so
        near in time that it is far steeper than their motion.
        """
        play = time - self.delay
        stamped = self._stamp is not None
        around = [] if stamped else [one for one in self._targets if abs(one[0] - play) <= self.smoothed]
        if len(around) < 2:
            after = next((k for k, (begun, _) in enumerate(self._targets) if begun > play), len(self._targets) - 1)
            first = max(0, after - 1)
            around = list(islice(self._targets, first, first + 2))
        mean = sum(begun for begun, _ in around) / len(around)
        spread = sum((begun - mean) ** 2 for begun, _ in around)
        weights = [(begun - mean) / spread if spread > 1e-7 else 0.0 for begun, _ in around]
        axes = list(zip(*(target for _, target in around), strict=True))
        velocity = [sum(w * x for w, x in zip(weights, axis, strict=True)) for axis in axes]
        middle = [sum(axis) / len(around) for axis in axes]
        position = [p + v * (play - mean) for p, v in zip(middle, velocity, strict=True)]
        if (late := max(play - around[-1][0], around[0][0] - play)) > 0.0:
            rows = zip(position, axes, tops, strict=True)
            position = [max(min(axis) - top * late, min(max(axis) + top * late, x)) for x, axis, top in rows]
        return position, velocity


class StreamFollower:
    """Motion of n axes behind a stream of targets.

    Args:
        limits: limits of each axis.
        ranges: range of each axis (lower, upper) [m or rad], for targets and their bridged gaps.

    Attributes:
        position, velocity, acceleration: present state of the axes, n floats each [m or rad, and s]. Read-only.
        ceased: True if the stream has ended and the axes come to rest at its last target, or rest there.
    """

    def __init__(self, limits: StreamLimits, ranges: Ranges) -> None:
        self._limits, self._ranges, self._stream = limits, ranges, TargetStream()
        axes = len(ranges)
        self._generator, self._input = Ruckig(axes, 1e-3), InputParameter(axes)
        self._input.max_velocity, self._input.max_acceleration = list(limits.velocity), list(limits.acceleration)
        self._input.max_jerk, self._input.synchronization = list(limits.jerk), Synchronization.No
        self._zero = [0.0] * axes
        self.start(self._zero)

    def start(self, position: Sequence[float]) -> None:
        """Put the axes at rest at a position, n floats [m or rad], and forget all targets."""
        self._stream.clear()
        self.position, self.velocity, self.acceleration = list(position), self._zero, self._zero
        self._before = self.position, self.velocity, self.acceleration
        self._targeted, self.ceased = False, True

    def take(self, time: float, target: Sequence[float], stamp: float | None = None) -> None:
        """Take a target; see `TargetStream.add` for the arguments. A repeated or older one is ignored."""
        if self._stream.add(time, target, stamp):
            self._targeted, self.ceased = True, False

    def correct(self, position: Sequence[float], step: float) -> None:
        """Replace the state after a step of which the arm can make a part only; the acceleration follows gradually.

        Args:
            position: position that is reached instead, n floats [m or rad].
            step: period of the step times the speed scale, above 0 [s].
        """
        before, last, accelerations = self._before
        self.position = list(position)
        self.velocity = [(x - y) / step for x, y in zip(position, before, strict=True)]
        rows = zip(accelerations, self.velocity, last, self._limits.jerk, strict=True)
        self.acceleration = [a + max(-j * step, min(j * step, (v - w) / step - a)) for a, v, w, j in rows]

    def advance(self, time: float, period: float, scale: float = 1.0) -> None:
        """Advance by one cycle.

        Args:
            time: robot time [s].
            period: time since the last cycle [s].
            scale: speed scale, 0 to 1; the velocities are at most `scale` times the limits. `velocity` remains that at
                full speed: multiply it by `scale`.

        Raises:
            HricError: there is no motion within the limits.
        """
        if scale <= 0.0 or not self._targeted:
            return
        stream = self._stream
        self.ceased = stream.period == 0.0 or time - stream.last_time > stream.delay + PATIENCE * stream.period
        goal, speed = (stream.last, self._zero) if self.ceased else stream.at(time, self._limits.velocity)
        if self.ceased and self.position == goal:
            return
        inside = [max(low, min(high, x)) for x, (low, high) in zip(goal, self._ranges, strict=True)]
        tops = self._limits.velocity
        speed = [
            max(-top, min(top, v / scale)) if x == y else 0.0
            for x, y, v, top in zip(inside, goal, speed, tops, strict=True)
        ]
        # A goal at rest is reached soonest, and not passed, by the time-optimal motion.
        move = self._optimal if self.ceased or inside != list(goal) else self._filtered
        self._before = self.position, self.velocity, self.acceleration
        states = move(inside, speed, scale * period)
        self.position, self.velocity, self.acceleration = (list(one) for one in zip(*states, strict=True))

    def _filtered(self, goal: Sequence[float], speed: Sequence[float], step: float) -> States:
        """Return the states of the axes after one step [s] of the filter, or of `_optimal` if a limit is near."""
        fastest = max(SLOWEST, min(FASTEST, 3.0 / self._stream.smoothed))
        limits = zip(self._limits.velocity, self._limits.acceleration, self._limits.jerk, strict=True)
        now = zip(self.position, self.velocity, self.acceleration, strict=True)
        states = []
        for (x, v, a), (top, steepest, jerk), end, along in zip(now, limits, goal, speed, strict=True):
            corner = min(fastest, jerk / steepest)  # a faster filter would swing between the limits of jerk
            u = corner**3 * (end - x) + 3.0 * corner**2 * (along - v) - 3.0 * corner * a
            u = max(-jerk, min(jerk, u))
            a_new, v_new = a + step * u, v + step * (a + 0.5 * step * u)
            far, fast = end - x, v_new - along
            late = fast * far > 0.0 and fast * fast > 2.0 * steepest * abs(far)  # to brake within the acceleration
            if late or abs(a_new) > steepest or abs(v_new + 0.5 * a_new * abs(a_new) / jerk) > top:
                return self._optimal(goal, speed, step)
            states.append((x + step * (v + step * (0.5 * a + step * u / 6.0)), v_new, a_new))
        return states

    def _optimal(self, goal: Sequence[float], speed: Sequence[float], step: float) -> States:
        """Return the states of the axes after one step [s] of the time-optimal motion to a moving goal."""
        state, motion = self._input, Trajectory(len(goal))
        state.current_position, state.current_velocity = self.position, self.velocity
        state.current_acceleration, state.target_position, state.target_velocity = self.acceleration, goal, speed
        result = self._generator.calculate(state, motion)
        if result not in (Result.Working, Result.Finished):
            raise HricError(
                f"no motion from {self.position} to {list(goal)} within the limits of velocity, acceleration and jerk: "
                f"ruckig returns {result.name}"
            )
        return list(zip(*motion.at_time(step), strict=True))
