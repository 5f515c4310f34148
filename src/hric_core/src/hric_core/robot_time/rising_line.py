"""Map from one clock to another, by a line that is estimated repeatedly; the mapped time never goes back.

Each new estimate differs: by microseconds on a quiet machine, by tenths of a second on a busy one, where the data of
the estimate arrive late. Simply replacing the line would change times that were returned already, and could give the
next measurement an earlier stamp than the last. So the map is a continuous, rising chain of line pieces: a bend, which
begins after all times that were mapped already, leads to the new line.
"""

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

PIECES = 256
"""Number of stored line pieces, which map measurements from before the last bends.

Project default, unconfirmed, as are the other constants of this file."""
BEND = 0.1
"""Time in which a bend reaches the new line, unless its slope is limited by SLOWEST [s]."""
SLOWEST = 0.1
"""Smallest slope of a bend relative to the slope of the new line [1]; a bend with this slope takes longer than BEND."""
JUMP = 1.0
"""Amount by which a new line must be ahead of the map for the map to jump to it at once [s]."""


def fit_line(points: Iterable[tuple[float, float]], slope_limit: float) -> tuple[float, float]:
    """Return (offset, slope) of the least-squares line through points (x, y); |slope| is at most `slope_limit`."""
    xy = list(points)
    n = len(xy)
    mean_x, mean_y = sum(x for x, _ in xy) / n, sum(y for _, y in xy) / n
    sxx = sum((x - mean_x) ** 2 for x, _ in xy)
    slope = sum((x - mean_x) * (y - mean_y) for x, y in xy) / sxx if sxx > 0 else 0.0
    slope = min(max(slope, -slope_limit), slope_limit)
    return mean_y - slope * mean_x, slope


class Line(NamedTuple):
    """Line y = value + slope * (x - anchor) / frequency, with y in s and x in ticks; slope 0: a pause."""

    anchor: int
    value: float
    slope: float
    frequency: float

    def at(self, x: int) -> float:
        """Return the value of the line [s] at x [ticks]."""
        return self.value + self.slope * (x - self.anchor) / self.frequency

    def when(self, value: float) -> int:
        """Return the x [ticks] at which the line has a value [s]; the slope must not be 0."""
        return self.anchor + round((value - self.value) / self.slope * self.frequency)


class RisingLine:
    """Piecewise linear map from ticks of one clock to seconds of another; it rises except during pauses.

    Args:
        line: first line, with a slope above 0.
        until: start of a pause [ticks]; None: no pause.

    Attributes:
        line: line that the map follows now, or after its present bend.
    """

    def __init__(self, line: Line, until: int | None = None) -> None:
        self.line = line
        self._pieces: deque[Line] = deque([line], maxlen=PIECES)  # each from its anchor on
        self._settled: int | None = None
        if until is not None:
            self._pause_from(until)

    def settle(self, x: int) -> None:
        """Fix the map up to x [ticks]: later changes do not alter it there."""
        if self._settled is None or x > self._settled:
            self._settled = x

    def at(self, x: int) -> float:
        """Return the value of the map [s] at x [ticks]."""
        return next((piece for piece in reversed(self._pieces) if x >= piece.anchor), self._pieces[0]).at(x)

    def when(self, value: float) -> int:
        """Return the first x [ticks] at which the map has a value [s], in the past or the future.

        If a pause prevents the value from being reached, the start of the pause is returned."""
        after: int | None = None
        for piece in reversed(self._pieces):
            if piece.value < value:
                break
            after = piece.anchor
        x = piece.when(value) if piece.slope else piece.anchor
        return x if after is None else min(x, after)

    def meet(self, line: Line, begin: int, until: int | None = None) -> None:
        """Bend towards another line from `begin` on, or from the end of the fixed part if that is later.

        Args:
            line: new line, with a slope above 0.
            begin: start of the bend [ticks].
            until: start of a pause [ticks]; None: no pause.
        """
        begin, value = self._cut(begin)
        self.line = line
        excess = value - line.at(begin)
        if excess < -JUMP:
            value, excess = line.at(begin), 0.0
        slope = max(line.slope - excess / BEND, SLOWEST * line.slope)
        bend = Line(begin, value, slope, line.frequency)
        joined = begin + round(excess / (line.slope - slope) * line.frequency) if slope != line.slope else begin
        self._pieces += [bend, line._replace(anchor=joined, value=bend.at(joined))]
        if until is not None:
            self._pause_from(max(until, begin))

    def pause(self, value: float, latest: int) -> None:
        """Hold the map at a value [s] from the time when it is reached, or from `latest` [ticks] on if that is earlier.

        If the fixed part of the map (`settle`) ends at a higher value, the map is held at that value."""
        begin, reached = self._cut(min(self.when(value), latest))
        self._pieces.append(Line(begin, max(reached, value), 0.0, self.line.frequency))

    def _pause_from(self, x: int) -> None:
        level = Line(x, self.at(x), 0.0, self.line.frequency)
        while self._pieces[-1].anchor >= x:
            self._pieces.pop()
        self._pieces.append(level)

    def _cut(self, begin: int) -> tuple[int, float]:
        """Remove the map after `begin` [ticks], or after its fixed part if that ends later; return its new end."""
        begin = begin if self._settled is None else max(begin, self._settled)
        value, pieces = self.at(begin), self._pieces
        while len(pieces) > 1 and pieces[-1].anchor >= begin:
            pieces.pop()
        return begin, value
