"""Thinning of curves, so that a long run still gives small pages and pictures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hric_report.figure import Curve, Figure, FloatArray, Panel

FEWEST = 500
"""Minimum number of points of a thinned curve."""


def thin(figures: Sequence[Figure], budget: int) -> tuple[list[Figure], int | None]:
    """Thin figures to at most `budget` values altogether, as far as FEWEST allows.

    Long curves are reduced to the smallest and the greatest value of equal parts of time, so that no peak is lost.

    Returns:
        The figures, and the number of points of the longest curves; None: nothing was thinned.
    """
    lengths = np.array([len(curve.values) for figure in figures for panel in figure.panels for curve in panel.curves])
    if lengths.sum() <= budget:
        return list(figures), None
    low, high = FEWEST, int(lengths.max())
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if np.minimum(lengths, middle).sum() <= budget else (low, middle)
    thinner = _Thinner(low)
    return [replace(figure, panels=tuple(thinner.panel(panel) for panel in figure.panels)) for figure in figures], low


def limited(figure: Figure, points: int) -> Figure:
    """Return a copy of the figure whose curves have at most about `points` points each."""
    thinner = _Thinner(points)
    return replace(figure, panels=tuple(thinner.panel(panel) for panel in figure.panels))


class _Thinner:
    """Reduction of curves to a common maximum of points; curves that shared a time array still share one."""

    def __init__(self, points: int) -> None:
        self._points = points
        self._times: dict[int, tuple[FloatArray, FloatArray]] = {}

    def panel(self, panel: Panel) -> Panel:
        return replace(panel, curves=tuple(self._curve(curve) for curve in panel.curves))

    def _curve(self, curve: Curve) -> Curve:
        if len(curve.values) <= self._points:
            return curve
        if np.any(np.diff(curve.time) < 0.0):  # a path: its abscissa is not time
            part = slice(None, None, -(-len(curve.values) // self._points))
            return replace(curve, time=curve.time[part], values=curve.values[part])
        edges = np.linspace(0, len(curve.values), self._points // 2 + 1).astype(np.int64)
        known = self._times.get(id(curve.time))
        if known is None:
            known = self._times[id(curve.time)] = (curve.time, _times(curve.time, edges))
        return replace(curve, time=known[1], values=extremes(curve.values, edges))


def _times(time: FloatArray, edges: npt.NDArray[np.int64]) -> FloatArray:
    first = edges[:-1]
    return np.stack([time[first], time[(first + edges[1:]) // 2]], axis=1).ravel()


def extremes(values: FloatArray, edges: npt.NDArray[np.int64]) -> FloatArray:
    """Return the smallest and the greatest value of each part, in the order of its rise or fall, shape (2 parts,).

    Args:
        values: shape (n,); NaN is ignored.
        edges: increasing indices of the starts of the parts, and the end, shape (parts + 1,).
    """
    low, high = np.fmin.reduceat(values, edges[:-1]), np.fmax.reduceat(values, edges[:-1])
    rising = values[edges[1:] - 1] >= values[edges[:-1]]
    return np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1).ravel()
