"""Interface of all samplers: they return points in batches, receive the results, and may estimate a probability.

A sampler returns a batch of points, receives the results of all of them in order of index, and returns the next batch
until none is left. The size of a batch depends on the settings alone, nothing depends on the order in
which runs finish, and all random draws use the seed. A sampler is resumed by creating it again and passing the same
results: it then continues bit for bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from hric_core.errors import HricError


class Point(NamedTuple):
    """Point of the unit cube, which determines the values of all variables for one run.

    Attributes:
        u: coordinates, each in (0, 1), in the order of the variables.
        weight: likelihood ratio: density of the variables' distributions over the density of the sampler; 1 if the
            point was drawn from the distributions.
    """

    u: tuple[float, ...]
    weight: float = 1.0


@dataclass(frozen=True)
class SamplerResult:
    """Result of one run, as a sampler receives it.

    Attributes:
        index: index of the run, from 0, over all batches.
        exceeded: True if the output exceeded the limit; None: the run failed.
        objective: value to be maximised; None: the run failed, or there is no objective.
        margin: output minus limit (limit minus output for a lower limit) in the output's unit, above 0 if exceeded;
            None: the run failed, or the sweep has no limit.
    """

    index: int
    exceeded: bool | None
    objective: float | None = None
    margin: float | None = None


@dataclass(frozen=True)
class CrossCheck:
    """Check of a weighted estimate with the runs that were drawn from the distributions themselves.

    Attributes:
        runs, exceeded: number of these runs, and number of them that exceeded the limit.
        low, high: interval of the probability from these runs alone (Clopper-Pearson).
        agrees: True if this interval overlaps the interval of the estimate.
    """

    runs: int
    exceeded: int
    low: float
    high: float
    agrees: bool


@dataclass(frozen=True)
class Estimate:
    """Estimate of the probability that a run exceeds the limit, given the variables' distributions.

    Attributes:
        probability: best estimate [1].
        low, high: confidence interval; `low` counts failed runs as not exceeding, `high` as exceeding.
        level: confidence level of the interval [1].
        runs: number of runs in the estimate.
        exceeded: number of runs that exceeded.
        failed: number of runs that failed.
        ess: effective number of exceeding runs: so many runs of equal weight would have the same variance.
        method: name of the method that gives the interval.
        check: cross-check with unweighted runs; None if all runs are drawn from the distributions.
    """

    probability: float
    low: float
    high: float
    level: float
    runs: int
    exceeded: int
    failed: int
    ess: float
    method: str
    check: CrossCheck | None = None


class Sampler(Protocol):
    """Sampler: source of the points of a sweep.

    Attributes:
        total: maximum number of runs.
    """

    total: int

    def ask(self) -> Sequence[Point]:
        """Return the next batch of points; empty: no more runs. Requires the results of the previous batch."""

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Receive the results of all runs of the last batch, in order of index."""

    def estimate(self) -> Estimate | None:
        """Return the estimated exceedance probability from all results so far; None: there is no estimate (yet)."""


def in_order(results: Sequence[SamplerResult], first: int, count: int) -> None:
    """Check that the results are those of a complete batch.

    Args:
        results: results of the batch.
        first: index of the first run of the batch.
        count: number of runs in the batch.

    Raises:
        HricError: results are missing, in excess or in a different order.
    """
    if [result.index for result in results] != list(range(first, first + count)):
        raise HricError(
            f"results of {len(results)} runs do not fit the batch; valid: those of {first} to {first + count - 1}, "
            "in order of index"
        )
