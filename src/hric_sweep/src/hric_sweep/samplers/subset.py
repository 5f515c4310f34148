"""Subset simulation: a small probability as a product of larger ones, one for each level on the way to the limit.

The points of the first level are drawn from the distributions. The tenth of them with the highest margins are the seeds
of Markov chains, which draw the points of the next level among those above that margin, and so on until a tenth exceeds
the limit or no runs are left. Each batch is one step of all chains. The step, z' = a z + sqrt(1 - a^2) e with standard
normal e, preserves the standard normal distribution. A point below the level is rejected, and the chain's previous
point counts again; the correlation a is adapted to an acceptance rate of 0.44.

Sources: Au & Beck, Probab. Eng. Mech. 16:263, 2001; Papaioannou et al., Probab. Eng. Mech. 41:89, 2015.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, ndtri

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.parameters import Settings, number, refused
from hric_sweep.samplers.cross_entropy import PointBatch, with_results
from hric_sweep.samplers.sampler import CrossCheck, Estimate, Point, SamplerResult, in_order
from hric_sweep.space import EDGE, Space
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson

LENGTH = 10
"""Number of points per chain; its inverse is the conditional probability of each level."""
FEWEST = 10
"""Minimum number of chains; with fewer the interval would be too wide to be useful (project default)."""
FIRST_STEP = 0.8
"""Initial correlation between successive points of a chain [1]."""
ACCEPTED = 0.44
"""Target acceptance rate [1], to which the correlation of the steps is adapted (Papaioannou et al. 2015)."""
METHOD = "subset simulation, normal interval of the logarithm"


@dataclass(frozen=True)
class Subset(Settings):
    """Subset simulation for a rare exceedance: failure regions of any shape, but wider intervals than cross_entropy."""

    smallest: float = number(
        1e-5, minimum=1e-9, maximum=0.1, text="smallest probability that the sweep shall be able to estimate"
    )

    def sampler(self, space: Space, runs: int | None, seed: int) -> "SubsetSampler":
        """Return the sampler. Raises ParameterError: there are too few runs for the number of levels."""
        levels = math.ceil(-math.log10(self.smallest) - 1e-9)
        per_chain = LENGTH + (levels - 1) * (LENGTH - 1)
        if runs is None or runs < FEWEST * per_chain:
            what = f"{FEWEST * per_chain} or more with the sampler subset down to {self.smallest:g}"
            raise refused("sweep.runs", runs, f"a whole number of {what}")
        return SubsetSampler(len(space.names), runs // per_chain, levels, seed)


class ChainState(NamedTuple):
    """Current points of all Markov chains: normal scores, shape (chains, n), and margins, shape (chains,)."""

    z: FloatArray
    margins: FloatArray


class SubsetSampler:
    """Sampler that estimates a small probability by subset simulation.

    Args:
        n: number of variables.
        chains: number of chains per level.
        levels: maximum number of levels.
        seed: seed of all random draws.
    """

    def __init__(self, n: int, chains: int, levels: int, seed: int) -> None:
        self._n, self._chains, self._levels, self._seed = n, chains, levels, seed
        self.total = chains * (LENGTH + (levels - 1) * (LENGTH - 1))
        self._count, self._batches, self._a = 0, 0, FIRST_STEP
        self._open: PointBatch | None = None
        self._steps: list[ChainState] = []
        self._level, self._shares, self._variances = -np.inf, 1.0, list[float]()
        self._exceeded, self._failed, self._done = 0, 0, False
        self._first: CrossCheck | None = None
        self._last: float | None = None
        self._bound = 1.0

    def ask(self) -> Sequence[Point]:
        """Return the proposed next points of all chains; a point's weight is the estimated probability of its level."""
        if self._done:
            return []
        random = np.random.default_rng([self._seed, self._batches])
        if not self._steps:
            z = random.standard_normal((self._chains * LENGTH, self._n))
        else:
            before = self._steps[-1].z
            z = self._a * before + math.sqrt(1.0 - self._a**2) * random.standard_normal(before.shape)
        self._open = PointBatch(z, len(z), None, np.full(len(z), self._shares))
        return [Point(tuple(row), self._shares) for row in np.clip(ndtr(z), EDGE, 1.0 - EDGE).tolist()]

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Store the results of a step; failed runs count as not exceeding. Raises HricError: results have no margin."""
        if self._open is None:
            raise HricError(
                "the sampler received results before it drew points; valid: results of a batch that was drawn"
            )
        in_order(results, self._count, len(self._open.z))
        batch, self._open = with_results(self._open, results), None
        self._count, self._batches = self._count + len(results), self._batches + 1
        self._exceeded += int(batch.exceeded.sum())
        self._failed += int(batch.failed.sum())
        if self._first is None:
            runs, exceeded = len(results) - int(batch.failed.sum()), int(batch.exceeded.sum())
            self._first = CrossCheck(runs, exceeded, *clopper_pearson(exceeded, max(runs, 1), LEVEL), agrees=True)
            self._finish(batch.z, batch.margins, chained=False)
            return
        self._step(batch)
        if len(self._steps) == LENGTH:
            z, margins = (np.concatenate([getattr(step, name) for step in self._steps]) for name in ("z", "margins"))
            self._finish(z, margins, chained=True)

    def _step(self, batch: PointBatch) -> None:
        """Accept the points above the level; other chains stay at their previous points. Adapt the correlation a."""
        before, above = self._steps[-1], batch.margins > self._level
        z = np.where(above[:, None], batch.z, before.z)
        self._steps.append(ChainState(z, np.where(above, batch.margins, before.margins)))
        spread = (1.0 - self._a**2) * math.exp(0.5 * (float(above.mean()) - ACCEPTED))
        self._a = min(max(math.sqrt(max(1.0 - spread, 0.0)), 0.3), 0.98)

    def _finish(self, z: FloatArray, margins: FloatArray, chained: bool) -> None:
        """Finish a level; it is the last if a tenth exceeds or no levels are left, else start the next chains."""
        order = np.argsort(-margins, kind="stable")
        level = 0.5 * float(margins[order[self._chains - 1]] + margins[order[self._chains]])
        self._done = level >= 0.0 or len(self._variances) + 1 == self._levels or not np.isfinite(level)
        above = margins > (0.0 if self._done else level)
        share = float(above.mean())
        size = len(z) / (correlation_factor(above.reshape(LENGTH, -1)) if chained else 1.0)
        if self._done:
            self._last = clopper_pearson(0, max(int(size), 1), LEVEL).high if share == 0.0 else None
        if share > 0.0:
            self._variances.append((1.0 - share) / (share * size))
        self._bound = self._shares
        self._shares *= share
        best = order[: self._chains]
        self._level = level
        self._steps = [ChainState(z[best], margins[best])]

    def estimate(self) -> Estimate | None:
        """Return the estimate from the product of all levels; None until the last level is finished.

        The relative variance used is the mean of those for independent and for fully correlated levels. The coverage of
        the resulting interval is in docs/concepts/rare_events.md.
        """
        if not self._done or self._first is None:
            return None
        variances = np.array(self._variances)
        variance = 0.5 * (float(variances.sum()) + float(np.sqrt(variances).sum()) ** 2)
        factor = math.exp(float(ndtri(0.5 + 0.5 * LEVEL)) * math.sqrt(math.log1p(variance)))
        low, high = self._shares / factor, min(self._shares * factor, 1.0)
        if self._last is not None:
            low, high = 0.0, min(self._bound * factor * self._last, 1.0)
        agrees = self._first.low <= high and low <= self._first.high
        check = replace(self._first, agrees=agrees)
        size = 1.0 / variance if self._last is None else 0.0
        counts = self._count, self._exceeded, self._failed
        return Estimate(self._shares, low, high, LEVEL, *counts, size, METHOD, check)


def correlation_factor(above: npt.NDArray[np.bool_]) -> float:
    """Return the factor (1 or more) by which correlation within chains increases the variance of an estimated share.

    Source: Au & Beck 2001, eq. 29: 1 + 2 sum (1 - k/L) r_k.

    Args:
        above: True for points above the level, shape (steps L, chains).
    """
    share = float(above.mean())
    if share in (0.0, 1.0):
        return 1.0
    length = len(above)
    lags = [(1.0 - k / length) * (float(np.mean(above[:-k] & above[k:])) - share**2) for k in range(1, length)]
    return max(1.0, 1.0 + 2.0 * sum(lags) / (share * (1.0 - share)))
