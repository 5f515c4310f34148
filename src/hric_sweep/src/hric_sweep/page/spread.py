"""Distribution of each output: a histogram, and median, 5th and 95th percentile with their intervals."""

from collections.abc import Iterator

import numpy as np

from hric_core.geometry import FloatArray
from hric_report.html.tables import Table, escape, render
from hric_sweep.page import chart, quantiles
from hric_sweep.page.quantiles import Quantile
from hric_sweep.page.sample import Sample
from hric_sweep.page.study import OUTPUT, Study
from hric_sweep.page.words import SPREAD, figure
from hric_sweep.statistics.intervals import effective_size

LEVEL = 0.95
SHARES = (0.05, 0.5, 0.95)
WIDTH, HEIGHT, LEFT, RIGHT, TOP = 440.0, 165.0, 46.0, 432.0, 22.0
"""Layout of a histogram [units of the picture]."""
MAX_BINS = 60
TAIL = 0.002
"""Share of the runs at each end that the outer bins may collect, so that one run does not compress the histogram."""


def part(study: Study, sample: Sample) -> str:
    """Return the HTML with a histogram of each output and a table, or the reason why the runs are no sample."""
    if sample.refused and study.runs:
        return f"<p class=note>No distributions. {escape(sample.refused)}</p>"
    figures, rows = [], []
    for name in study.named(OUTPUT):
        values, weights = _known(study, sample, name)
        if not len(values):
            continue
        found = [_quantile(sample, values, weights, share) for share in SHARES]
        title = escape(study.label(name))
        text = study.about[name].text
        about = f"<br><span class=note>{escape(text)}</span>" if text else ""
        if study.constant(name):
            drawn = f"<p class=note>{figure(float(values[0]))} in all runs.</p>"
        else:
            drawn = _histogram(study, name, values, weights, found)
        figures.append(f"<figure><figcaption>{title}{about}</figcaption>{drawn}</figure>")
        rows.append((study.label(name), str(len(values)), *(said(one) for one in found), _mean(values, weights)))
    head = ("output", "runs", "5th percentile", "median", "95th percentile", "mean (standard deviation)")
    quantified = Table("", head, tuple(rows), kind(study, sample))
    return f"<div class=spread>{''.join(figures)}</div>{render(quantified)}" if rows else ""


def kind(study: Study, sample: Sample) -> str:
    """Return the explanation of the quantiles' intervals."""
    shown = "Purple: 5th percentile, median, 95th percentile; band: interval. Failed runs are left out."
    shown = f"{shown} {sample.note}".rstrip()
    if not sample.independent:
        return f"{shown} The runs are no independent sample of the distributions: no intervals."
    if sample.weighted:
        return f"{shown} Intervals of {100 * LEVEL:g} % by bootstrap."
    if study.sampler in SPREAD:
        return (
            f"{shown} Intervals of {100 * LEVEL:g} % by order statistics as of independent points; these are spread "
            "evenly, so the intervals are estimates, usually too wide."
        )
    return f"{shown} Intervals of {100 * LEVEL:g} % by order statistics, whatever the distribution."


def said(one: Quantile) -> str:
    """Return a quantile with its interval, as text."""
    if np.isnan(one.low) and np.isnan(one.high):
        return figure(one.value)
    ends = ["open" if np.isnan(end) else figure(end) for end in (one.low, one.high)]
    return f"{figure(one.value)} ({ends[0]} to {ends[1]})"


def _known(study: Study, sample: Sample, name: str) -> tuple[FloatArray, FloatArray]:
    values = np.asarray(study.columns[name], dtype=float)
    known = ~np.isnan(values) & (sample.counts > 0.0)
    return values[known], sample.counts[known]


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
    """Return the ends of the histogram, which include a bound that is near."""
    finite = np.isfinite(values)
    if not np.any(finite):
        return -0.5, 0.5
    low, high = (quantiles.weighted(values[finite], weights[finite], share) for share in (TAIL, 1.0 - TAIL))
    if bound is not None and low - 0.5 * (high - low) < bound < high + 0.5 * (high - low):
        low, high = min(low, bound), max(high, bound)
    margin = 0.03 * (high - low) or 0.05 * abs(low) or 0.5
    return low - margin, high + margin


