"""A source that is told from elsewhere, while the run goes on, where its body is."""

from __future__ import annotations

import threading
from bisect import bisect_right
from collections import deque

from mocap_natnet.poses import Pose
from mocap_natnet.server.sources import between

KEPT = 1000
"""Poses that are remembered. The constants of this file are our choice."""
AHEAD = 0.05
"""A body goes on so long at its last speed beyond the last pose that was told [s]; then it rests there, ..."""
SEEN = 0.5
"""... and so long after that pose it is not seen any more [s]."""


class History:
    """Poses as they were told; between them along a straight line. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._times: deque[float] = deque(maxlen=KEPT)
        self._poses: deque[Pose] = deque(maxlen=KEPT)

    def add(self, time: float, pose: Pose) -> None:
        """The body was there. What goes back in time begins anew; the same time twice is left out.

        Args:
            time: of the run [s].
            pose: z up.
        """
        with self._lock:
            if self._times and time == self._times[-1]:
                return
            if self._times and time < self._times[-1]:
                self._times.clear()
                self._poses.clear()
            self._times.append(time)
            self._poses.append(pose)

    @property
    def last(self) -> float:
        """Time of the last pose [s], before all times where there is none."""
        with self._lock:
            return self._times[-1] if self._times else float("-inf")

    def __call__(self, time: float) -> Pose | None:
        """Where it was; None where nobody told it."""
        with self._lock:
            if not self._times or not self._times[0] - SEEN <= time <= self._times[-1] + SEEN:
                return None
            after = bisect_right(self._times, time)
            if after == 0 or len(self._times) == 1:
                return self._poses[0]
            after = min(after, len(self._times) - 1)
            begin, end = self._times[after - 1], self._times[after]
            a, b = self._poses[after - 1], self._poses[after]
        if time > end and end - begin > SEEN:
            return b
        return between(a, b, (min(time, end + AHEAD) - begin) / (end - begin))
