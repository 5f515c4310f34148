"""Search for the worst case within the distributions: Optuna's tree-structured Parzen estimator.

It maximises the objective over the normal scores of the variables. A tail at each end of each distribution is excluded,
so the worst case lies within the remaining percentiles. The points of a batch are proposed together, before any of its
results is known.

Source: Bergstra et al., Algorithms for hyper-parameter optimization, NIPS 24, 2011; Optuna is MIT-licensed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scipy.special import ndtr, ndtri

from hric_core.errors import HricError
from hric_core.parameters import Settings, number, refused, whole
from hric_sweep.samplers.sampler import Point, SamplerResult, in_order
from hric_sweep.space import Space

BATCH = 5
"""Number of points per batch (project default: with larger batches the search uses fewer results, with smaller ones
processors are idle)."""
TAIL = 0.001
"""Share of each variable's distribution that is excluded at each end (project default)."""
STARTUP = 20
"""Number of random points before the search (project default)."""


@dataclass(frozen=True)
class Tpe(Settings):
    """Search for the worst case: settings of Optuna's TPE sampler, which maximises the objective."""

    batch: int = whole(BATCH, minimum=1, maximum=1000, text="number of runs per batch")
    tail: float = number(
        TAIL, minimum=1e-6, maximum=0.25, unit="1", text="share of each distribution that is excluded at each end"
    )

    def sampler(self, space: Space, runs: int | None, seed: int) -> "TpeSampler":
        """Return the sampler. Raises ParameterError: `runs` is missing; HricError: Optuna is not installed."""
        if runs is None or runs < 1:
            raise refused("sweep.runs", runs, "a whole number of 1 or more")
        return TpeSampler(space, runs, self.batch, self.tail, seed)


class TpeSampler:
    """Sampler that searches for the largest objective with Optuna.

    Args:
        space: space of the variables.
        runs: maximum number of runs.
        batch: runs per batch.
        tail: share of each distribution that is excluded at each end, see TAIL.
        seed: seed of all random draws.

    Raises:
        HricError: Optuna is not installed.
    """

    def __init__(self, space: Space, runs: int, batch: int, tail: float, seed: int) -> None:
        optuna = _optuna()
        self.total = runs
        self._batch, self._count = batch, 0
        self._optuna, self._open = optuna, list[Any]()
        self._middles = {name: variable.distribution.middles for name, variable in space.variables.items()}
        end = float(ndtri(1.0 - tail))
        continuous = optuna.distributions.FloatDistribution(-end, end)
        self._axes = {
            name: optuna.distributions.CategoricalDistribution(range(len(middles))) if middles.size else continuous
            for name, middles in self._middles.items()
        }
        search = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True, n_startup_trials=STARTUP)
        self._study = optuna.create_study(direction="maximize", sampler=search)

    def ask(self) -> Sequence[Point]:
        """Return the next batch of points that Optuna proposes; empty after the last run."""
        size = min(self._batch, self.total - self._count)
        self._open = [self._study.ask(self._axes) for _ in range(size)]
        return [Point(tuple(self._shares(trial))) for trial in self._open]

    def _shares(self, trial: Any) -> list[float]:
        """Return the cumulative probabilities of the proposed values; for a discrete value, the middle of its share."""
        return [
            float(middles[trial.params[name]] if middles.size else ndtr(trial.params[name]))
            for name, middles in self._middles.items()
        ]

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Pass the results of the batch to Optuna. Raises HricError: a run that did not fail has no objective."""
        in_order(results, self._count, len(self._open))
        if any(result.objective is None and result.exceeded is not None for result in results):
            raise HricError(
                "results have no objective, which the sampler tpe needs; valid: a sweep file with sweep.objective"
            )
        failed = self._optuna.trial.TrialState.FAIL
        for trial, result in zip(self._open, results, strict=True):
            if result.objective is None:
                self._study.tell(trial, state=failed)
            else:
                self._study.tell(trial, result.objective)
        self._count += len(results)
        self._open = []

    def estimate(self) -> None:
        """Return None: the search for a worst case gives no probability."""
        return None


def _optuna() -> Any:
    try:
        import optuna  # imported here: only this sampler needs it, and its installation is optional
    except ImportError:
        raise HricError("the sampler tpe needs Optuna, which is not installed:  scripts/setup --with search") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna
