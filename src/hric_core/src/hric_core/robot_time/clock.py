"""Mapping from this machine's monotonic clock to robot time, fitted to the clock pairs that the robot publishes.

A clock pair is one instant on both clocks: (monotonic time [ns], robot time [s]). The pace is robot time per wall time.
"""

from collections import deque

from hric_core.robot_time.rising_line import Line, RisingLine, fit_line

NS = 1_000_000_000
WINDOW = 0.3
"""Time span of the newest clock pairs that determine the offset of the fitted line [s].

Project default, unconfirmed, as are all constants of this file."""
HISTORY = 2.0
"""Time span of the newest clock pairs that determine the pace (robot time per wall time) [s]."""
RATE_SPAN = 0.5
"""Shortest time span of clock pairs from which the pace is computed; below it the requested pace is used [s]."""
RATE_TOLERANCE = 0.1
"""Relative deviation of the measured pace from the requested one above which the measured pace is used [1]."""
RECENT = 5
"""Number of newest clock pairs whose mean determines the offset of the line if the measured pace is used."""
LOST = 0.09
"""Lateness of a clock pair that the simulation loop still makes up for [s of wall time].

It is `LATE` of hric_control.sim.sim_loop."""
LOST_PAIRS = 3
"""Number of consecutive clock pairs later than LOST after which the loop no longer makes up the lost time."""
RESTART = 1.0
"""Smallest backward jump of robot time that is taken as the start of a new run [s].

A smaller jump, as when a real arm's clock is synchronised with this machine's again, only bends the line."""
SLOWEST_PACE = 1e-3
"""Smallest pace of a fitted line, also if robot time goes back in the clock pairs [1]."""
HORIZON = 0.5
"""Time after the last clock pair from which on the run counts as paused [s]."""
HORIZON_NS = round(HORIZON * NS)
LEAD = 0.03
"""Delay from the time of a clock pair until it changes the mapping [s].

By then all processes have received the pair, so that all map the same monotonic time to the same robot time. If a busy
machine delivers the pair later, it changes only times after the latest one that was mapped already."""
LEAD_NS = round(LEAD * NS)


class RunClock:
    """Map from the local monotonic clock to robot time, through pauses and at any pace, fitted to clock pairs.

    The robot's loop sends its pairs in time or late, never early. So if it keeps the requested pace, the fitted line
    has that pace and runs through the earliest pairs of the window: a few late cycles do not move it. If the pace is
    not known, it is the least-squares line.

    Unless the run restarts, the map never decreases, and it does not change for times that were settled (`settle`),
    whatever pairs arrive and however late.

    Attributes:
        standing: True if the run is paused: the last pair has the same robot time as the one before.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, float]] = deque()
        self._history: deque[tuple[int, float]] = deque()
        self._map: RisingLine | None = None
        self._late = 0
        self._last = (0, 0.0)
        self.standing = False

    def add(self, monotonic: int, run: float, pace: float | None = None) -> None:
        """Add a clock pair. One with an older monotonic time than the last is ignored.

        If robot time goes back by more than `RESTART`, a new map is started.

        Args:
            monotonic: monotonic time [ns].
            run: robot time [s].
            pace: requested robot time per wall time; None: not known.
        """
        (last, before), known, pace = self._last, self._map, pace or None
        until = monotonic + HORIZON_NS
        if known is None or (monotonic > last and run < before - RESTART):
            self._map = RisingLine(self._begin(monotonic, run, pace), until)
        elif monotonic <= last:
            return
        elif run == before:
            if not self.standing:
                known.pause(run, monotonic)
        elif self.standing or monotonic > last + HORIZON_NS:
            line = self._begin(monotonic, run, pace)
            known.meet(line, min(max(line.when(before), last), monotonic), until)
        else:
            self._note(known.line, monotonic, run)
            known.meet(self._line(pace), monotonic + LEAD_NS, until)
        self.standing = known is not None and run == before
        self._last = (monotonic, run)

    def settle(self, monotonic: int) -> None:
        """Fix the map for times up to `monotonic` [ns]: clock pairs added later do not change it there."""
        if self._map is not None:
            self._map.settle(monotonic)

    def robot_time(self, monotonic: int) -> float | None:
        """Return the robot time [s] at a monotonic time [ns]; None before the first clock pair."""
        return None if self._map is None else self._map.at(monotonic)

    def monotonic(self, run: float) -> int | None:
        """Return the monotonic time [ns] of a robot time [s], past or future; None before the first clock pair."""
        return None if self._map is None else self._map.when(run)

    def _begin(self, monotonic: int, run: float, pace: float | None) -> Line:
        self._pairs.clear()
        self._history.clear()
        self._pairs.append((monotonic, run))
        self._history.append((monotonic, run))
        self._late = 0
        return Line(monotonic, run, pace or 1.0, NS)

    def _note(self, line: Line, monotonic: int, run: float) -> None:
        """Store a clock pair and remove old ones: all but the newest few if the loop has lost time for good."""
        pairs, history = self._pairs, self._history
        late = line.when(run) < monotonic - round(LOST * NS)
        self._late = self._late + 1 if late else 0
        pairs.append((monotonic, run))
        history.append((monotonic, run))
        while pairs[0][0] < monotonic - round(WINDOW * NS) or (self._late >= LOST_PAIRS and len(pairs) > LOST_PAIRS):
            pairs.popleft()
        while history[0][0] < monotonic - round(HISTORY * NS):
            history.popleft()

    def _line(self, pace: float | None) -> Line:
        first, run = self._history[0]
        (last, end), pairs = self._history[-1], self._pairs
        span, gain = (last - first) / NS, end - run
        if pace is None:
            offset, slope = fit_line((((at - first) / NS, time - run) for at, time in self._history), float("inf"))
            return Line(first, run + offset, max(slope, SLOWEST_PACE), NS)
        left = [(time - run) - pace * (at - first) / NS for at, time in pairs]
        if span < RATE_SPAN or abs(gain / span - pace) <= RATE_TOLERANCE * pace:
            return Line(first, run + max(left), pace, NS)
        slope = max(gain / span, SLOWEST_PACE)
        recent = [(time - run) - slope * (at - first) / NS for at, time in list(pairs)[-RECENT:]]
        return Line(first, run + sum(recent) / len(recent), slope, NS)
