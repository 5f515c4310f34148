"""Sensitivity of an output to each variable: first-order and total Sobol indices, and rank correlation."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_sweep.space import Space
from hric_sweep.statistics.intervals import LEVEL, effective_size

RESAMPLES = 1000
"""Number of bootstrap resamples."""
FEWEST = 16
"""Minimum number of rows of Saltelli's design without a failed run; with fewer the bootstrap has no meaning."""


@dataclass(frozen=True)
class Index:
    """Sobol indices of one variable: shares of the output's variance [1], each with a bootstrap interval.

    Attributes:
        first: share that the variable explains alone.
        total: share that the variable explains together with all its interactions.
        first_interval, total_interval: lower and upper end of the interval of each index.
        level: confidence level of the intervals.
        rows: number of rows of the design without a failed run, from which the indices are computed.
    """

    first: float
    total: float
    first_interval: tuple[float, float]
    total_interval: tuple[float, float]
    level: float
    rows: int


def indices(space: Space, output: FloatArray, seed: int = 0, level: float = LEVEL) -> dict[str, Index]:
    """Return first-order and total Sobol indices of each variable, from runs of the sampler saltelli.

    Estimators: first-order of Saltelli et al., Comput. Phys. Commun. 181:259, 2010, table 2 (b); total of Jansen,
    Comput. Phys. Commun. 117:35, 1999.

    Args:
        space: variables with their distributions.
        output: output of all runs in order of index, NaN for a failed run, shape (rows x (n + 2),).
        seed: seed of the bootstrap.
        level: confidence level of the intervals.

    Raises:
        HricError: variables are correlated, the design is incomplete, the output is constant or infinite, or too few
            rows have no failed run.
    """
    n = len(space.names)
    if not space.independent:
        raise HricError("Sobol indices are not defined for correlated variables; valid: a sweep without correlation")
    if output.size % (n + 2):
        raise HricError(f"{output.size} runs are no Saltelli design; valid: a multiple of {n + 2} in order of index")
    if endless := int(np.isinf(output).sum()):
        raise HricError(f"the output is infinite in {endless} runs, so it has no variance; valid: a finite output")
    blocks = output.reshape(n + 2, -1)
    blocks = blocks[:, np.all(np.isfinite(blocks), axis=0)]
    if (rows := blocks.shape[1]) < FEWEST:
        raise HricError(f"only {rows} rows of the design have no failed run; valid: {FEWEST} or more")
    if np.ptp(blocks[:2]) == 0.0:
        raise HricError("the output is equal in all runs, so no variable has an effect; valid: an output that varies")
    random = np.random.default_rng(seed)
    first, total = _indices(blocks)
    resampled = [_indices(blocks[:, random.integers(0, rows, rows)]) for _ in range(RESAMPLES)]
    ends = np.nanpercentile(np.array(resampled), [50.0 * (1.0 - level), 50.0 * (1.0 + level)], axis=0)
    return {
        name: Index(
            float(first[i]),
            float(total[i]),
            (float(ends[0, 0, i]), float(ends[1, 0, i])),
            (float(ends[0, 1, i]), float(ends[1, 1, i])),
            level,
            rows,
        )
        for i, name in enumerate(space.names)
    }


def _indices(blocks: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return first-order and total indices, shape (n,) each.

    Args:
        blocks: outputs for the matrix A, for B, and for A with the column of each variable from B, shape (n + 2, rows).
    """
    a, b, mixed = blocks[0], blocks[1], blocks[2:]
    variance = float(np.var(blocks[:2]))
    if variance == 0.0:
        return np.full(len(mixed), np.nan), np.full(len(mixed), np.nan)
    middle = float(np.mean(blocks[:2]))
    first: FloatArray = np.mean((b - middle) * (mixed - a), axis=1) / variance
    total: FloatArray = 0.5 * np.mean((a - mixed) ** 2, axis=1) / variance
    return first, total


def rank_correlation(values: FloatArray, output: FloatArray, weights: FloatArray | None = None) -> tuple[float, float]:
    """Return Spearman's rank correlation between a variable and an output, with its p-value.

    With weights, a rank is the weight of all values below plus half the weight of all equal values; the coefficient is
    the weighted Pearson coefficient of these ranks, and the p-value uses the effective number of runs.

    Args:
        values: values of the variable, shape (m,).
        output: values of the output, NaN for failed runs, which are left out, shape (m,).
        weights: likelihood ratios, shape (m,); runs of weight 0 are left out; None: equal weights.

    Returns:
        Coefficient in [-1, 1] and two-sided p-value [1].

    Raises:
        HricError: there are fewer than 3 runs, or one of the two quantities is constant.
    """
    weights = np.ones(values.shape) if weights is None else weights
    used = ~np.isnan(values) & ~np.isnan(output) & (weights > 0.0)
    a, b, counts = values[used], output[used], weights[used]
    if effective_size(counts) < 3.0 - 1e-9 or a.min() == a.max() or b.min() == b.max():
        raise HricError("the rank correlation is not defined; valid: at least 3 runs, in which both quantities vary")
    x, y = _ranks(a, counts), _ranks(b, counts)
    coefficient = float(np.clip(counts @ (x * y) / np.sqrt((counts @ (x * x)) * (counts @ (y * y))), -1.0, 1.0))
    freedom = effective_size(counts) - 2.0
    t = np.inf if abs(coefficient) == 1.0 else abs(coefficient) * np.sqrt(freedom / (1.0 - coefficient**2))
    return coefficient, float(2.0 * stats.t.sf(t, freedom))


def _ranks(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the weighted ranks of values, shape (m,), less their weighted mean; all weights are above 0."""
    _, groups = np.unique(values, return_inverse=True)
    sums = np.bincount(groups, weights)
    middles = np.cumsum(sums) - 0.5 * sums
    centred: FloatArray = (middles - sums @ middles / sums.sum())[groups]
    return centred
