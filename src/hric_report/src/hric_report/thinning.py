"""Reduction of curves to fewer points, so that pages and pictures of long runs remain small."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hric_report.figure import Curve, Figure, FloatArray, Panel

FEWEST = 500
"""Minimum number of points of a reduced curve."""


def thin(figures: Sequence[Figure], budget: int) -> tuple[list[Figure], int | None]:
    """Reduce the curves of figures to at most `budget` values in total, but to no fewer than FEWEST points each.

    A long curve is reduced to the smallest and the largest value in equal time spans, so that no peak is lost.

    Returns:
        The figures, and the maximum number of points of a curve; None: no curve was reduced.
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
    """Return a copy of a figure in which each curve has at most about `points` points."""
    thinner = _Thinner(points)
    return replace(figure, panels=tuple(thinner.panel(panel) for panel in figure.panels))


class _Thinner:
    """Reducer of curves to a maximum number of points; curves that share a time array still share one afterwards."""

    def __init__(self, points: int) -> None:
        self._points = points
        self._times: dict[int, tuple[FloatArray, FloatArray]] = {}

    def panel(self, panel: Panel) -> Panel:
        return replace(panel, curves=tuple(self._curve(curve) for curve in panel.curves))

    def _curve(self, curve: Curve) -> Curve:
        if len(curve.values) <= self._points:
            return curve
        if np.any(np.diff(curve.time) < 0.0):  # a path in space, whose abscissa is not time: keep every k-th point
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
    """Return the smallest and the largest value of each part of an array, shape (2 parts,).

    The smallest value comes first if the part ends higher than it begins, else the largest.

    Args:
        values: array, shape (n,); NaN is ignored.
        edges: increasing indices of the starts of the parts, and the end, shape (parts + 1,).
    """
    low, high = np.fmin.reduceat(values, edges[:-1]), np.fmax.reduceat(values, edges[:-1])
    rising = values[edges[1:] - 1] >= values[edges[:-1]]
    return np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1).ravel()
