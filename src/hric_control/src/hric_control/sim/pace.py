"""Pace of a simulation: a given robot time per wall time, slower if the loop or another process cannot keep up."""

from collections.abc import Callable

from hric_core.robot_time.schedule import NS, Schedule

STEP = 20_000_000
"""Time between two knots of the schedule [ns of wall time].

Project default, unconfirmed, as are all constants of this file."""
LEAD = 25_000_000
"""Time by which a knot of the schedule is announced in advance, so that all processes get it in time [ns]."""
CATCH_UP = 0.05
"""Lateness up to which the loop may catch up, without a delay of the schedule [s of wall time]."""
LATE = 0.005
"""Lateness of the loop at a knot of the schedule above which the knot counts as late [s of wall time]."""
PATIENCE = 25
"""Excess of late knots over punctual ones from which on the schedule is delayed by the loop's whole lateness."""

JUMP = 0.1
"""Lead of the loop over the schedule above which the schedule jumps to the loop's robot time [s of robot time].

Such a lead arises if the loop has run unpaced."""


class Pace:
    """Schedule that is announced slightly in advance and says when each robot time is due. For the loop's thread only.

    Args:
        factor: requested robot time per wall time, above 0.

    Attributes:
        factor: requested robot time per wall time; may be changed.
        on_knot: callback (monotonic time [ns], robot time [s]) for each announced knot; None: no callback.
        limit: function that returns the allowed robot time [s], given the next one of the schedule; None: no limit.
        slowed: number of knots at which the schedule was delayed, as the loop was late.
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
        """Return the monotonic time [ns] at which the loop's next cycle is due; None: not announced yet.

        Args:
            now: present monotonic time [ns].
            run: robot time of the loop's next cycle [s].
        """
        if now >= self._next:
            self._extend(now, run)
        assert self._schedule is not None
        return self._schedule.monotonic(run)

    def stand(self, now: int, run: float) -> None:
        """Announce a pause at a robot time [s], or at the last announced one if that is later."""
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
        """Return the start of the schedule's next piece: (monotonic time [ns], robot time [s]).

        If the last knot is past already, robot time is announced as constant since then."""
        begin, reached = schedule.end
        if now > begin:
            self._announce(schedule, now, reached)
            begin = now
        return begin, reached

    def _extend(self, now: int, run: float) -> None:
        """Announce the next knot, with robot time by the pace, minus the loop's lateness, and within the limit."""
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
