"""Interface of all samplers: points in batches, results of a complete batch in return, and an optional estimate.

`make` creates a sampler. It returns a batch of points, receives the results of all of them in order of index, and
returns the next batch until none is left; the methods have the names that search libraries use. The size of a batch
depends on the settings alone, nothing depends on the order in which runs finish, and all random draws use the seed. A
sampler is resumed by creating it again and passing the same results: it then continues bit for bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from hric_core.errors import HricError


class Point(NamedTuple):
    """Point of the unit cube.

    Attributes:
        u: coordinates in the order of the space's names, each in (0, 1).
        weight: likelihood ratio of the point: density of the distributions over the density of the sampler; 1 if it was
            drawn from the distributions.
    """

    u: tuple[float, ...]
    weight: float = 1.0


@dataclass(frozen=True)
class SamplerResult:
    """Result of one run for the sampler.

    Attributes:
        index: index of the run, from 0, over all batches.
        exceeded: True if the output exceeded the limit; None: the run failed.
        objective: value to be maximised; None: the run failed, or there is no objective.
        margin: output minus limit (limit minus output for a lower limit), above 0 if it exceeded, in the output's unit;
            None: the run failed, or there is no exceedance.
    """

    index: int
    exceeded: bool | None
    objective: float | None = None
    margin: float | None = None


@dataclass(frozen=True)
class CrossCheck:
    """Check of a weighted estimate with the runs that were drawn from the distributions themselves.

    Attributes:
        runs, exceeded: number of these runs, and number of those that exceeded.
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
    """Estimate of the probability to exceed the limit, for the distributions of the sweep.

    Attributes:
        probability: best estimate [1].
        low, high: interval at `level`; for `low`, failed runs count as not exceeding, for `high` as exceeding.
        level: share of sweeps whose interval contains the true probability.
        runs: number of runs in the estimate.
        exceeded: number of runs that exceeded.
        failed: number of runs that failed.
        ess: effective sample size of the runs that exceeded: as many equal weights would have the same variance.
        method: name of the method that yields the interval.
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
    """Source of the points of a sweep.

    Attributes:
        total: maximum number of runs.
    """

    total: int

    def ask(self) -> Sequence[Point]:
        """Return the next batch; empty: no more runs. Call it with all results of the previous batch received."""

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Receive the results of the complete batch, in order of index."""

    def estimate(self) -> Estimate | None:
        """Return the estimate from all results so far; None: there is no exceedance, no result or no method for it."""


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
