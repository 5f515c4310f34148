"""Linear, cubic or quintic spline segments of one joint, depending on its waypoints, and tracks of segments in time.

Quintic (position, velocity and acceleration at both ends), with T the duration and s in [0, T]:

    p(s) = c0 + c1 s + c2 s^2 + c3 s^3 + c4 s^4 + c5 s^5

Cubic has c4 = c5 = 0 and matches positions and velocities; linear matches positions only. Plain Python floats.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Waypoint:
    """Requested state of one joint at one instant.

    Attributes:
        time: [s].
        position: [rad or m].
        velocity: [rad/s or m/s], None if not specified.
        acceleration: [rad/s^2 or m/s^2], None if not specified.
    """

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None

    def shifted(self, time: float, position: float = 0.0) -> "Waypoint":
        """Return the waypoint, later by `time` [s] and farther by `position` [rad or m]."""
        return Waypoint(self.time + time, self.position + position, self.velocity, self.acceleration)


class SplineSegment:
    """Polynomial between two instants; before and after, the joint rests at the end positions."""

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
    """Consecutive segments of one joint; the joint rests at the last position afterwards.

    `sample` expects times that do not decrease.

    Args:
        segments: at least one, in order of time.
    """

    __slots__ = ("_index", "segments")

    def __init__(self, segments: Sequence[SplineSegment]) -> None:
        self.segments = list(segments)
        self._index = 0

    @property
    def end(self) -> float:
        """End of the last segment [s]."""
        return self.segments[-1].end

    def sample(self, time: float) -> tuple[float, float, float]:
        """Return position, velocity and acceleration at `time` [s]."""
        segment = self.segments[self._index]
        while time >= segment.end and self._index + 1 < len(self.segments):
            self._index += 1
            segment = self.segments[self._index]
        return segment.sample(time)

    def look(self, time: float) -> tuple[float, float, float]:
        """Return the same as `sample`, for any time and from any thread, without changing the track."""
        for segment in self.segments:
            if time < segment.end:
                return segment.sample(time)
        return self.segments[-1].sample(time)


def hold(time: float, position: float) -> SplineTrack:
    """Return a track at rest at `position` from `time` [s] on."""
    return SplineTrack([SplineSegment(Waypoint(time, position), Waypoint(time, position))])


def stop(time: float, position: float, velocity: float, duration: float) -> SplineTrack:
    """Return a track to rest within `duration` [s] at constant deceleration; zero: rest at once at the position."""
    end = position + 0.5 * velocity * duration
    return SplineTrack([SplineSegment(Waypoint(time, position, velocity), Waypoint(time + duration, end, 0.0))])


def follow(time: float, state: tuple[float, float, float], waypoints: Sequence[Waypoint]) -> SplineTrack:
    """Return a track from `state` (position, velocity, acceleration) at `time` [s] through the remaining waypoints.

    Args:
        time: start of the track [s].
        state: present position, velocity, acceleration.
        waypoints: in order of time. Velocity is continuous if the first remaining one has a velocity, acceleration if
            it has an acceleration.
    """
    ahead = [point for point in waypoints if point.time > time]
    if not ahead:
        return hold(time, waypoints[-1].position)
    here = Waypoint(time, *state)
    return SplineTrack([SplineSegment(a, b) for a, b in zip([here, *ahead[:-1]], ahead, strict=True)])
