"""Runs as a sample of the variables' distributions: the weight of each run, or the reason why they are no sample."""

from dataclasses import dataclass

import numpy as np

from hric_core.geometry import FloatArray
from hric_report.html.table import number
from hric_sweep.page.study import RecordedSweep
from hric_sweep.page.words import CROSS_ENTROPY, RANDOM, SPREAD, SUBSET, TPE
from hric_sweep.statistics.intervals import effective_size

FEWEST = 10.0
"""Minimum effective number of weighted runs to estimate a distribution. Project default, unconfirmed."""


@dataclass(frozen=True)
class Sample:
    """Weights with which the runs are a sample of the variables' distributions.

    Attributes:
        counts: weight of each run, shape (runs,); 0: the run is not in the sample.
        independent: True if the runs were drawn independently, or spread even more evenly.
        note: note for the page's reader; "": none.
        refused: reason why the runs are no sample; "": they are a sample.
    """

    counts: FloatArray
    independent: bool
    note: str = ""
    refused: str = ""

    @property
    def unequal(self) -> bool:
        """True if any run has a weight other than 1."""
        return bool(np.any(self.counts != 1.0))

    @property
    def weighted(self) -> bool:
        """True if the runs in the sample have different weights."""
        inside = self.counts[self.counts > 0.0]
        return bool(np.any(inside != inside[:1]))


def of(study: RecordedSweep) -> Sample:
    """Return the weights of a sweep's runs as a sample of the variables' distributions.

    The weights of importance sampling are likelihood ratios, so that weighted averages estimate those of the
    distributions. In subset simulation only the points of the first level have a known distribution.
    """
    if study.sampler == TPE:
        why = "The points were searched for the worst case, not drawn: they do not represent the distributions."
        return Sample(np.zeros(study.runs), independent=False, refused=why)
    if study.sampler == SUBSET:
        first = np.asarray(study.columns["batch"]) == 0
        note = f"Based only on the {first.sum()} runs of the first level, which are drawn from the distributions."
        return Sample(first.astype(float), independent=True, note=note)
    if study.sampler == CROSS_ENTROPY and study.weighted:
        return _weighted(study)
    return Sample(np.ones(study.runs), independent=study.sampler in (RANDOM, CROSS_ENTROPY, *SPREAD))


def _weighted(study: RecordedSweep) -> Sample:
    size = effective_size(study.weights)
    if size < FEWEST:
        why = f"With their weights, the {study.runs} runs are worth {number(size, 2)} runs drawn from the distributions"
        return Sample(study.weights, independent=True, refused=f"{why}: too few to estimate a distribution.")
    note = f"The runs are weighted; together they are worth {number(size, 3)} runs drawn from the distributions."
    return Sample(study.weights, independent=True, note=note)
