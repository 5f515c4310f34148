"""The time of the run on the monotonic clock of this machine, from pairs that whoever owns the run tells."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

NS = 1_000_000_000
WINDOW = 0.3
"""How much of the past places the line [s]. The constants of this file are our choice."""
HISTORY = 2.0
"""How much of it tells the pace [s]."""
RATE_SPAN = 0.5
"""Pairs must span this much before their own pace is believed [s]."""
RATE_TOLERANCE = 0.1
"""A run whose pace differs from the one asked for by more than this share does not keep up: its own pace counts then, ..."""
RECENT = 5
"""... and the mean of so many pairs places the line."""
LOST = 0.09
"""A loop that is late by less than this catches up (`LATE` of hric_control.sim_loop) [s of wall time]; ..."""
LOST_PAIRS = 3
"""... as many later pairs in a row, and it has lost that time for good."""
HORIZON = 0.5
"""So long after the last pair the run counts as standing [s]."""
HORIZON_NS = round(HORIZON * NS)
PIECES = 256
"""Pauses and bends that are remembered, for what was measured before them."""
LEAD = 0.03
"""A pair counts so long after it was told: by then all have heard it, and no one has given the time in between another meaning [s]."""
BEND = 0.1
"""A new line is met in about so long, so that no time comes twice and none is left out [s], ..."""
MOST_BENT = 0.5
"""... by going so much slower or faster at most [1]; ..."""
STEP = 0.05
"""... one that is further away is stepped to [s]."""


def fit_line(points: Iterable[tuple[float, float]], slope_limit: float) -> tuple[float, float]:
    """(offset, slope) of the least-squares line through points; the slope is cut to its limit."""
    xy = list(points)
    n = len(xy)
    mean_x, mean_y = sum(x for x, _ in xy) / n, sum(y for _, y in xy) / n
    sxx = sum((x - mean_x) ** 2 for x, _ in xy)
    slope = sum((x - mean_x) * (y - mean_y) for x, y in xy) / sxx if sxx > 0 else 0.0
    slope = min(max(slope, -slope_limit), slope_limit)
    return mean_y - slope * mean_x, slope


class _Piece(NamedTuple):
    """run time = run + slope * (monotonic - monotonic of the anchor), from `begin` on; slope 0: the run stands."""

    begin: int
    anchor: int
    run: float
    slope: float
    bent: bool = False

    def at(self, monotonic: int) -> float:
        return self.run + self.slope * (monotonic - self.anchor) / NS

    def when(self, run: float) -> int:
        """The monotonic time of a run time; the piece must not stand."""
        return self.anchor + round((run - self.run) / self.slope * NS)


class RunClock:
    """Maps the monotonic clock here to the time of the run, through pauses and at any pace.

    A loop tells its pairs late or in time, never early. So where it keeps the pace that it is asked for, the line has that pace and runs through the
    earliest pairs of the window: a hiccup of a few cycles does not move it. Where the pace is not known, it is the least-squares line.
    """

    def __init__(self) -> None:
        self._pairs: deque[tuple[int, float]] = deque()
        self._history: deque[tuple[int, float]] = deque()
        self._pieces: deque[_Piece] = deque(maxlen=PIECES)
        self._late = 0
        self._last: tuple[int, float] | None = None

    @property
    def standing(self) -> bool:
        """Whether the run is paused, as far as the pairs tell."""
        return bool(self._pieces) and self._pieces[-1].slope == 0.0

    def add(self, monotonic: int, run: float, pace: float | None = None) -> None:
        """A pair. One that is older than the last is left out; the line begins anew where the time of the run goes back.

        Args:
            monotonic: [ns].
            run: time of the run [s].
            pace: run time per wall time that is asked for; None: not known.
        """
        last, pace = self._last, pace or None
        if last is not None and monotonic <= last[0]:
            return
        self._last = (monotonic, run)
        if last is None or run < last[1]:
            self._pieces.clear()
            self._begin(monotonic, run, pace)
        elif run == last[1]:
            self._stand(monotonic, run)
        elif self.standing:
            self._resume(last[0], monotonic, run, pace)
        else:
            self._follow(monotonic, run, pace)

    def run_time(self, monotonic: int) -> float | None:
        """The time of the run [s] at a monotonic time [ns]; None before the first pair."""
        if self._last is None:
            return None
        monotonic = min(monotonic, self._last[0] + HORIZON_NS)
        for piece in reversed(self._pieces):
            begin, anchor, run, slope, _ = piece
            if monotonic >= begin:
                return run + slope * (monotonic - anchor) / NS
        return self._pieces[0].at(monotonic)

    def monotonic(self, run: float) -> int | None:
        """When that was the time of the run, or will be [ns]; None before the first pair."""
        found = None
        for piece in reversed(self._pieces):
            if piece.slope:
                found = piece.when(run)
                if found >= piece.begin:
                    return found
            elif found is None or run >= piece.run:
                found = piece.begin
        return found

    def _begin(self, monotonic: int, run: float, pace: float | None) -> None:
        self._pairs.clear()
        self._history.clear()
        self._pairs.append((monotonic, run))
        self._history.append((monotonic, run))
        self._late = 0
        self._pieces.append(_Piece(monotonic, monotonic, run, pace or 1.0))

    def _stand(self, monotonic: int, run: float) -> None:
        """From where the line reached that time on, the run stands."""
        if self.standing:
            return
        while len(self._pieces) > 1 and self._pieces[-1].begin > monotonic:
            self._pieces.pop()
        piece = self._pieces[-1]
        begin = min(max(piece.when(run), piece.begin), monotonic)
        self._pieces.append(_Piece(begin, begin, run, 0.0))

    def _resume(self, stood: int, monotonic: int, run: float, pace: float | None) -> None:
        still = self._pieces[-1].run
        self._begin(monotonic, run, pace)
        piece = self._pieces.pop()
        self._pieces.append(piece._replace(begin=min(max(piece.when(still), stood), monotonic)))

    def _follow(self, monotonic: int, run: float, pace: float | None) -> None:
        piece, pairs, history = self._pieces[-1], self._pairs, self._history
        late = piece.when(run) < monotonic - round(LOST * NS)
        self._late = self._late + 1 if late else 0
        pairs.append((monotonic, run))
        history.append((monotonic, run))
        while pairs[0][0] < monotonic - round(WINDOW * NS) or (self._late >= LOST_PAIRS and len(pairs) > LOST_PAIRS):
            pairs.popleft()
        while history[0][0] < monotonic - round(HISTORY * NS):
            history.popleft()
        self._bend(monotonic, self._line(piece.begin, pace))

    def _bend(self, monotonic: int, line: _Piece) -> None:
        """From here on towards the new line. Times before keep what they had, so that all who hear the pairs give a time one meaning, whenever they
        look back at it."""
        begin = monotonic + round(LEAD * NS)
        told = self._pieces[-1].at(begin)
        excess = told - line.at(begin)
        if abs(excess) > STEP or line.slope <= 0.0:
            while self._pieces[-1].bent and len(self._pieces) > 1:
                self._pieces.pop()
            self._pieces[-1] = line._replace(begin=self._pieces[-1].begin)
            return
        share = min(max(-excess / BEND, -MOST_BENT), MOST_BENT)
        self._pieces.append(_Piece(begin, begin, told, line.slope * (1.0 + share), bent=True))

    def _line(self, begin: int, pace: float | None) -> _Piece:
        first, run = self._history[0]
        (last, end), pairs = self._history[-1], self._pairs
        span, gain = (last - first) / NS, end - run
        if pace is None:
            offset, slope = fit_line((((at - first) / NS, time - run) for at, time in self._history), float("inf"))
            return _Piece(begin, first, run + offset, slope)
        left = [(time - run) - pace * (at - first) / NS for at, time in pairs]
        if span < RATE_SPAN or abs(gain / span - pace) <= RATE_TOLERANCE * pace:
            return _Piece(begin, first, run + max(left), pace)
        slope = gain / span
        recent = [(time - run) - slope * (at - first) / NS for at, time in list(pairs)[-RECENT:]]
        return _Piece(begin, first, run + sum(recent) / len(recent), slope)
