"""Curves, panels and plots of a page, and thinning them so that a long run still makes a small page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
FEWEST = 500
"""No curve is thinned below this many points."""


@dataclass(frozen=True)
class Curve:
    """One line.

    Attributes:
        name: in the legend.
        role: colour and stroke, one of page.css: measured, wanted, profile, raw, or s0, s1, ... for one of several alike.
        time: of the page, shape (n,) [s]; curves that share the array share it in the page, too.
        values: shape (n,); NaN is a gap.
    """

    name: str
    role: str
    time: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
        title: above it.
        curves: its lines.
        bounds: horizontal lines, (what, value); they do not widen the axis.
    """

    title: str
    curves: tuple[Curve, ...]
    bounds: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Plot:
    """Panels with one time axis.

    Attributes:
        key: name in the page's address.
        title: its heading.
        unit: of all vertical axes, as text such as "position [rad]".
        panels: from left to right, then downwards.
        least: smallest height of an axis, so that rounding errors do not fill a panel [unit].
        logarithmic: whether the vertical axes are.
        note: what a reader must know, below the heading.
    """

    key: str
    title: str
    unit: str
    panels: tuple[Panel, ...]
    least: float = 0.0
    logarithmic: bool = False
    note: str = ""


def thin(plots: Sequence[Plot], budget: int) -> tuple[list[Plot], int | None]:
    """Plots with at most `budget` values altogether, as far as FEWEST allows.

    Long curves become the least and the greatest value of equal parts of time, so that no peak is lost.

    Returns:
        The plots, and the points that the longest curves kept; None: all.
    """
    lengths = np.array([len(curve.values) for plot in plots for panel in plot.panels for curve in panel.curves])
    if lengths.sum() <= budget:
        return list(plots), None
    low, high = FEWEST, int(lengths.max())
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if np.minimum(lengths, middle).sum() <= budget else (low, middle)
    thinner = _Thinner(low)
    return [replace(plot, panels=tuple(thinner.panel(panel) for panel in plot.panels)) for plot in plots], low


class _Thinner:
    """Thins curves to the same number of points; curves that shared their time still do."""

    def __init__(self, points: int) -> None:
        self._points = points
        self._times: dict[int, tuple[FloatArray, FloatArray]] = {}

    def panel(self, panel: Panel) -> Panel:
        return replace(panel, curves=tuple(self._curve(curve) for curve in panel.curves))

    def _curve(self, curve: Curve) -> Curve:
        if len(curve.values) <= self._points:
            return curve
        edges = np.linspace(0, len(curve.values), self._points // 2 + 1).astype(np.int64)
        known = self._times.get(id(curve.time))
        if known is None:
            known = self._times[id(curve.time)] = (curve.time, _times(curve.time, edges))
        return replace(curve, time=known[1], values=extremes(curve.values, edges))


def _times(time: FloatArray, edges: npt.NDArray[np.int64]) -> FloatArray:
    first = edges[:-1]
    return np.stack([time[first], time[(first + edges[1:]) // 2]], axis=1).ravel()


def extremes(values: FloatArray, edges: npt.NDArray[np.int64]) -> FloatArray:
    """Least and greatest value of each part, in the order in which a rising or falling line has them, shape (2 parts,).

    Args:
        values: shape (n,); NaN is passed over.
        edges: where each part begins, and the end, shape (parts + 1,), rising.
    """
    low, high = np.fmin.reduceat(values, edges[:-1]), np.fmax.reduceat(values, edges[:-1])
    rising = values[edges[1:] - 1] >= values[edges[:-1]]
    return np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1).ravel()
