"""What all samplers have in common: points in batches, results of a whole batch back, and perhaps an estimate.

`make` makes one. It gives a batch of points, takes the results of all of them in order of index, and gives the next
batch, until there is none; the methods are named as in libraries for search. The size of a batch depends on the
settings alone, and nothing on which run ended first; nothing is drawn but from the seed. So a sampler that was
interrupted is made again, given the same results again, and goes on to the last bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from hric_core.errors import HricError


class Point(NamedTuple):
    """A place in the unit cube.

    Attributes:
        u: coordinates in the order of the space's names, each in (0, 1).
        weight: how much likelier it is by the distributions than by the sampler that drew it; 1 where it was drawn
            from the distributions.
    """

    u: tuple[float, ...]
    weight: float = 1.0


@dataclass(frozen=True)
class Told:
    """What a run gave.

    Attributes:
        index: of the run, from 0, over all batches.
        exceeded: whether the output exceeded the limit; None: the run failed.
        objective: what is maximised; None: the run failed, or nothing is.
        margin: output less limit, above 0 where it exceeded, in the output's unit (the negative of it where what counts
            is to be below); None: the run failed, or nothing is counted.
    """

    index: int
    exceeded: bool | None
    objective: float | None = None
    margin: float | None = None


@dataclass(frozen=True)
class CrossCheck:
    """The runs drawn from the distributions themselves, by which a weighted estimate is checked.

    Attributes:
        runs, exceeded: how many there were, and how many of them exceeded.
        low, high: their own interval of the probability (Clopper-Pearson).
        agrees: whether it and the interval of the estimate have a value in common.
    """

    runs: int
    exceeded: int
    low: float
    high: float
    agrees: bool


@dataclass(frozen=True)
class Estimate:
    """A probability of exceeding the limit, given the distributions.

    Attributes:
        probability: best estimate [1].
        low, high: interval of `level`; runs that failed count as not exceeding in the first, as exceeding in the last.
        level: share of sweeps whose interval has the true probability in it.
        runs: how many it is from.
        exceeded: how many of them exceeded.
        failed: how many of them failed.
        ess: effective number of those that exceeded: so many equal weights would scatter as much.
        method: how the interval is made.
        check: None where all runs are drawn from the distributions.
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
    """Where the next runs are.

    Attributes:
        total: how many runs at most.
    """

    total: int

    def ask(self) -> Sequence[Point]:
        """The next batch; empty: no more. Call it when the results of the batch before were given."""

    def tell(self, results: Sequence[Told]) -> None:
        """Give the results of the batch, all of them, in order of index."""

    def estimate(self) -> Estimate | None:
        """From all results given so far; None: this sampler has none, or nothing is counted, or nothing was given."""


def in_order(results: Sequence[Told], first: int, count: int) -> None:
    """Check that results are those of a whole batch.

    Args:
        results: of the batch.
        first: index of the batch's first run.
        count: runs of the batch.

    Raises:
        HricError: too few, too many, or in another order.
    """
    if [result.index for result in results] != list(range(first, first + count)):
        raise HricError(
            f"results of {len(results)} runs do not fit the batch; valid: those of {first} to {first + count - 1}, "
            "in order of index"
        )
