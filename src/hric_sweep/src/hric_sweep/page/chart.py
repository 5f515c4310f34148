"""Small charts as SVG, in the colours of the page."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hric_report.html.tables import escape, number


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return about `count` round numbers between two ends."""
    if not high > low:
        return [low]
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if rough / power <= factor + 1e-9)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


@dataclass(frozen=True)
class Axis:
    """Horizontal axis.

    Attributes:
        low, high: ends of the axis, in its unit.
        left, right: positions of the ends [units of the picture].
    """

    low: float
    high: float
    left: float
    right: float

    def x(self, value: float) -> float:
        """Return the position of a value, clipped to the ends [units of the picture]."""
        share = (value - self.low) / (self.high - self.low)
        return self.left + (self.right - self.left) * min(max(share, 0.0), 1.0)

    def drawn(self, y: float, label: str, top: float) -> Iterator[str]:
        """Yield the axis at a height, with its label and faint lines up to `top`."""
        for value in ticks(self.low, self.high, 6):
            x = self.x(value)
            yield line("grid", x, top, x, y)
            yield text(x, y + 14.0, number(value if abs(value) > 1e-12 else 0.0), "faint", "middle")
        yield line("axis-line", self.left, y, self.right, y)
        yield text(0.5 * (self.left + self.right), y + 29.0, label, "", "middle")


def line(look: str, x1: float, y1: float, x2: float, y2: float) -> str:
    """Return an SVG line of a CSS class."""
    return f'<line class="{look}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def rectangle(look: str, x: float, y: float, width: float, height: float, title: str = "") -> str:
    """Return an SVG rectangle of a CSS class; `title`: tooltip."""
    said = f"<title>{escape(title)}</title>" if title else ""
    return f'<rect class="{look}" x="{x:.2f}" y="{y:.2f}" width="{width:.2f}" height="{height:.2f}">{said}</rect>'


def text(x: float, y: float, words: str, look: str = "", anchor: str = "start") -> str:
    """Return an SVG text of a CSS class."""
    return f'<text class="{look}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def svg(width: float, height: float, label: str, parts: Sequence[str]) -> str:
    """Return the SVG picture; `label`: description for screen readers."""
    return (
        f'<svg class="chart" viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(label)}">'
        f"{''.join(parts)}</svg>"
    )