def _histogram(study: Study, name: str, values: FloatArray, weights: FloatArray, found: list[Quantile]) -> str:
    limit = study.limit if study.limit is not None and study.limit.output == name else None
    bound = None if limit is None else limit.bound
    low, high = _ends(values, weights, bound)
    whole = _whole(values) if bound is None else None
    edges = _edges(low, high, effective_size(weights), bound) if whole is None else whole
    axis, bottom = chart.Axis(edges[0], edges[-1], LEFT, RIGHT), HEIGHT - 34.0
    heights, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges, weights=weights)
    shares, of = heights / heights.sum(), "runs" if np.all(weights == weights[0]) else "weights"
    parts = [*axis.drawn(bottom, study.label(name), TOP), *_vertical(float(shares.max()), bottom, of)]
    for one in found:
        parts += _band(axis, one, bottom)
    scale = (bottom - TOP) / shares.max()
    for k, share in enumerate(shares):
        if share <= 0.0:
            continue
        middle = 0.5 * (edges[k] + edges[k + 1])
        beyond = limit is not None and (middle > limit.bound if limit.above else middle < limit.bound)
        x, width = axis.x(edges[k]), axis.x(edges[k + 1]) - axis.x(edges[k])
        words = f"{figure(float(edges[k]))} to {figure(float(edges[k + 1]))}: {100.0 * share:.3g} % of the {of}"
        look, high = "bar beyond" if beyond else "bar", scale * share
        parts.append(chart.rectangle(look, x + 0.3, bottom - high, max(width - 0.6, 0.4), high, words))
    parts += [chart.line("quantile", axis.x(one.value), TOP, axis.x(one.value), bottom) for one in found]
    if limit is not None and axis.low < limit.bound < axis.high:
        parts += _bound(axis, limit.bound, bottom)
    label = f"distribution of {name}: " + ", ".join(f"{100 * one.share:g} % below {said(one)}" for one in found)
    return chart.svg(WIDTH, HEIGHT, label, parts)


def _edges(low: float, high: float, count: float, bound: float | None) -> FloatArray:
    """Return bin edges by Rice's rule, shape (bins + 1,); one of them is at the bound if that is within the ends."""
    bins = int(np.clip(np.ceil(2.0 * count ** (1.0 / 3.0)), 8, MAX_BINS))
    width = (high - low) / bins
    if bound is None or not low < bound < high:
        return np.asarray(low + width * np.arange(bins + 1))
    first = -int(np.ceil((bound - low) / width))
    return np.asarray(bound + width * np.arange(first, int(np.ceil((high - bound) / width)) + 1))


def _whole(values: FloatArray) -> FloatArray | None:
    """Return edges of one bin per integer if all values are integers; None: they are not, or there are too many."""
    if np.any(np.isinf(values)) or np.any(values != np.round(values)) or np.ptp(values) > MAX_BINS:
        return None
    return np.arange(values.min() - 0.5, values.max() + 1.0)


def _vertical(highest: float, bottom: float, of: str) -> Iterator[str]:
    """Yield the vertical axis: share of the runs, or of their weights, in a bin."""
    for share in chart.ticks(0.0, 100.0 * highest, 3):
        y = bottom - (bottom - TOP) * share / (100.0 * highest)
        yield chart.text(LEFT - 6.0, y + 4.0, figure(share), "faint", "end")
        yield chart.line("axis-line", LEFT - 3.0, y, LEFT, y)
    yield chart.line("axis-line", LEFT, TOP, LEFT, bottom)
    yield chart.text(4.0, TOP - 8.0, f"{of} [%]")


def _bound(axis: chart.Axis, bound: float, bottom: float) -> Iterator[str]:
    x = axis.x(bound)
    yield chart.line("bound", x, TOP - 12.0, x, bottom)
    left = x > 0.5 * (LEFT + RIGHT)
    yield chart.text(x + (-4.0 if left else 4.0), TOP - 6.0, f"limit {figure(bound)}", "", "end" if left else "start")


def _band(axis: chart.Axis, one: Quantile, bottom: float) -> Iterator[str]:
    """Yield the band of a quantile's interval; an open interval extends to the end of the picture."""
    if np.isnan(one.low) and np.isnan(one.high):
        return
    left = axis.x(axis.low if np.isnan(one.low) else one.low)
    right = axis.x(axis.high if np.isnan(one.high) else one.high)
    words = f"{100 * one.share:g} % lie below {said(one)}"
    yield chart.rectangle("band", left, TOP, max(right - left, 1.0), bottom - TOP, words)
