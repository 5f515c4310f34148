"""The time of an emulated stream, and what its server's own clock shows then."""

import time
from typing import Protocol

NS = 1_000_000_000
ANOTHER_RUN = 1.0
"""A clock that goes back by more than this has begun again [s] (project default, unconfirmed); less is its noise."""


class Clock(Protocol):
    """A clock that may pause and run at any pace, as the time of a run does
    (`hric_core.robot_time.follower.RobotTime`)."""

    def now(self) -> float | None:
        """The time [s]; None while it is not known."""

    def monotonic(self, run: float) -> int | None:
        """When that was the time, or will be, by the monotonic clock [ns]; None while it is not known."""


class WallClock:
    """The monotonic clock itself."""

    def now(self) -> float:
        """The time [s]."""
        return time.monotonic_ns() / NS

    def monotonic(self, run: float) -> int:
        """The same time [ns]."""
        return round(run * NS)


class StreamTime:
    """Begins at 0 when `clock` is first known, never goes back, and goes on where `clock` begins again.

    Args:
        clock: by which the stream goes.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._began, self._time = clock, 0.0, 0.0
        self._known = False
        self._switched_on = time.monotonic_ns()

    def now(self) -> float:
        """Time of the stream [s]."""
        now = self._clock.now()
        if now is None:
            return self._time
        if not self._known or now - self._began < self._time - ANOTHER_RUN:
            self._known, self._began = True, now - self._time
        self._time = max(self._time, now - self._began)
        return self._time

    def clock_time(self, stream: float) -> float | None:
        """The time by `clock` [s] at a time of the stream [s]; None while it is not known."""
        return self._began + stream if self._known else None

    def hardware_now(self) -> float:
        """What the server's clock shows [s]: it goes on while the stream pauses, as that of a real one does."""
        return (time.monotonic_ns() - self._switched_on) / NS

    def hardware(self, stream: float) -> float:
        """What the server's clock shows at a time of the stream [s]; now, while that is not known."""
        at = self._clock.monotonic(self._began + stream) if self._known else None
        return self.hardware_now() if at is None else (at - self._switched_on) / NS
