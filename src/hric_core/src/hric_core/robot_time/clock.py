"""Time of the run on this machine's monotonic clock, from the clock pairs that the robot publishes."""

from collections import deque

from hric_core.robot_time.rising_line import Line, RisingLine, fit_line

NS = 1_000_000_000
WINDOW = 0.3
"""Time span of pairs that fix the line's offset [s]. The constants of this file are project defaults, unconfirmed."""
HISTORY = 2.0
"""Time span of pairs that fix the pace [s]."""
RATE_SPAN = 0.5
"""Shortest time span of pairs from which their own pace is used [s]."""
RATE_TOLERANCE = 0.1
"""Relative difference from the requested pace above which the pace of the pairs is used [1]."""
RECENT = 5
"""Number of pairs whose mean then fixes the line's offset."""
LOST = 0.09
"""Lateness up to which a loop catches up (`LATE` of hric_control.sim.sim_loop) [s of wall time]."""
LOST_PAIRS = 3
"""Number of later pairs in a row after which the loop has lost that time for good."""
RESTART = 1.0
"""Jump back of the time above which it is that of a new run [s].

A smaller one, as when an arm's clock is set by this machine's again, bends the line."""
SLOWEST_PACE = 1e-3
"""Pace of a line through pairs that go back [1]."""
HORIZON = 0.5
"""Time after the last pair from which the run counts as paused [s]."""
HORIZON_NS = round(HORIZON * NS)
LEAD = 0.03
"""Time after sending from which a pair is used [s]: by then all have received it.

So no process has mapped the time in between differently. If a busy machine delivers it later, it is used from the
latest time on that was mapped before."""
LEAD_NS = round(LEAD * NS)


class RunClock:
    """Map from the local monotonic clock to the time of the run, through pauses and at any pace.

    A loop sends its pairs late or in time, never early. So if it keeps the requested pace, the line has that pace and
    runs through the earliest pairs of the window: a hiccup of a few cycles does not move it. If the pace is not known,
    it is the least-squares line.

    A later monotonic time never gets less than an earlier one, nor than a settled one got before, whatever pairs come
    and whenever they do, unless the run restarts.

    Attributes:
        standing: True if the run is paused, by the pairs.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, float]] = deque()
        self._history: deque[tuple[int, float]] = deque()
        self._map: RisingLine | None = None
        self._late = 0
        self._last = (0, 0.0)
        self.standing = False

    def add(self, monotonic: int, run: float, pace: float | None = None) -> None:
        """Add a pair; one older than the last is ignored. A time back by more than `RESTART` starts a new line.

        Args:
            monotonic: [ns].
            run: time of the run [s].
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
        """Fix the results of `robot_time` for times up to `monotonic` [ns]."""
        if self._map is not None:
            self._map.settle(monotonic)

    def robot_time(self, monotonic: int) -> float | None:
        """Return the time of the run [s] at a monotonic time [ns]; None before the first pair."""
        return None if self._map is None else self._map.at(monotonic)

    def monotonic(self, run: float) -> int | None:
        """Return the monotonic time [ns] of a time of the run, past or future; None before the first pair."""
        return None if self._map is None else self._map.when(run)

    def _begin(self, monotonic: int, run: float, pace: float | None) -> Line:
        self._pairs.clear()
        self._history.clear()
        self._pairs.append((monotonic, run))
        self._history.append((monotonic, run))
        self._late = 0
        return Line(monotonic, run, pace or 1.0, NS)

    def _note(self, line: Line, monotonic: int, run: float) -> None:
        """Store a pair, and remove those before a time that the loop has lost."""
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
