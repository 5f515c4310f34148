"""Thins curves, so that a long run still makes a small page and a small picture."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hric_report.figure import Curve, Figure, FloatArray, Panel

FEWEST = 500
"""No curve is thinned below this many points."""


def thin(figures: Sequence[Figure], budget: int) -> tuple[list[Figure], int | None]:
    """Figures with at most `budget` values altogether, as far as FEWEST allows.

    Long curves become the smallest and the greatest value of equal parts of time, so that no peak is lost.

    Returns:
        The figures, and the points that the longest curves kept; None: all.
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
    """A figure whose curves have at most about `points` points each."""
    thinner = _Thinner(points)
    return replace(figure, panels=tuple(thinner.panel(panel) for panel in figure.panels))


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
        if np.any(np.diff(curve.time) < 0.0):  # a path: it has no parts of time
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
    """Smallest and greatest value of each part, in the order of a rising or falling line, shape (2 parts,).

    Args:
        values: shape (n,); NaN is passed over.
        edges: where each part begins, and the end, shape (parts + 1,), rising.
    """
    low, high = np.fmin.reduceat(values, edges[:-1]), np.fmax.reduceat(values, edges[:-1])
    rising = values[edges[1:] - 1] >= values[edges[:-1]]
    return np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1).ravel()
