"""Contents of a figure as plain data: curves, bounds and bands in panels, and a caption.

`hric_report.drawing` draws a figure for print (SVG, PNG), `hric_report.html` in a page; `hric_report.style` defines
the colours and strokes of both.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_report.heat import HeatMap

AXES = ("x", "y", "z")
FloatArray = npt.NDArray[np.float64]
Bound = tuple[str, float]
"""Name and value of a limit, drawn as a horizontal line."""
NEAR = 0.6
"""Distance of a limit from the curves up to which the vertical axis includes the limit [share of the curves' range]."""


STILL = 1e-9
"""Range of curves, relative to their values, below which they are drawn as constant, to hide rounding errors [1]."""


@dataclass(frozen=True)
class Curve:
    """One line of a panel.

    Attributes:
        name: name in the legend.
        role: role of the curve, which determines colour and stroke (`style.ROLES`): measured, setpoint, desired, raw,
            other, samples (points, no line), or s0, s1, ... for one of several similar curves.
        time: time [s] or another abscissa, shape (n,); an array shared by several curves is stored once in a page.
        values: ordinates, shape (n,); NaN is a gap.
        cut: True if the axis may cut off the peaks of the curve.
    """

    name: str
    role: str
    time: FloatArray
    values: FloatArray
    cut: bool = False

    def column(self, joint: int) -> "Curve":
        """Return the curve of one joint, for values of shape (n, joints) and times of shape (n,) or (n, joints)."""
        time = self.time if self.time.ndim == 1 else self.time[:, joint]
        return replace(self, time=time, values=self.values[:, joint])


@dataclass(frozen=True)
class Panel:
    """Panel of a figure: curves in one pair of axes.

    Attributes:
        title: title above the panel.
        curves: lines, the last one on top.
        bounds: limits and tolerances, drawn as lines; one far from the curves does not extend the axis.
        unit, abscissa: labels of the vertical and horizontal axis; "": the labels of the figure.
        heat: heat map instead of curves, only in a figure with one panel; None: curves.
    """

    title: str
    curves: tuple[Curve, ...]
    bounds: tuple[Bound, ...] = ()
    unit: str = ""
    abscissa: str = ""
    heat: HeatMap | None = None


@dataclass(frozen=True)
class Figure:
    """Figure: panels with a common horizontal axis.

    Attributes:
        key: file name without extension, and anchor in the page.
        title: heading.
        unit: label of the vertical axes, such as "position [rad]".
        panels: panels from left to right, then downwards.
        min_height: minimum range of a vertical axis, so that rounding errors do not fill a panel [unit].
        logarithmic: True if the vertical axes are logarithmic.
        abscissa: label of the horizontal axes.
        bands: time spans that are marked in all panels: (name, begin [s], end [s]).
        columns: number of panels side by side.
        equal: True if all axes have the same scale, so that a path keeps its shape; the abscissa then is not time.
        section: section of the report, from `hric_report.sections`.
        caption: description for the reader, in full sentences.
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
        """Return a copy of the figure with a section of the report and a caption."""
        return replace(self, section=section, caption=caption)

    @property
    def timed(self) -> bool:
        """True if the abscissa is the time of the run, or of runs that are compared."""
        return not self.equal and self.abscissa.startswith("time")

    def horizontal_range(self, panel: Panel) -> tuple[float, float]:
        """Return the ends of a panel's horizontal axis if it is not time.

        With equal scales it is as long as the vertical axis of the panel, else it covers the curves of all panels.
        """
        if not self.equal:
            return _extent(curve.time for each in self.panels for curve in each.curves)
        low, high = _extent(curve.time for curve in panel.curves)
        below, above = self.vertical_range(panel)
        middle, half = 0.5 * (low + high), 0.5 * (above - below)
        return middle - half, middle + half

    def vertical_range(self, panel: Panel) -> tuple[float, float]:
        """Return the ends of a panel's vertical axis, which covers the curves with a margin, and limits near them.

        For a heat map the axis points downwards: the first row is at the top.
        """
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
    """Return the smallest and the largest value of all arrays; (0, 1) if there is no finite value."""
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
    """Return a figure with one panel per joint; a joint whose values are all NaN gets no panel.

    Args:
        key: file name without extension.
        title: heading.
        unit: label of the vertical axes.
        joint_names: names of the joints in the order of the columns.
        curves: curves whose values have one column per joint, see `Curve.column`.
        bounds: function that returns the limits of a joint.
        options: other attributes of the figure.
    """
    panels = []
    for j, name in enumerate(joint_names):
        shown = [curve for curve in (matrix.column(j) for matrix in curves) if not np.isnan(curve.values).all()]
        if shown:
            panels.append(Panel(name, tuple(shown), bounds(name)))
    return Figure(key, title, unit, tuple(panels), **options)


def path(key: str, title: str, curves: Sequence[Curve], titles: Sequence[str] = ("", "", "")) -> Figure:
    """Return the figure of paths in space, seen from above, from the side and along x, with equal axis scales.

    Args:
        key: file name without extension.
        title: heading.
        curves: paths with positions as values, shape (n, 3) [m].
        titles: titles of the three panels.
    """
    panels = tuple(
        Panel(
            name,
            tuple(replace(curve, time=curve.values[:, a], values=curve.values[:, b]) for curve in curves),
            unit=f"{AXES[b]} [m]",
            abscissa=f"{AXES[a]} [m]",
        )
        for name, (a, b) in zip(titles, ((0, 1), (0, 2), (1, 2)), strict=True)
    )
    extent = max(float(np.max(np.nanmax(curve.values, axis=0) - np.nanmin(curve.values, axis=0))) for curve in curves)
    return Figure(key, title, "", panels, max(extent, 0.02), columns=3, equal=True)
