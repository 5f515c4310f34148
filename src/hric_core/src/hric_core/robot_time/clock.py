"""The time of the run on the monotonic clock of this machine, from the clock pairs that the robot publishes."""

from collections import deque

from hric_core.robot_time.rising_line import Line, RisingLine, fit_line

NS = 1_000_000_000
WINDOW = 0.3
"""How much of the past places the line [s]. The constants of this file are project defaults, unconfirmed."""
HISTORY = 2.0
"""How much of it gives the pace [s]."""
RATE_SPAN = 0.5
"""Pairs must span this much before their own pace counts [s]."""
RATE_TOLERANCE = 0.1
"""A run whose pace differs from the requested one by more than this share does not keep up: its own pace counts then,
..."""
RECENT = 5
"""... and the mean of so many pairs places the line."""
LOST = 0.09
"""A loop that is late by less than this catches up (`LATE` of hric_control.sim.sim_loop) [s of wall time]; ..."""
LOST_PAIRS = 3
"""... as many later pairs in a row, and it has lost that time for good."""
RESTART = 1.0
"""A time of the run that goes back by more is another run's; by less, as where an arm's clock is set by this machine's
again, it bends [s]."""
SLOWEST_PACE = 1e-3
"""Of a line through pairs that go back [1]."""
HORIZON = 0.5
"""So long after the last pair the run counts as standing [s]."""
HORIZON_NS = round(HORIZON * NS)
LEAD = 0.03
"""A pair counts this long after it was sent: by then all have received it, and nobody has mapped the time in between
otherwise [s]. Where a busy machine delivers it later, it counts from the latest time on that was mapped before."""
LEAD_NS = round(LEAD * NS)


class RunClock:
    """Maps the monotonic clock here to the time of the run, through pauses and at any pace.

    A loop sends its pairs late or in time, never early. So where it keeps the requested pace, the line has that pace
    and runs through the earliest pairs of the window: a hiccup of a few cycles does not move it. Where the
    pace is not known, it is the least-squares line.

    A later monotonic time never gets less than an earlier one, nor than one that was settled, got before, whatever
    pairs come and whenever they do, unless the run restarts.

    Attributes:
        standing: whether the run is paused, by the pairs.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, float]] = deque()
        self._history: deque[tuple[int, float]] = deque()
        self._map: RisingLine | None = None
        self._late = 0
        self._last = (0, 0.0)
        self.standing = False

    def add(self, monotonic: int, run: float, pace: float | None = None) -> None:
        """A pair. One that is older than the last is left out; the line begins again where the time of the run goes
        back by more than `RESTART`.

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
        """Keep what `robot_time` returns for times up to then [ns]."""
        if self._map is not None:
            self._map.settle(monotonic)

    def robot_time(self, monotonic: int) -> float | None:
        """The time of the run [s] at a monotonic time [ns]; None before the first pair."""
        return None if self._map is None else self._map.at(monotonic)

    def monotonic(self, run: float) -> int | None:
        """When that was the time of the run, or will be [ns]; None before the first pair."""
        return None if self._map is None else self._map.when(run)

    def _begin(self, monotonic: int, run: float, pace: float | None) -> Line:
        self._pairs.clear()
        self._history.clear()
        self._pairs.append((monotonic, run))
        self._history.append((monotonic, run))
        self._late = 0
        return Line(monotonic, run, pace or 1.0, NS)

    def _note(self, line: Line, monotonic: int, run: float) -> None:
        """Remember a pair, and forget those of a time that the loop has lost since."""
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
