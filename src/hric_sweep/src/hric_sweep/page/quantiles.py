"""Quantiles of a sample with confidence intervals: by order statistics, or by bootstrap if runs have weights."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from hric_core.geometry import FloatArray

RESAMPLED, SEED = 400, 0
"""Number of bootstrap resamples, and their seed. Project default, unconfirmed."""


@dataclass(frozen=True)
class Quantile:
    """Quantile with its confidence interval.

    Attributes:
        share: share of the distribution below the quantile, 0 to 1.
        value: estimated quantile.
        low, high: ends of the interval; NaN: the sample is too small for this end, or not independent.
    """

    share: float
    value: float
    low: float = np.nan
    high: float = np.nan

    @property
    def open(self) -> bool:
        """True if there is no interval."""
        return bool(np.isnan(self.low) and np.isnan(self.high))


def of_sample(values: FloatArray, share: float, level: float) -> Quantile:
    """Return a quantile of independent values of one distribution of any shape.

    The interval lies between two order statistics, whose ranks follow from the binomial distribution (David and
    Nagaraja, Order Statistics, 3rd ed., 7.1).

    Args:
        values: sample, shape (n,).
        share: share of the distribution below the quantile, within 0 and 1.
        level: minimum probability that the interval contains the quantile.
    """
    ordered = np.sort(values)
    count, beyond = len(ordered), 0.5 * (1.0 - level)
    if not count:
        return Quantile(share, np.nan)
    value = interpolated(ordered, share)
    # P(X_(i) <= quantile) = P(at least i of n values lie below it). The lower end is the largest rank i, and the upper
    # end the smallest rank j, with an error probability of at most `beyond`.
    below = int(stats.binom.ppf(beyond, count, share))
    above = int(stats.binom.ppf(1.0 - beyond, count, share)) + 1
    low = float(ordered[below - 1]) if below >= 1 else np.nan
    high = float(ordered[above - 1]) if above <= count else np.nan
    return Quantile(share, value, low, high)


def interpolated(ordered: FloatArray, share: float) -> float:
    """Return the quantile of sorted values, shape (n,), interpolated between its neighbours; values may be infinite."""
    below, part = divmod(share * (len(ordered) - 1), 1.0)
    low, high = float(ordered[int(below)]), float(ordered[min(int(below) + 1, len(ordered) - 1)])
    return low if part == 0.0 or low == high else low + part * (high - low)


def weighted(values: FloatArray, weights: FloatArray, share: float) -> float:
    """Return the smallest value at which the cumulative weight reaches `share`; values and weights: shape (n,)."""
    return float(np.quantile(values, share, weights=weights, method="inverted_cdf"))


def of_weighted(values: FloatArray, weights: FloatArray, share: float, level: float) -> Quantile:
    """Return a quantile of an importance sample with its percentile bootstrap interval; arguments as in `of_sample`."""
    count = len(values)
    if count < 2:
        return Quantile(share, float(values[0]) if count else np.nan)
    random, resampled = np.random.default_rng(SEED), []
    for _ in range(RESAMPLED):
        times = random.multinomial(count, np.full(count, 1.0 / count))
        resampled.append(weighted(values, weights * times, share))
    low, high = np.quantile(resampled, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return Quantile(share, weighted(values, weights, share), float(low), float(high))
