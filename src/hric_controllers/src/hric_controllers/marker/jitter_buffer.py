"""Jitter buffer: each sample takes effect at a constant delay after its measurement, as in telephony. No ROS.

A network and a busy machine deliver samples some milliseconds early or late. Without a buffer this is a position error
of speed times jitter, 0.8 mm at 0.16 m/s and 5 ms, and it shakes the arm. So a sample that was measured at t_m takes
effect at t_m + d + margin, where d is the minimum recent delay (arrival minus measurement); between two samples the
target is interpolated linearly. d contains the offset of the two clocks: they need not agree.
"""

from collections import deque

from hric_controllers.marker.follower import PoseOffset

WINDOW = 5.0
"""Time window of the minimum delay [s] (project default, unconfirmed)."""
MAX_WAITING = 64
"""Maximum number of waiting samples; the oldest are dropped."""


class JitterBuffer:
    """Buffer of targets that have not taken effect yet.

    Args:
        margin: time added to the minimum delay [s]; adds as much lag. A sample that is late by up to the margin minus
            one sample period does no harm. 0: each sample takes effect on arrival.
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        # (arrival, delay), both rising: the first has the minimum delay of the window
        self._delays: deque[tuple[float, float]] = deque()
        self._waiting: deque[tuple[float, PoseOffset]] = deque(maxlen=MAX_WAITING)
        self._last: PoseOffset | None = None

    def clear(self) -> None:
        """Remove the targets but keep the estimate of the delay."""
        self._waiting.clear()
        self._last = None

    def add(self, time: float, stamp: float | None, target: PoseOffset) -> None:
        """Add a target.

        Args:
            time: time of arrival [s].
            stamp: rising time of measurement, by any clock of the same rate [s]; None: unknown, takes effect at once.
            target: target of the sample.
        """
        if stamp is None or self._margin == 0.0:
            self._waiting.clear()
            self._waiting.append((float("-inf"), target))
            return
        delay = time - stamp
        if self._delays and abs(delay - self._delays[0][1]) > WINDOW:  # another clock
            self._delays.clear()
            self._waiting.clear()
        while self._delays and self._delays[-1][1] >= delay:
            self._delays.pop()
        self._delays.append((time, delay))
        while self._delays[0][0] < time - WINDOW:
            self._delays.popleft()
        self._waiting.append((stamp, target))

    def due(self, time: float) -> PoseOffset | None:
        """Return the target at `time` [s], None if it has not changed or none is due yet."""
        waiting = self._waiting
        if not waiting:
            return None
        now = time - self._delays[0][1] - self._margin if self._delays else time
        while len(waiting) > 1 and waiting[1][0] <= now:
            waiting.popleft()
        stamp, target = waiting[0]
        if now < stamp or (len(waiting) == 1 and target is self._last):
            return None
        if len(waiting) > 1 and stamp > float("-inf"):
            return between(target, waiting[1][1], (now - stamp) / (waiting[1][0] - stamp))
        self._last = target
        return target


def between(a: PoseOffset, b: PoseOffset, share: float) -> PoseOffset:
    """Return the pose offset at the fraction `share` of the straight line from a (0) to b (1)."""
    (px, py, pz), (qx, qy, qz) = a.position, b.position
    position = px + share * (qx - px), py + share * (qy - py), pz + share * (qz - pz)
    if a.rotation == b.rotation:
        return PoseOffset(position, a.rotation)
    (ax, ay, az), (bx, by, bz) = a.rotation, b.rotation
    return PoseOffset(position, (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)))
