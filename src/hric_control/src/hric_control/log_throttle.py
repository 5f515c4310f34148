"""Log lines that may come a thousand times a second, at most one each second, with the number of those left out."""

import threading
from collections.abc import Callable

PERIOD = 1.0
"""Shortest time between two lines [s]; project default, unconfirmed."""


class LogThrottle:
    """Passes the first line on at once, and after a period the newest. From any thread.

    Args:
        log: takes a line.
        clock: time now [s].
    """

    def __init__(self, log: Callable[[str], None], clock: Callable[[], float]) -> None:
        self._log, self._clock = log, clock
        self._lock = threading.Lock()
        self._logged_at: float | None = None
        self._left_out, self._last = 0, ""

    def __call__(self, text: str) -> None:
        """Log a line, or count it."""
        with self._lock:
            now, before = self._clock(), self._logged_at
            if before is not None and 0.0 <= now - before < PERIOD:  # a time that jumped back begins anew
                self._left_out, self._last = self._left_out + 1, text
                return
            count, self._left_out, self._logged_at = self._left_out, 0, now
        self._log(f"{text} ({count} more since the last line)" if count else text)

    def finish(self) -> None:
        """Log what was left out since the last line."""
        with self._lock:
            count, self._left_out = self._left_out, 0
        if count:
            self._log(f"{self._last} ({count} times since the last line)")
