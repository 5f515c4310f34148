"""Evens out when samples arrive: each counts at one delay after its measurement, as in the play-out buffers of telephony. No ROS.

A network and a busy machine bring samples some milliseconds early or late. Taken as they come, that is an error of speed times jitter, 0.8 mm at
0.16 m/s and 5 ms, and it shakes the arm. So a sample that was measured at t_m counts at t_m + d + margin, where d is the least delay (arrival less
measurement) seen lately; between two samples the target goes along a straight line. d contains the offset of the two clocks: they need not agree.
"""

from __future__ import annotations

from collections import deque

from hric_controllers.marker_follower import Place

WINDOW = 5.0
"""Over which the least delay is taken [s] (our choice)."""
MOST = 64
"""Samples that wait at most; of more, the oldest go."""


class Playout:
    """Targets on their way.

    Args:
        margin: on top of the least delay [s]; adds as much lag, and a sample may come so much later, less a period of the samples, without effect.
            0: each counts when it comes.
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        self._delays: deque[tuple[float, float]] = deque()  # (arrival, delay), both rising: the first is the least of the window
        self._waiting: deque[tuple[float, Place]] = deque(maxlen=MOST)
        self._told: Place | None = None

    def clear(self) -> None:
        """Forget the targets; what is known of the delay stays."""
        self._waiting.clear()
        self._told = None

    def add(self, time: float, stamp: float | None, place: Place) -> None:
        """A target.

        Args:
            time: at which it came [s].
            stamp: of its measurement, rising, by any clock of the same pace [s]; None: not known, it counts at once.
            place: what it asks for.
        """
        if stamp is None or self._margin == 0.0:
            self._waiting.clear()
            self._waiting.append((float("-inf"), place))
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
        self._waiting.append((stamp, place))

    def due(self, time: float) -> Place | None:
        """The target of this moment [s]; None where it has not changed, or none counts yet."""
        waiting = self._waiting
        if not waiting:
            return None
        now = time - self._delays[0][1] - self._margin if self._delays else time
        while len(waiting) > 1 and waiting[1][0] <= now:
            waiting.popleft()
        stamp, place = waiting[0]
        if now < stamp or (len(waiting) == 1 and place is self._told):
            return None
        if len(waiting) > 1 and stamp > float("-inf"):
            return between(place, waiting[1][1], (now - stamp) / (waiting[1][0] - stamp))
        self._told = place
        return place


def between(a: Place, b: Place, share: float) -> Place:
    """The place at `share` of the straight way from a (0) to b (1)."""
    (px, py, pz), (qx, qy, qz) = a.position, b.position
    position = px + share * (qx - px), py + share * (qy - py), pz + share * (qz - pz)
    if a.turn == b.turn:
        return Place(position, a.turn)
    (ax, ay, az), (bx, by, bz) = a.turn, b.turn
    return Place(position, (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)))
