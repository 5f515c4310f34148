"""Horizontal axes for charts of an HTML page; templates draw them as SVG."""

import math
from dataclasses import dataclass


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return about `count` round numbers from `low` to `high`, for the ticks of an axis."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if rough / power <= factor + 1e-9)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


@dataclass(frozen=True)
class Axis:
    """Horizontal axis of a chart: maps values to positions in the picture.

    Attributes:
        low, high: ends of the axis, in its unit.
        left, right: positions of the ends [units of the picture].
    """

    low: float
    high: float
    left: float
    right: float

    def x(self, value: float) -> float:
        """Return the position of a value, clipped to the ends [units of the picture]; NaN: the left end."""
        share = (value - self.low) / max(self.high - self.low, 1e-9)
        return self.left + (self.right - self.left) * max(0.0, min(share, 1.0))

    @property
    def ticks(self) -> list[float]:
        """Round values for ticks along the axis."""
        return [value if abs(value) > 1e-12 else 0.0 for value in ticks(self.low, self.high, 6)]
