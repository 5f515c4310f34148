"""From one clock to another by a line that is estimated again and again, so that no later time is ever mapped to an
earlier one.

An estimate moves: by microseconds on a quiet machine, by tenths of a second on a busy one, where the data of the
estimate arrive late. To replace the line would change times that were returned already, and give the next measurement
an earlier stamp than the last. So the map is a chain of pieces, continuous and rising: a new line is met on a bend,
which begins after all times that were mapped before.
"""

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

PIECES = 256
"""Remembered for what was measured before the last bends. Default chosen by this project, unconfirmed, as the constants
below."""
BEND = 0.1
"""A new line is met in about this time [s], ..."""
SLOWEST = 0.1
"""... or later, where the map would otherwise go at less than this share of the line's pace [1]."""
JUMP = 1.0
"""A line that is ahead by more counts as a jump of the time, and is followed at once [s]."""


def fit_line(points: Iterable[tuple[float, float]], slope_limit: float) -> tuple[float, float]:
    """(offset, slope) of the least-squares line through points; the slope is cut to its limit."""
    xy = list(points)
    n = len(xy)
    mean_x, mean_y = sum(x for x, _ in xy) / n, sum(y for _, y in xy) / n
    sxx = sum((x - mean_x) ** 2 for x, _ in xy)
    slope = sum((x - mean_x) * (y - mean_y) for x, y in xy) / sxx if sxx > 0 else 0.0
    slope = min(max(slope, -slope_limit), slope_limit)
    return mean_y - slope * mean_x, slope


class Line(NamedTuple):
    """value + slope * (x - anchor) / frequency, with x in ticks; slope 0: a pause."""

    anchor: int
    value: float
    slope: float
    frequency: float

    def at(self, x: int) -> float:
        """The value [s] at x [ticks]."""
        return self.value + self.slope * (x - self.anchor) / self.frequency

    def when(self, value: float) -> int:
        """The x [ticks] of a value [s]; the slope must not be 0."""
        return self.anchor + round((value - self.value) / self.slope * self.frequency)


class RisingLine:
    """A map that never decreases, and increases wherever it does not pause.

    Args:
        line: with which it begins, slope above 0.
        until: from where on the map pauses [ticks]; None: nowhere.

    Attributes:
        line: that it follows, or will after its bend.
    """

    def __init__(self, line: Line, until: int | None = None) -> None:
        self.line = line
        self._pieces: deque[Line] = deque([line], maxlen=PIECES)  # each from its anchor on
        self._settled: int | None = None
        if until is not None:
            self._pause_from(until)

    def settle(self, x: int) -> None:
        """Keep the map as it is up to x [ticks]."""
        if self._settled is None or x > self._settled:
            self._settled = x

    def at(self, x: int) -> float:
        """The value [s] at x [ticks]."""
        for piece in reversed(self._pieces):
            if x >= piece.anchor:
                return piece.at(x)
        return self._pieces[0].at(x)

    def when(self, value: float) -> int:
        """The first x [ticks] of a value [s]: when it was reached, or will be; of one that is never reached, when the
        map begins to pause."""
        after: int | None = None
        for piece in reversed(self._pieces):
            if piece.value < value:
                break
            after = piece.anchor
        x = piece.when(value) if piece.slope else piece.anchor
        return x if after is None else min(x, after)

    def meet(self, line: Line, begin: int, until: int | None = None) -> None:
        """Follow another line from `begin` on, or from where the map is settled.

        Args:
            line: slope above 0.
            begin: [ticks].
            until: from where on the map pauses [ticks]; None: nowhere.
        """
        begin, value = self._cut(begin)
        self.line = line
        excess = value - line.at(begin)
        if excess < -JUMP:
            value, excess = line.at(begin), 0.0
        slope = max(line.slope - excess / BEND, SLOWEST * line.slope)
        bend = Line(begin, value, slope, line.frequency)
        met = begin + round(excess / (line.slope - slope) * line.frequency) if slope != line.slope else begin
        self._pieces.append(bend)
        self._pieces.append(line._replace(anchor=met, value=bend.at(met)))
        if until is not None:
            self._pause_from(max(until, begin))

    def pause(self, value: float, latest: int) -> None:
        """Pause at a value [s], from where it was reached, `latest` [ticks] at the latest; beyond it where the map is
        settled already."""
        begin, reached = self._cut(min(self.when(value), latest))
        self._pieces.append(Line(begin, max(reached, value), 0.0, self.line.frequency))

    def _pause_from(self, x: int) -> None:
        level = Line(x, self.at(x), 0.0, self.line.frequency)
        while self._pieces[-1].anchor >= x:
            self._pieces.pop()
        self._pieces.append(level)

    def _cut(self, begin: int) -> tuple[int, float]:
        """(x, value) from which on the map may change; what it was beyond is dropped."""
        begin = begin if self._settled is None else max(begin, self._settled)
        value, pieces = self.at(begin), self._pieces
        while len(pieces) > 1 and pieces[-1].anchor >= begin:
            pieces.pop()
        return begin, value
