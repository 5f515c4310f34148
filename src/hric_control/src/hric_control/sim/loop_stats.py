"""Statistics of a simulation loop: cycle times, missed deadlines, achieved real-time factor."""

import time as wall
from dataclasses import dataclass

WINDOW = 1.0
"""Length of the time window over which statistics are computed [s of wall time]."""


@dataclass(frozen=True)
class LoopStats:
    """Statistics of a simulation loop. The time window is the last full second.

    Attributes:
        cycles: number of cycles since the start of the run.
        cycle_time_mean: mean computing time of a cycle in the time window [s].
        cycle_time_max: largest computing time of a cycle in the time window [s].
        rtf: robot time per wall time in the time window [1]; 0 while paused.
        rtf_mean: robot time per wall time since the start of the run, without pauses [1].
        missed_deadlines: number of cycles that ended after the next one should have begun, since the start of the run.
        slowed: number of 20 ms steps in which the schedule of robot time was delayed, as the loop was late.
    """

    cycles: int
    cycle_time_mean: float
    cycle_time_max: float
    rtf: float
    rtf_mean: float
    missed_deadlines: int
    slowed: int


class LoopMeter:
    """Collector of a loop's statistics. Only the loop calls `cycle`; any thread may call `stats`.

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
        """Record one cycle.

        Args:
            begin: monotonic clock at the start of the cycle's computation [s].
            end: monotonic clock at its end [s].
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
        """Exclude the wall time that passes while the loop is paused; called repeatedly during a pause."""
        self._last_end = None
        now = wall.perf_counter()
        if now - self._start >= WINDOW:
            self._close(now)

    def _close(self, now: float) -> None:
        mean = self._busy / self._n if self._n else 0.0
        self._window = (mean, self._worst, self._n * self.time_step / (now - self._start))
        self._open(now)

    def stats(self, slowed: int) -> LoopStats:
        """Return the present statistics; before the first full time window, those so far. `slowed`: see `LoopStats`."""
        mean, worst, rtf = self._window
        if not (mean or rtf) and self._n:
            mean, worst = self._busy / self._n, self._worst
            rtf = self._n * self.time_step / max(wall.perf_counter() - self._start, 1e-9)
        rtf_mean = self._count * self.time_step / self._moving if self._moving > 0.0 else 0.0
        return LoopStats(self._count, mean, worst, rtf, rtf_mean, self.missed, slowed)
