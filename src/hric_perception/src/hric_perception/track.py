"""What was told of a quantity until now, to be asked at other times. No ROS."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

from hric_perception.chunk import FloatArray

HISTORY = 5.0
"""That is kept [s] (our choice)."""


class Track:
    """Values at rising times, straight lines between them; before the first and after the last they stand. From any thread.

    Args:
        count: of columns; all 0 while nothing was told.
    """

    def __init__(self, count: int) -> None:
        self._count, self._lock = count, threading.Lock()
        self._rows: deque[tuple[float, FloatArray]] = deque()

    def add(self, time: float, values: FloatArray) -> None:
        """One more [s], shape (columns,); an earlier time begins anew, the same one replaces."""
        with self._lock:
            if self._rows and time < self._rows[-1][0]:
                self._rows.clear()
            elif self._rows and time == self._rows[-1][0]:
                self._rows.pop()
            self._rows.append((time, values))
            while self._rows[0][0] < time - HISTORY:
                self._rows.popleft()

    def at(self, times: FloatArray) -> FloatArray:
        """Shape (n, columns)."""
        with self._lock:
            rows = list(self._rows)
        if not rows:
            return np.zeros((len(times), self._count))
        known = np.array([time for time, _ in rows])
        values = np.array([row for _, row in rows])
        return np.column_stack([np.interp(times, known, values[:, column]) for column in range(self._count)])
