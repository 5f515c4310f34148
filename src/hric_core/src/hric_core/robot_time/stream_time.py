"""Time of an emulated sensor stream, and the reading of its server's hardware clock."""

import time
from typing import Protocol

NS = 1_000_000_000
ANOTHER_RUN = 1.0
"""Backward jump of a clock above which it counts as restarted [s]; less is noise (project default, unconfirmed)."""


class Clock(Protocol):
    """Clock that may pause and run at any pace, such as robot time (`hric_core.robot_time.follower.RobotTime`)."""

    def now(self) -> float | None:
        """Return the present time of this clock [s]; None while it is unknown."""

    def monotonic(self, run: float) -> int | None:
        """Return the monotonic time [ns] of a time of this clock [s], past or future; None while it is unknown."""


class WallClock:
    """Monotonic clock of the machine, as a `Clock`."""

    def now(self) -> float:
        """Return the present time of the monotonic clock [s]."""
        return time.monotonic_ns() / NS

    def monotonic(self, run: float) -> int:
        """Return the given time [s] in ns: this clock is the monotonic clock itself."""
        return round(run * NS)


class StreamTime:
    """Time of a stream: it starts at 0 with the first known time of `clock`, and continues when `clock` restarts.

    Args:
        clock: clock that the stream follows; the time of the stream never goes back.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._began, self._time = clock, 0.0, 0.0
        self._known = False
        self._switched_on = time.monotonic_ns()

    def now(self) -> float:
        """Return the time of the stream [s]."""
        now = self._clock.now()
        if now is None:
            return self._time
        if not self._known or now - self._began < self._time - ANOTHER_RUN:
            self._known, self._began = True, now - self._time
        self._time = max(self._time, now - self._began)
        return self._time

    def clock_time(self, stream: float) -> float | None:
        """Return the time of `clock` [s] at a time of the stream [s]; None while it is unknown."""
        return self._began + stream if self._known else None

    def hardware_now(self) -> float:
        """Return the server's hardware clock [s]; as in a real server, it also runs while the stream is paused."""
        return (time.monotonic_ns() - self._switched_on) / NS

    def hardware(self, stream: float) -> float:
        """Return the server's hardware clock [s] at a time of the stream [s]; its present time if that is unknown."""
        at = self._clock.monotonic(self._began + stream) if self._known else None
        return self.hardware_now() if at is None else (at - self._switched_on) / NS
