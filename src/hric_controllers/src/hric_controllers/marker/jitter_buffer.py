"""Evens out when samples arrive: each counts at one delay after its measurement, as in the jitter buffers of
telephony. No ROS.

A network and a busy machine bring samples some milliseconds early or late. Taken as they come, that is an error of
speed times jitter, 0.8 mm at 0.16 m/s and 5 ms, and it shakes the arm. So a sample that was measured at t_m counts at
t_m + d + margin, where d is the least delay (arrival less measurement) seen lately; between two samples the target goes
along a straight line. d contains the offset of the two clocks: they need not agree.
"""

from collections import deque

from hric_controllers.marker.follower import PoseOffset

WINDOW = 5.0
"""Over which the least delay is taken [s] (project default, unconfirmed)."""
MAX_WAITING = 64
"""Samples that wait at most; of more, the oldest go."""


class JitterBuffer:
    """Targets on their way.

    Args:
        margin: on top of the least delay [s]; adds as much lag, and a sample may come so much later, less a period of
            the samples, without effect.
            0: each counts when it comes.
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        # (arrival, delay), both rising: the first is the least of the window
        self._delays: deque[tuple[float, float]] = deque()
        self._waiting: deque[tuple[float, PoseOffset]] = deque(maxlen=MAX_WAITING)
        self._last: PoseOffset | None = None

    def clear(self) -> None:
        """Forget the targets; what is known of the delay stays."""
        self._waiting.clear()
        self._last = None

    def add(self, time: float, stamp: float | None, target: PoseOffset) -> None:
        """A target.

        Args:
            time: at which it came [s].
            stamp: of its measurement, rising, by any clock of the same pace [s]; None: not known, it counts at once.
            target: the sample's.
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
        """The target of this moment [s]; None where it has not changed, or none counts yet."""
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
    """The pose offset at `share` of the straight line from a (0) to b (1)."""
    (px, py, pz), (qx, qy, qz) = a.position, b.position
    position = px + share * (qx - px), py + share * (qy - py), pz + share * (qz - pz)
    if a.rotation == b.rotation:
        return PoseOffset(position, a.rotation)
    (ax, ay, az), (bx, by, bz) = a.rotation, b.rotation
    return PoseOffset(position, (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)))
