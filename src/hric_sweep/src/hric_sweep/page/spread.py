"""Distribution of each output: histogram, and median, 5th and 95th percentile with confidence intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hric_core.geometry import FloatArray
from hric_report.html import chart
from hric_report.html.table import PageTable
from hric_sweep.page import quantiles
from hric_sweep.page.quantiles import Quantile
from hric_sweep.page.sample import Sample
from hric_sweep.page.study import RecordedSweep
from hric_sweep.page.words import SPREAD, figure
from hric_sweep.statistics.intervals import effective_size

LEVEL = 0.95
SHARES = (0.05, 0.5, 0.95)
LEFT, RIGHT = 46.0, 432.0
"""Ends of the axis of a histogram [units of the picture]."""
MAX_BINS = 60
TAIL = 0.002
"""Share of the runs that may lie beyond each end of the axis and then count in the outer bin, so that single extreme
runs do not compress the histogram."""
HEAD = ("output", "runs", "5th percentile", "median", "95th percentile", "mean (standard deviation)")


class HistogramBar(NamedTuple):
    """Bar of a histogram: its ends, its share of the runs [1], and `beyond`: True if its middle exceeds the limit."""

    low: float
    high: float
    share: float
    beyond: bool


@dataclass(frozen=True)
class Histogram:
    """Histogram of an output.

    Attributes:
        bars: bars with a share above 0.
        counted: "runs" or "weights", the quantity whose share the bars show.
        bound: limit of the output; None: the output has no limit.
        axis: horizontal axis.
    """

    bars: Sequence[HistogramBar]
    counted: str
    bound: float | None
    axis: chart.Axis

    @property
    def highest(self) -> float:
        """Share of the runs in the highest bar [1]."""
        return max(bar.share for bar in self.bars)

    @property
    def shares(self) -> list[float]:
        """Tick values of the vertical axis [%]."""
        return chart.ticks(0.0, 100.0 * self.highest, 3)


@dataclass(frozen=True)
class OutputDistribution:
    """Distribution of an output.

    Attributes:
        name: name of the output.
        label: name and unit.
        text: description.
        quantiles: 5th percentile, median and 95th percentile.
        row: table row with the columns of HEAD.
        histogram: histogram; None: all values are equal.
    """

    name: str
    label: str
    text: str
    quantiles: Sequence[Quantile]
    row: tuple[str, ...]
    histogram: Histogram | None


def spreads(study: RecordedSweep, sample: Sample) -> list[OutputDistribution]:
    """Return the distribution of each output that has values; empty if the runs are no sample."""
    return [] if sample.refused else [spread for name in study.outputs if (spread := _spread(study, sample, name))]


def table(study: RecordedSweep, sample: Sample, rows: Sequence[OutputDistribution]) -> PageTable:
    """Return the table of all outputs' quantiles, means and standard deviations."""
    return PageTable("", HEAD, tuple(spread.row for spread in rows), caption(study, sample))


def _spread(study: RecordedSweep, sample: Sample, name: str) -> OutputDistribution | None:
    values = np.asarray(study.columns[name], dtype=float)
    known = ~np.isnan(values) & (sample.counts > 0.0)
    values, weights, label = values[known], sample.counts[known], study.label(name)
    if not len(values):
        return None
    estimates = [_quantile(sample, values, weights, share) for share in SHARES]
    row = (label, str(len(values)), *map(with_interval, estimates), _mean(values, weights))
    drawn = None if study.constant(name) else _histogram(study, name, values, weights)
    return OutputDistribution(name, label, study.about[name].text, estimates, row, drawn)


def caption(study: RecordedSweep, sample: Sample) -> str:
    """Return the caption that explains the quantiles and the method of their confidence intervals."""
    shown = "Purple lines: 5th percentile, median, 95th percentile; bands: their intervals. Failed runs are left out."
    shown = f"{shown} {sample.note}".rstrip()
    if not sample.independent:
        return f"{shown} No intervals, because the runs are no independent sample of the distributions."
    if sample.weighted:
        return f"{shown} Intervals of {100 * LEVEL:g} % by bootstrap."
    if study.sampler in SPREAD:
        return (
            f"{shown} Intervals of {100 * LEVEL:g} % by order statistics for independent points; these points are "
            "spread "
            "evenly, so the intervals are usually too wide."
        )
    return f"{shown} Intervals of {100 * LEVEL:g} % by order statistics, valid for any distribution."


