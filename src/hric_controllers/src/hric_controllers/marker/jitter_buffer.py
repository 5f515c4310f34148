"""Jitter buffer: each sample takes effect at a constant delay after its measurement, as in telephony. No ROS.

A network and a busy machine deliver samples some milliseconds early or late. Without a buffer this causes a position
error of speed times jitter (0.8 mm at 0.16 m/s and 5 ms), which shakes the arm. So a sample that was measured at t_m
takes effect at t_m + d + margin, with d the minimum recent delay (arrival minus measurement). Between two samples the
target is interpolated linearly. d contains the offset between the clocks of measurement and arrival, so these need not
agree.
"""

from collections import deque

from hric_controllers.marker.follower import PoseOffset

WINDOW = 5.0
"""Length of the time window in which the minimum delay is sought [s] (project default, unconfirmed)."""
MAX_WAITING = 64
"""Maximum number of samples that wait for their time to take effect; beyond it, the oldest are dropped."""


class JitterBuffer:
    """Buffer of targets that have not taken effect yet.

    Args:
        margin: time added to the minimum delay [s]; adds as much lag. A sample that is late by up to the margin minus
            one sample period does no harm. 0: each sample takes effect on arrival.
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        # (arrival, delay), both increasing: the first has the minimum delay of the window
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
            time: robot time at which the sample arrived [s].
            stamp: time at which the sample was measured, later than that of the sample before, by any clock of equal
                rate [s]; None: unknown, the target takes effect at once.
            target: target that follows from the sample.
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
        """Return the target that is in effect at `time` [s], None if it has not changed or none has taken effect."""
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
