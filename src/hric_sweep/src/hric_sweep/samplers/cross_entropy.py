"""Importance sampling by the cross-entropy method: a proposal distribution moves to the region beyond the limit.

At most half of the batches adapt the proposal: each fits it to the points with the highest margins so far, until enough
of them exceed the limit. The other batches are drawn from this final proposal; only they enter the estimate, which is
therefore unbiased. Likelihood ratios weight the points. One tenth of each batch is drawn from the distributions
themselves, which bounds the weights and serves as a check of the estimate.

Sources: Rubinstein & Kroese, The Cross-Entropy Method, 2004; de Boer et al., Ann. Oper. Res. 134:19, 2005.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.special import logsumexp, ndtr

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.parameters import Settings, refused, whole
from hric_sweep.samplers.mixture import DEFENSIVE, Proposal, fit, log_normal
from hric_sweep.samplers.sampler import CrossCheck, Estimate, Point, SamplerResult, in_order
from hric_sweep.space import EDGE, Space
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson, effective_size, log_interval

BoolArray = npt.NDArray[np.bool_]
BATCHES = 10
"""Number of batches of a sweep if the size of a batch is not set (project default)."""
SMALLEST_BATCH = 20
ADAPTING = 0.5
"""Maximum share of the batches that adapt the proposal [1]."""
ELITE, FEWEST = 0.2, 20
"""Number of points to which a proposal is fitted: as share of a batch, and minimum number (project defaults)."""
METHOD = "importance sampling, t interval of the logarithm"


@dataclass(frozen=True)
class CrossEntropy(Settings):
    """Importance sampling for a rare exceedance with up to three failure regions; for more or curved ones: subset."""

    batch: int | None = whole(
        None,
        minimum=SMALLEST_BATCH,
        text="number of runs per batch; none: a tenth of all runs",
        default_text="runs / 10",
    )

    def sampler(self, space: Space, runs: int | None, seed: int) -> "CrossEntropySampler":
        """Return the sampler. Raises ParameterError: `runs` does not suffice for four batches."""
        if runs is None or runs < 4 * (self.batch or SMALLEST_BATCH):
            fewest = 4 * (self.batch or SMALLEST_BATCH)
            raise refused("sweep.runs", runs, f"a whole number of {fewest} or more with the sampler cross_entropy")
        return CrossEntropySampler(len(space.names), runs, self.batch or max(SMALLEST_BATCH, runs // BATCHES), seed)


@dataclass(frozen=True)
class PointBatch:
    """Points of one batch with their results.

    Attributes:
        z: points as normal scores (standard normal quantiles), shape (m, n).
        plain: number of points that are drawn from the distributions themselves; they are the first ones.
        proposal: distribution of the other points; None: there are none.
        weights: likelihood ratios, shape (m,).
        margins: output minus limit, -inf if the run failed, shape (m,).
        exceeded, failed: True for runs that exceeded, and for runs that failed, shape (m,).
    """

    z: FloatArray
    plain: int
    proposal: Proposal | None
    weights: FloatArray
    margins: FloatArray = field(default_factory=lambda: np.zeros(0))
    exceeded: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    failed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))


class CrossEntropySampler:
    """Sampler that adapts a proposal by cross-entropy and estimates the probability by importance sampling.

    Args:
        n: number of variables.
        runs: maximum number of runs.
        batch: number of runs per batch; the last batch also has the remainder.
        seed: seed of all random draws.
    """

    def __init__(self, n: int, runs: int, batch: int, seed: int) -> None:
        self.total = runs
        self._n, self._batch, self._seed = n, batch, seed
        self._count = runs // batch
        self._adapting: list[PointBatch] = []
        self._final: list[PointBatch] = []
        self._open: PointBatch | None = None
        self._proposal: Proposal | None = None
        self._near, self._adapted = False, False

    def ask(self) -> Sequence[Point]:
        """Return the next batch of points with their weights; the first is drawn from the distributions alone."""
        index = len(self._adapting) + len(self._final)
        if index == self._count:
            return []
        size = self._batch if index < self._count - 1 else self.total - index * self._batch
        random = np.random.default_rng([self._seed, index])
        if self._proposal is None:
            self._open = PointBatch(random.standard_normal((size, self._n)), size, None, np.ones(size))
        else:
            plain = round(DEFENSIVE * size)
            z = np.concatenate([random.standard_normal((plain, self._n)), self._proposal.draw(size - plain, random)])
            self._open = PointBatch(z, plain, self._proposal, np.exp(self._proposal.log_weights(z, plain / size)))
        u = np.clip(ndtr(self._open.z), EDGE, 1.0 - EDGE).tolist()
        return [Point(tuple(row), weight) for row, weight in zip(u, self._open.weights.tolist(), strict=True)]

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Store the results of the batch and adapt the proposal. Raises HricError: results have no margin."""
        if self._open is None:
            raise HricError(
                "the sampler received results before it drew points; valid: results of a batch that was drawn"
            )
        in_order(results, sum(len(batch.z) for batch in (*self._adapting, *self._final)), len(self._open.z))
        done, self._open = with_results(self._open, results), None
        if self._adapted:
            self._final.append(done)
            return
        self._adapting.append(done)
        self._adapt()

    def _adapt(self) -> None:
        """Fit the proposal to the points with the highest margins so far.

        The proposal is final after two successive fits to points that all exceed, or after ADAPTING of the batches.
        """
        z = np.concatenate([batch.z for batch in self._adapting])
        margins = np.concatenate([batch.margins for batch in self._adapting])
        elite = max(round(ELITE * self._batch), FEWEST)
        level = min(float(np.sort(margins)[-elite]), 0.0)
        best = (margins >= level) & (margins > -np.inf)
        if np.any(best):
            self._proposal = fit(z[best], np.exp(self._log_weights(z[best])))
        reached = level >= 0.0
        used_up = len(self._adapting) >= max(1, round(ADAPTING * self._count))
        self._adapted = self._proposal is not None and (used_up or (reached and self._near))
        self._near = reached

    def _log_weights(self, z: FloatArray) -> FloatArray:
        """Return log likelihood ratios of points of all adapting batches, against the mixture of their proposals."""
        plain = log_normal(z)
        densities, sizes = [], []
        for batch in self._adapting:
            share = batch.plain / len(batch.z)
            densities.append(plain if batch.proposal is None else plain - batch.proposal.log_weights(z, share))
            sizes.append(len(batch.z))
        weights: FloatArray = plain - logsumexp(densities, axis=0, b=np.array(sizes)[:, None] / sum(sizes))
        return weights

    def estimate(self) -> Estimate | None:
        """Return the estimate from the batches drawn from the final proposal; None if there is no such batch yet."""
        if not self._final:
            return None
        weights = np.concatenate([batch.weights for batch in self._final])
        exceeded = np.concatenate([batch.exceeded for batch in self._final])
        failed = np.concatenate([batch.failed for batch in self._final])
        check = self._plain_runs()
        counted, runs = weights[exceeded], len(weights)
        low, high = log_interval(counted, runs, LEVEL) if counted.size else (0.0, check.high)
        if np.any(failed):
            high = max(high, log_interval(weights[exceeded | failed], runs, LEVEL).high)
        probability = float(counted.sum()) / runs
        check = replace(check, agrees=check.low <= high and low <= check.high)
        sums = int(exceeded.sum()), int(failed.sum()), effective_size(counted)
        return Estimate(probability, low, high, LEVEL, runs, *sums, METHOD, check)

    def _plain_runs(self) -> CrossCheck:
        """Return count and interval of the runs drawn from the distributions themselves, over all batches."""
        batches = (*self._adapting, *self._final)
        runs = sum(batch.plain - int(batch.failed[: batch.plain].sum()) for batch in batches)
        exceeded = sum(int(batch.exceeded[: batch.plain].sum()) for batch in batches)
        return CrossCheck(runs, exceeded, *clopper_pearson(exceeded, max(runs, 1), LEVEL), agrees=True)


def with_results(batch: PointBatch, results: Sequence[SamplerResult]) -> PointBatch:
    """Return a copy of a batch with margins, exceedance and failure of its runs.

    Raises:
        HricError: a run that did not fail has no margin.
    """
    failed = np.array([result.exceeded is None for result in results])
    if any(result.margin is None for result in results if result.exceeded is not None):
        raise HricError("results have no margin, which this sampler needs: the output of each run minus the limit")
    margins = np.array([-np.inf if result.exceeded is None else float(result.margin or 0.0) for result in results])
    return replace(
        batch, margins=margins, exceeded=np.array([bool(result.exceeded) for result in results]), failed=failed
    )
