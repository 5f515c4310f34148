"""Pace of a simulated robot: wall-clock pace, slower if the loop or a participant of the run does not keep up."""

from collections.abc import Callable

from hric_core.robot_time.schedule import NS, Schedule

STEP = 20_000_000
"""Time between knots of the schedule [ns of wall time]. All constants here are project defaults, unconfirmed."""
LEAD = 25_000_000
"""Time by which a knot of the schedule is announced ahead, so that all receive it in time [ns of wall time]."""
CATCH_UP = 0.05
"""Lateness up to which the loop catches up and the schedule goes on [s of wall time]."""
LATE = 0.005
"""Lateness above which a knot counts as late [s of wall time]."""
PATIENCE = 25
"""Excess of late knots over punctual ones from which the schedule waits for the loop's full lateness."""

JUMP = 0.1
"""Lead over the schedule above which the schedule follows at once: the loop has run unpaced [s of robot time]."""


class Pace:
    """Schedule that announces, slightly ahead, when each robot time is due. Only the loop's thread calls it.

    Args:
        factor: requested robot time per wall time, above 0.

    Attributes:
        factor: requested robot time per wall time; may be changed.
        on_knot: callback for each knot: monotonic time [ns], robot time [s]; None: no callback.
        limit: function from the next robot time of the schedule to the allowed one [s]; None: no limit.
        slowed: knots at which the schedule waited for a late loop.
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
        """Return the monotonic time at which a robot time is due [ns]; None: not announced yet.

        Args:
            now: monotonic time [ns].
            run: robot time that the loop has reached, at which its next cycle reads [s].
        """
        if now >= self._next:
            self._extend(now, run)
        assert self._schedule is not None
        return self._schedule.monotonic(run)

    def stand(self, now: int, run: float) -> None:
        """Announce a pause of the run at a robot time [s], or at a later one if that was announced already."""
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
        """Return the start of the next piece; after a late call, announce that robot time stood since the last knot."""
        begin, reached = schedule.end
        if now > begin:
            self._announce(schedule, now, reached)
            begin = now
        return begin, reached

    def _extend(self, now: int, run: float) -> None:
        """Announce the next piece: its length by the pace, less the loop's lateness, and up to the limit."""
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
