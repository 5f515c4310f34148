"""How much each variable matters: first-order and total indices, and correlation of ranks."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from hric_control.errors import HricError
from hric_experiments.sweep.space import Space
from hric_experiments.sweep.statistics.intervals import LEVEL

FloatArray = npt.NDArray[np.float64]
RESAMPLES = 1000
"""Of the bootstrap."""
FEWEST = 16
"""Rows of Saltelli's design without a failed run, at least: below it the bootstrap says nothing."""


@dataclass(frozen=True)
class Index:
    """Of one variable, shares of the output's variance [1], each with its bootstrap interval.

    Attributes:
        first: what the variable explains alone.
        total: what it explains with all its interactions.
        first_interval, total_interval: low and high, at `level`.
        level: of the intervals.
        rows: of the design that were used: those without a failed run.
    """

    first: float
    total: float
    first_interval: tuple[float, float]
    total_interval: tuple[float, float]
    level: float
    rows: int


def indices(space: Space, output: FloatArray, seed: int = 0, level: float = LEVEL) -> dict[str, Index]:
    """First-order and total indices of each variable, from the runs of the sampler saltelli.

    Estimators: first-order of Saltelli et al., Comput. Phys. Commun. 181:259, 2010, table 2 (b); total of Jansen,
    Comput. Phys. Commun. 117:35, 1999.

    Args:
        space: of the variables.
        output: of all runs in order of index, NaN where a run failed, shape (rows x (n + 2),).
        seed: of the bootstrap.
        level: of its intervals.

    Raises:
        HricError: correlated variables, runs that are no whole design, an output that is constant, or too few rows
            without a failed run.
    """
    n = len(space.names)
    if not space.independent:
        raise HricError("indices are not defined for correlated variables; valid: a sweep without correlation")
    if output.size % (n + 2):
        raise HricError(f"{output.size} runs are no design of Saltelli; valid: a multiple of {n + 2} in order of index")
    blocks = output.reshape(n + 2, -1)
    blocks = blocks[:, np.all(np.isfinite(blocks), axis=0)]
    if (rows := blocks.shape[1]) < FEWEST:
        raise HricError(f"{rows} rows of the design have no failed run; valid: {FEWEST} or more")
    if np.ptp(blocks[:2]) == 0.0:
        raise HricError("the output is the same in all runs: no variable matters; valid: one that varies")
    random = np.random.default_rng(seed)
    first, total = _indices(blocks)
    resampled = [_indices(blocks[:, random.integers(0, rows, rows)]) for _ in range(RESAMPLES)]
    shares = [50.0 * (1.0 - level), 50.0 * (1.0 + level)]
    ends = np.nanpercentile(np.array(resampled), shares, axis=0)
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
    """First-order and total indices, shape (n,) each, of outputs of A, B and A with one column of B, (n + 2, rows)."""
    a, b, mixed = blocks[0], blocks[1], blocks[2:]
    variance = float(np.var(blocks[:2]))
    if variance == 0.0:
        return np.full(len(mixed), np.nan), np.full(len(mixed), np.nan)
    middle = float(np.mean(blocks[:2]))
    first: FloatArray = np.mean((b - middle) * (mixed - a), axis=1) / variance
    total: FloatArray = 0.5 * np.mean((a - mixed) ** 2, axis=1) / variance
    return first, total


def rank_correlation(values: FloatArray, output: FloatArray) -> tuple[float, float]:
    """Spearman's coefficient of a variable and an output, and the probability of one so far from 0 by chance.

    Args:
        values: of the variable, shape (m,).
        output: NaN where a run failed; those runs are left out, shape (m,).

    Returns:
        Coefficient in [-1, 1] and two-sided p-value [1].

    Raises:
        HricError: fewer than 3 runs, or one of both is constant.
    """
    kept = np.isfinite(values) & np.isfinite(output)
    if kept.sum() < 3 or np.ptp(values[kept]) == 0.0 or np.ptp(output[kept]) == 0.0:
        raise HricError("ranks have no correlation; valid: 3 runs or more in which both vary")
    found = stats.spearmanr(values[kept], output[kept])
    return float(found.statistic), float(found.pvalue)
