"""Runs as a sample of the distributions: the weight of each run, or the reason why the runs are no sample."""

from dataclasses import dataclass

import numpy as np

from hric_core.geometry import FloatArray
from hric_report.html.table import number
from hric_sweep.page.study import RecordedSweep
from hric_sweep.page.words import CROSS_ENTROPY, RANDOM, SPREAD, SUBSET, TPE
from hric_sweep.statistics.intervals import effective_size

FEWEST = 10.0
"""Effective number of runs below which weights say nothing about a distribution. Project default, unconfirmed."""


@dataclass(frozen=True)
class Sample:
    """Runs as a sample of the distributions.

    Attributes:
        counts: weight of each run, shape (runs,); 0: the run is not in the sample.
        independent: True if the runs are drawn independently, or spread more evenly than that.
        note: note for the reader; "": none.
        refused: reason why the runs are no sample; "": they are one.
    """

    counts: FloatArray
    independent: bool
    note: str = ""
    refused: str = ""

    @property
    def unequal(self) -> bool:
        """True if runs have another weight than 1."""
        return bool(np.any(self.counts != 1.0))

    @property
    def weighted(self) -> bool:
        """True if the runs in the sample have different weights."""
        inside = self.counts[self.counts > 0.0]
        return bool(np.any(inside != inside[:1]))


def of(study: RecordedSweep) -> Sample:
    """Return the runs of a sweep as a sample of the distributions.

    Weights of importance sampling are likelihood ratios, batch by batch, so that weighted averages are those of the
    distributions. Points that the chains of subset simulation try have no known distribution; only its first level has.
    """
    if study.sampler == TPE:
        why = "The points were searched for the worst case, not drawn: they do not represent the distributions."
        return Sample(np.zeros(study.runs), independent=False, refused=why)
    if study.sampler == SUBSET:
        first = np.asarray(study.columns["batch"]) == 0
        note = f"Of the {first.sum()} runs of the first level alone, which are drawn from the distributions themselves."
        return Sample(first.astype(float), independent=True, note=note)
    if study.sampler == CROSS_ENTROPY and study.weighted:
        return _weighted(study)
    return Sample(np.ones(study.runs), independent=study.sampler in (RANDOM, CROSS_ENTROPY, *SPREAD))


def _weighted(study: RecordedSweep) -> Sample:
    size = effective_size(study.weights)
    if size < FEWEST:
        why = f"By their weights the {study.runs} runs are worth {number(size, 2)} runs drawn from the distributions"
        return Sample(study.weights, independent=True, refused=f"{why}: too few to estimate a distribution.")
    note = f"Runs count by their weights; together they are worth {number(size, 3)} runs drawn from the distributions."
    return Sample(study.weights, independent=True, note=note)
