"""Pace of a simulated robot: that of the clock on the wall, and slower where the loop, or somebody for
whom the run waits, does not keep up."""

from collections.abc import Callable

from hric_core.robot_time.schedule import NS, Schedule

STEP = 20_000_000
"""Between knots of the schedule [ns of wall time]. The constants of this file are project defaults, unconfirmed."""
LEAD = 25_000_000
"""A knot is announced so long before the piece to it begins, that all have it in time [ns of wall time]."""
CATCH_UP = 0.05
"""A loop that is late by less makes up for it, and the schedule goes on [s of wall time]; ..."""
LATE = 0.005
"""... one that is later than this [s of wall time] at ..."""
PATIENCE = 25
"""... as many knots more than not does not keep the pace: the schedule waits for all that it is late."""

JUMP = 0.1
"""A loop that is ahead of the schedule by more has run unpaced: the schedule follows at once [s of robot time]."""


class Pace:
    """Announces when each robot time is due, a little ahead. One thread, that of the loop, calls it.

    Args:
        factor: requested robot time per wall time, above 0.

    Attributes:
        factor: as given; may be changed.
        on_knot: called with each knot: monotonic time [ns], robot time [s]; None: nobody.
        limit: called with the robot time that the schedule would reach next, returns which it may [s]; None: all of
            it.
        slowed: knots at which the schedule waited for a loop that was late.
    """

    def __init__(self, factor: float) -> None:
        self.factor = factor
        self.on_knot: Callable[[int, float], None] | None = None
        self.limit: Callable[[float], float] | None = None
        self.slowed = 0
        self._schedule: Schedule | None = None
        self._next = 0
        self._late = 0

    def due(self, now: int, run: float) -> int | None:
        """When a robot time is due [ns]; None: that is not announced yet.

        Args:
            now: monotonic time [ns].
            run: robot time that the loop has reached, at which its next cycle reads [s].
        """
        if now >= self._next:
            self._extend(now, run)
        assert self._schedule is not None
        return self._schedule.monotonic(run)

    def stand(self, now: int, run: float) -> None:
        """Announce that the run pauses for a while: at a robot time [s], or where it was announced to be already."""
        schedule = self._begun(now, run)
        if now >= self._next:
            begin, reached = self._resume(schedule, now)
            self._announce(schedule, begin + STEP, max(reached, run))

    def _begun(self, now: int, run: float) -> Schedule:
        if self._schedule is None:
            self._schedule = Schedule(now, run)
            if self.on_knot is not None:
                self.on_knot(now, run)
        return self._schedule

    def _resume(self, schedule: Schedule, now: int) -> tuple[int, float]:
        """Return where the next piece begins; it stood since the last knot, if nobody could know how it goes on."""
        begin, reached = schedule.end
        if now > begin:
            self._announce(schedule, now, reached)
            begin = now
        return begin, reached

    def _extend(self, now: int, run: float) -> None:
        """Announce the next piece: as long as the pace wants it, less what the loop is late, and up to the limit."""
        schedule = self._begun(now, run)
        late = schedule.robot_time(now) - run
        self._late = min(self._late + 1, 2 * PATIENCE) if late > LATE * self.factor else max(self._late - 1, 0)
        lost = late if self._late >= PATIENCE else max(0.0, late - CATCH_UP * self.factor)
        self.slowed += now > schedule.end[0] or lost > 0.0
        begin, reached = self._resume(schedule, now)
        desired = (run if run > reached + JUMP else reached) + max(0.0, self.factor * STEP / NS - lost)
        if self.limit is not None:
            desired = max(reached, min(desired, self.limit(desired)))
        self._announce(schedule, begin + STEP, desired)

    def _announce(self, schedule: Schedule, monotonic: int, run: float) -> None:
        schedule.add(monotonic, run)
        self._next = monotonic - LEAD
        if self.on_knot is not None:
            self.on_knot(monotonic, run)
