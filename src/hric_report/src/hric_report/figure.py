"""What a figure shows, as plain data: curves, bounds and bands in panels, and its caption. `report.drawing` draws it
for paper (SVG, PNG), `report_html` in a page, both by the colours and strokes of `report.style`."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_report.heat import HeatMap

FloatArray = npt.NDArray[np.float64]
Bound = tuple[str, float]
"""A horizontal line: what it is, value."""
NEAR = 0.6
"""A bound this far beyond the curves still belongs to the vertical axis [1/height of the curves]."""


STILL = 1e-9
"""Curves whose height is less than this share of their values stand still, and their axis shows nothing finer."""


@dataclass(frozen=True)
class Curve:
    """One line.

    Attributes:
        name: in the legend.
        role: colour and stroke, of `style.ROLES`: measured, setpoint, desired, raw, other, samples (points without a
            line), or s0, s1, ... for one of several alike.
        time: or another abscissa, shape (n,); curves that share the array share it in a page, too.
        values: shape (n,); NaN is a gap.
        cut: whether the axis may end before the curve's peaks.
    """

    name: str
    role: str
    time: FloatArray
    values: FloatArray
    cut: bool = False

    def column(self, joint: int) -> "Curve":
        """The curve of one joint, of values with shape (n, joints); of a time with that shape, too."""
        time = self.time if self.time.ndim == 1 else self.time[:, joint]
        return replace(self, time=time, values=self.values[:, joint])


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
        title: above it.
        curves: its lines, the last one on top.
        bounds: limits and tolerances; a far one does not widen the axis.
        unit, abscissa: of its vertical and horizontal axis; "": those of the figure.
        heat: rows of colours in place of curves, in a panel that is alone in its figure; None: none.
    """

    title: str
    curves: tuple[Curve, ...]
    bounds: tuple[Bound, ...] = ()
    unit: str = ""
    abscissa: str = ""
    heat: HeatMap | None = None


@dataclass(frozen=True)
class Figure:
    """Panels with one horizontal axis.

    Attributes:
        key: name of its file, and in the page's address.
        title: its heading.
        unit: of the vertical axes, as text such as "position [rad]".
        panels: from left to right, then downwards.
        min_height: of a vertical axis, so that rounding errors do not fill a panel [unit].
        logarithmic: whether the vertical axes are.
        abscissa: of the horizontal axes.
        bands: what happened for a while, in all panels: (what, begin, end).
        columns: panels side by side; at most two in one column of a journal.
        equal: whether all axes have one scale, so that a path keeps its shape; the abscissa is no time then.
        section: of `report.sections`, where it belongs.
        caption: what a reader sees in it, in whole sentences.
    """

    key: str
    title: str
    unit: str
    panels: tuple[Panel, ...]
    min_height: float = 0.0
    logarithmic: bool = False
    abscissa: str = "time [s]"
    bands: tuple[tuple[str, float, float], ...] = ()
    columns: int = 2
    equal: bool = False
    section: str = ""
    caption: str = ""

    def about(self, section: str, caption: str) -> "Figure":
        """The same figure with its part of the report and its caption."""
        return replace(self, section=section, caption=caption)

    @property
    def timed(self) -> bool:
        """Whether its abscissa is the time of the run, or of runs that are compared."""
        return not self.equal and self.abscissa.startswith("time")

    def horizontal_range(self, panel: Panel) -> tuple[float, float]:
        """Ends of a panel's horizontal axis that is no time: where all axes have one scale as long as its vertical
        one, else that of all panels."""
        if not self.equal:
            return _extent(curve.time for each in self.panels for curve in each.curves)
        low, high = _extent(curve.time for curve in panel.curves)
        below, above = self.vertical_range(panel)
        middle, half = 0.5 * (low + high), 0.5 * (above - below)
        return middle - half, middle + half

    def vertical_range(self, panel: Panel) -> tuple[float, float]:
        """Ends of a panel's vertical axis: its curves with some room, and a bound that is not far from them; of rows of
        colours the last below and the first above."""
        if panel.heat is not None:
            return len(panel.heat.rows) - 0.5, -0.5
        low, high = _extent(curve.values for curve in panel.curves if not curve.cut)
        if self.logarithmic:
            return low * 10**-0.1, high * 10**0.3
        span = max(high - low, self.min_height)
        lowest, highest = _extent(curve.values for curve in panel.curves)
        low, high = max(lowest, low - span), min(highest, high + span)
        span, middle = max(high - low, self.min_height), 0.5 * (low + high)
        if span <= STILL * max(abs(low), abs(high)):
            span = self.min_height or 0.1 * abs(middle) or 1.0
        low, high = middle - 0.55 * span, middle + 0.55 * span
        for _, bound in panel.bounds:
            if low - NEAR * span < bound < low:
                low = bound - 0.05 * span
            elif high < bound < high + NEAR * span:
                high = bound + 0.05 * span
        return low, high


def _extent(curves: Iterable[FloatArray]) -> tuple[float, float]:
    """Smallest and greatest value; (0, 1) where there is none."""
    ends = [(np.fmin.reduce(values), np.fmax.reduce(values)) for values in curves if len(values)]
    ends = [pair for pair in ends if np.isfinite(pair).all()]
    return (float(min(low for low, _ in ends)), float(max(high for _, high in ends))) if ends else (0.0, 1.0)


def per_joint(
    key: str,
    title: str,
    unit: str,
    joint_names: Iterable[str],
    curves: Sequence[Curve],
    bounds: Callable[[str], tuple[Bound, ...]] = lambda joint: (),
    **options: Any,
) -> Figure:
    """A figure with one panel per joint; a joint that no curve has gets none.

    Args:
        key, title, unit: as `Figure`.
        joint_names: in the order of the columns.
        curves: of all joints, see `Curve.column`.
        bounds: of a joint.
        options: other attributes of the figure.
    """
    panels = []
    for j, name in enumerate(joint_names):
        own = [curve for curve in (matrix.column(j) for matrix in curves) if not np.isnan(curve.values).all()]
        if own:
            panels.append(Panel(name, tuple(own), bounds(name)))
    return Figure(key, title, unit, tuple(panels), **options)
