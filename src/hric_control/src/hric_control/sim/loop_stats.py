"""Statistics of a loop: cycle times, deadlines, achieved real-time factor."""

import time as wall
from dataclasses import dataclass

WINDOW = 1.0
"""Length of the window of the windowed statistics [s of wall time]."""


@dataclass(frozen=True)
class LoopStats:
    """Statistics of a loop.

    Attributes:
        cycles: cycles since the start of `run`.
        cycle_time_mean: mean duration of a cycle's work over the last full window [s].
        cycle_time_max: largest duration over the last full window [s].
        rtf: robot time per wall time over the last full window [1]; 0 while paused.
        rtf_mean: robot time per wall time since the start of `run`, without pauses [1].
        missed_deadlines: cycles that ended after the next one should have begun, since the start.
        slowed: pieces of 20 ms of the schedule that waited for a late loop, since the start.
    """

    cycles: int
    cycle_time_mean: float
    cycle_time_max: float
    rtf: float
    rtf_mean: float
    missed_deadlines: int
    slowed: int


class LoopMeter:
    """Meter of a loop's statistics. Only the loop calls `cycle`; any thread may call `stats`.

    Args:
        time_step: robot time per cycle [s].
    """

    def __init__(self, time_step: float) -> None:
        self.time_step = time_step
        self.restart(0)

    def restart(self, cycles: int) -> None:
        """Reset the statistics at the start of a run."""
        self.missed = 0
        self._count = 0
        self._moving = 0.0
        self._last_end: float | None = None
        self._open(wall.perf_counter())
        self._window = (0.0, 0.0, 0.0)

    def _open(self, now: float) -> None:
        self._start, self._n, self._busy, self._worst = now, 0, 0.0, 0.0

    def cycle(self, begin: float, end: float) -> None:
        """Add one cycle's work.

        Args:
            begin: monotonic wall clock at its start [s].
            end: monotonic wall clock at its end [s].
        """
        spent = end - begin
        self._count += 1
        self._n += 1
        self._busy += spent
        if spent > self._worst:
            self._worst = spent
        self._moving += end - (begin if self._last_end is None else self._last_end)
        self._last_end = end
        if end - self._start >= WINDOW:
            self._close(end)

    def stand(self) -> None:
        """Leave out the wall time that passes while the loop is paused."""
        self._last_end = None
        now = wall.perf_counter()
        if now - self._start >= WINDOW:
            self._close(now)

    def _close(self, now: float) -> None:
        mean = self._busy / self._n if self._n else 0.0
        self._window = (mean, self._worst, self._n * self.time_step / (now - self._start))
        self._open(now)

    def stats(self, slowed: int) -> LoopStats:
        """Return the statistics of the last full window, or of the first so far. slowed: as in `LoopStats`."""
        mean, worst, rtf = self._window
        if not (mean or rtf) and self._n:
            mean, worst = self._busy / self._n, self._worst
            rtf = self._n * self.time_step / max(wall.perf_counter() - self._start, 1e-9)
        rtf_mean = self._count * self.time_step / self._moving if self._moving > 0.0 else 0.0
        return LoopStats(self._count, mean, worst, rtf, rtf_mean, self.missed, slowed)