def with_interval(quantile: Quantile) -> str:
    """Return a quantile with its interval, as text."""
    if quantile.open:
        return figure(quantile.value)
    ends = ["open" if np.isnan(end) else figure(end) for end in (quantile.low, quantile.high)]
    return f"{figure(quantile.value)} ({ends[0]} to {ends[1]})"


def _quantile(sample: Sample, values: FloatArray, weights: FloatArray, share: float) -> Quantile:
    if not sample.independent:
        return Quantile(share, quantiles.interpolated(np.sort(values), share))
    if sample.weighted:
        return quantiles.of_weighted(values, weights, share, LEVEL)
    return quantiles.of_sample(values, share, LEVEL)


def _mean(values: FloatArray, weights: FloatArray) -> str:
    if np.any(np.isinf(values)):
        return figure(float(values[np.isinf(values)][0]))
    mean = float(np.average(values, weights=weights))
    return f"{figure(mean)} ({figure(float(np.sqrt(np.average((values - mean) ** 2, weights=weights))))})"


def _ends(values: FloatArray, weights: FloatArray, bound: float | None) -> tuple[float, float]:
    """Return the ends of the histogram's axis, which includes the limit `bound` if it is near the values."""
    finite = np.isfinite(values)
    if not np.any(finite):
        return -0.5, 0.5
    low, high = (quantiles.weighted(values[finite], weights[finite], share) for share in (TAIL, 1.0 - TAIL))
    if bound is not None and low - 0.5 * (high - low) < bound < high + 0.5 * (high - low):
        low, high = min(low, bound), max(high, bound)
    margin = 0.03 * (high - low) or 0.05 * abs(low) or 0.5
    return low - margin, high + margin


def _histogram(study: RecordedSweep, name: str, values: FloatArray, weights: FloatArray) -> Histogram:
    limit = study.limit if study.limit is not None and study.limit.output == name else None
    bound = None if limit is None else limit.bound
    integers = _integer_edges(values) if bound is None else None
    edges = _edges(*_ends(values, weights, bound), effective_size(weights), bound) if integers is None else integers
    heights, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges, weights=weights)
    shares, middles = heights / heights.sum(), 0.5 * (edges[:-1] + edges[1:])
    if limit is None:
        beyond = np.zeros(len(middles), bool)
    else:
        beyond = middles > limit.bound if limit.above else middles < limit.bound
    columns = (edges[:-1], edges[1:], shares, beyond)
    bars = [HistogramBar(*bar) for bar in zip(*(column.tolist() for column in columns), strict=True) if bar[2] > 0.0]
    counted = "runs" if np.all(weights == weights[0]) else "weights"
    return Histogram(bars, counted, bound, chart.Axis(float(edges[0]), float(edges[-1]), LEFT, RIGHT))


def _edges(low: float, high: float, count: float, bound: float | None) -> FloatArray:
    """Return bin edges by Rice's rule, shape (bins + 1,); one lies at the limit `bound` if it is within the ends."""
    bins = int(np.clip(np.ceil(2.0 * count ** (1.0 / 3.0)), 8, MAX_BINS))
    width = (high - low) / bins
    if bound is None or not low < bound < high:
        return np.asarray(low + width * np.arange(bins + 1))
    first = -int(np.ceil((bound - low) / width))
    return np.asarray(bound + width * np.arange(first, int(np.ceil((high - bound) / width)) + 1))


def _integer_edges(values: FloatArray) -> FloatArray | None:
    """Return bin edges with one bin per integer; None: not all values are integers, or their range is too large."""
    if np.any(np.isinf(values)) or np.any(values != np.round(values)) or np.ptp(values) > MAX_BINS:
        return None
    return np.arange(values.min() - 0.5, values.max() + 1.0)
