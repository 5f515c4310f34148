"""Rank correlations (Spearman) between all variables and outputs of a sweep."""

import contextlib

import numpy as np

from hric_core.errors import HricError
from hric_sweep.page.sample import Sample
from hric_sweep.page.study import RecordedSweep
from hric_sweep.statistics.intervals import effective_size
from hric_sweep.statistics.sensitivity import rank_correlation

FEWEST = 10.0
"""Effective number of runs below which a rank correlation is not shown. Project default, unconfirmed."""
LIKELY = 0.05
"""p-value above which a rank correlation is shown in a faint colour. Project default, unconfirmed."""
Ranks = dict[str, dict[str, tuple[float, float]]]
"""(Spearman's rank correlation, p-value) of each pair of columns, by the names of both."""


def ranks(study: RecordedSweep, sample: Sample) -> Ranks:
    """Return the rank correlations of all pairs of columns with ordered values, over the runs that have both values.

    Numbers have an order; words only if there are at most two different ones. The result is empty if the runs are no
    sample of the distributions.
    """
    if sample.refused:
        return {}
    values = {}
    for name in study.variables + study.outputs:
        numbers, labels = study.numbers(name)
        if len(labels) <= 2:
            values[name] = numbers
    correlations: Ranks = {name: {} for name in values}
    names = list(values)
    for k, first in enumerate(names):
        for second in names[k + 1 :]:
            a, b = values[first], values[second]
            if effective_size(sample.counts[~np.isnan(a) & ~np.isnan(b)]) < FEWEST - 1e-9:
                continue
            with contextlib.suppress(HricError):  # one of the two is constant
                correlations[first][second] = correlations[second][first] = rank_correlation(a, b, sample.counts)
    return correlations


def rounded(value: float) -> str:
    """Return a number with two decimals, without -0.00."""
    return f"{round(value, 2) + 0.0:.2f}"
