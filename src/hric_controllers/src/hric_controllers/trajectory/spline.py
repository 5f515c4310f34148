"""Spline segments of one joint between two waypoints, and tracks of consecutive segments. Plain Python floats.

A segment is quintic if both waypoints have velocity and acceleration, and matches them. With s the time from its start:

    p(s) = c0 + c1 s + c2 s^2 + c3 s^3 + c4 s^4 + c5 s^5

Without an acceleration it is cubic (c4 = c5 = 0) and matches positions and velocities; without a velocity it is linear
and matches positions only.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Waypoint:
    """Requested state of one joint at one instant.

    Attributes:
        time: instant [s].
        position: requested position [rad or m].
        velocity: requested velocity [rad/s or m/s], None if not specified.
        acceleration: requested acceleration [rad/s^2 or m/s^2], None if not specified.
    """

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None

    def shifted(self, time: float, position: float = 0.0) -> "Waypoint":
        """Return a copy of the waypoint with `time` [s] added to its time and `position` [rad or m] to its position."""
        return Waypoint(self.time + time, self.position + position, self.velocity, self.acceleration)


class SplineSegment:
    """Polynomial motion of one joint between two waypoints; before and after it, the joint rests at their positions."""

    __slots__ = ("c0", "c1", "c2", "c3", "c4", "c5", "end", "end_position", "start")

    def __init__(self, first: Waypoint, last: Waypoint) -> None:
        self.start, self.end, self.end_position = first.time, last.time, last.position
        duration = last.time - first.time
        self.c0, self.c1, self.c2, self.c3, self.c4, self.c5 = _coefficients(first, last, duration)

    def sample(self, time: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at `time` [s]."""
        if time >= self.end:
            return self.end_position, 0.0, 0.0
        s = time - self.start
        if s < 0.0:
            return self.c0, 0.0, 0.0
        c2, c3, c4, c5 = self.c2, self.c3, self.c4, self.c5
        return (
            self.c0 + s * (self.c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
            self.c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))),
            2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)),
        )


def _coefficients(first: Waypoint, last: Waypoint, duration: float) -> tuple[float, float, float, float, float, float]:
    p0, p1 = first.position, last.position
    if duration <= 0.0:
        return p1, 0.0, 0.0, 0.0, 0.0, 0.0
    v0, v1, a0, a1 = first.velocity, last.velocity, first.acceleration, last.acceleration
    distance, t = p1 - p0, duration
    if v0 is None or v1 is None:
        return p0, distance / t, 0.0, 0.0, 0.0, 0.0
    if a0 is None or a1 is None:
        return p0, v0, (3.0 * distance / t - 2.0 * v0 - v1) / t, (v0 + v1 - 2.0 * distance / t) / t**2, 0.0, 0.0
    return (
        p0,
        v0,
        0.5 * a0,
        (20.0 * distance - (8.0 * v1 + 12.0 * v0) * t - (3.0 * a0 - a1) * t**2) / (2.0 * t**3),
        (-30.0 * distance + (14.0 * v1 + 16.0 * v0) * t + (3.0 * a0 - 2.0 * a1) * t**2) / (2.0 * t**4),
        (12.0 * distance - 6.0 * (v1 + v0) * t - (a0 - a1) * t**2) / (2.0 * t**5),
    )


class SplineTrack:
    """Track of one joint: consecutive segments; after the last one the joint rests at its end position.

    Args:
        segments: segments in order of time, at least one.
    """

    __slots__ = ("_index", "segments")

    def __init__(self, segments: Sequence[SplineSegment]) -> None:
        self.segments = list(segments)
        self._index = 0

    @property
    def end(self) -> float:
        """Time at which the last segment ends [s]."""
        return self.segments[-1].end

    def sample(self, time: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at `time` [s], which must not decrease from call to call."""
        segment = self.segments[self._index]
        while time >= segment.end and self._index + 1 < len(self.segments):
            self._index += 1
            segment = self.segments[self._index]
        return segment.sample(time)

    def look(self, time: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at any `time` [s]; may be called from any thread."""
        return next((part for part in self.segments if time < part.end), self.segments[-1]).sample(time)


def hold(time: float, position: float) -> SplineTrack:
    """Return the track of a joint that rests at `position` [rad or m] from `time` [s] on."""
    return SplineTrack([SplineSegment(Waypoint(time, position), Waypoint(time, position))])


def stop(time: float, position: float, velocity: float, duration: float) -> SplineTrack:
    """Return the track of a joint that comes to rest within `duration` [s] at constant deceleration.

    Args:
        time: start of the track [s].
        position: position at the start [rad or m].
        velocity: velocity at the start [rad/s or m/s].
        duration: duration of the deceleration [s]; zero: the joint rests at `position` at once.
    """
    end = position + 0.5 * velocity * duration
    return SplineTrack([SplineSegment(Waypoint(time, position, velocity), Waypoint(time + duration, end, 0.0))])


def follow(time: float, state: tuple[float, float, float], waypoints: Sequence[Waypoint]) -> SplineTrack:
    """Return the track of a joint from its present state through the waypoints after `time`.

    Args:
        time: start of the track [s].
        state: position, velocity and acceleration of the joint at `time`.
        waypoints: waypoints in order of time. At the start of the track, the velocity is continuous if the first
            waypoint after `time` has a velocity, the acceleration if it has an acceleration.
    """
    ahead = [point for point in waypoints if point.time > time]
    if not ahead:
        return hold(time, waypoints[-1].position)
    here = Waypoint(time, *state)
    return SplineTrack([SplineSegment(a, b) for a, b in zip([here, *ahead[:-1]], ahead, strict=True)])
