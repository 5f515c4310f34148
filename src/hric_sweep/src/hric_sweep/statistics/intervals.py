"""Confidence intervals of a probability, estimated from unweighted or weighted runs."""

from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit
from scipy.stats import binomtest

from hric_core.errors import HricError
from hric_core.geometry import FloatArray

LEVEL = 0.95
"""Default confidence level [1]."""


class ProbabilityInterval(NamedTuple):
    """Ends of a confidence interval of a probability [1]."""

    low: float
    high: float


def clopper_pearson(exceeded: int, runs: int, level: float = LEVEL, side: str = "two-sided") -> ProbabilityInterval:
    """Return the exact (Clopper-Pearson) interval of a probability from independent unweighted runs.

    Source: Clopper & Pearson, Biometrika 26:404, 1934.

    Args:
        exceeded: number of runs that exceeded.
        runs: number of all runs.
        level: confidence level, in (0, 1).
        side: "two-sided", or "less" for a one-sided upper limit (about 3/runs at 95 % if no run exceeded).

    Raises:
        HricError: counts or level are impossible.
    """
    if not 0 <= exceeded <= runs or runs < 1 or not 0.0 < level < 1.0:
        raise HricError(
            f"{exceeded} of {runs} runs at level {level} give no confidence interval; valid: 0 <= exceeded <= runs, 0 "
            "< level < 1"
        )
    ends = binomtest(exceeded, runs, alternative=side).proportion_ci(level, "exact")
    return ProbabilityInterval(float(ends.low), float(ends.high))


def effective_size(weights: FloatArray) -> float:
    """Return the effective sample size of weighted values, (sum w)^2 / sum w^2; 0 without weights.

    Source: Kish, Survey Sampling, 1965.
    """
    squares = float(np.sum(np.square(weights)))
    return float(np.sum(weights)) ** 2 / squares if squares > 0.0 else 0.0


def log_interval(weights: FloatArray, runs: int, level: float = LEVEL) -> ProbabilityInterval:
    """Return the interval of a probability from independent weighted runs, symmetric on a logarithmic scale.

    The estimate is the sum of the weights of the runs that exceeded, divided by the number of runs. With the effective
    number e of these runs, the logarithm of the estimate has a standard deviation of 1/sqrt(e): the count is treated as
    Poisson distributed, which is conservative if most runs exceed. The interval uses the quantile of Student's
    distribution with e - 1 degrees of freedom, as the variance is estimated from e runs.

    Args:
        weights: likelihood ratios of the runs that exceeded, at least one, shape (m,).
        runs: number of all runs, including those that did not exceed.
        level: confidence level, in (0, 1).
    """
    size = effective_size(weights)
    quantile = float(stdtrit(max(size - 1.0, 1.0), 0.5 + 0.5 * level))
    estimate, factor = float(np.sum(weights)) / runs, float(np.exp(quantile / np.sqrt(size)))
    return ProbabilityInterval(estimate / factor, min(estimate * factor, 1.0))
