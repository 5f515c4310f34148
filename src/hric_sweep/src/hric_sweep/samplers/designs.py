"""Samplers whose points are all known at the start: grid, list, random, sobol, lhs, saltelli."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.stats import qmc

from hric_core.geometry import FloatArray
from hric_core.parameters import Settings, refused
from hric_sweep.samplers.sampler import Estimate, Point, SamplerResult, in_order
from hric_sweep.space import EDGE, Space
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson


class Design:
    """Sampler with a fixed set of points, returned in one batch.

    Args:
        u: points of the unit cube, shape (m, n).
        drawn: True if the points are drawn from the distributions, so that counts estimate a probability.
    """

    def __init__(self, u: FloatArray, drawn: bool) -> None:
        self.total = len(u)
        self._u, self._drawn, self._drawn_all = np.clip(u, EDGE, 1.0 - EDGE), drawn, False
        self._results: Sequence[SamplerResult] = ()

    def ask(self) -> Sequence[Point]:
        """Return all points at the first call, an empty list afterwards."""
        if self._drawn_all:
            return []
        self._drawn_all = True
        return [Point(tuple(row)) for row in self._u.tolist()]

    def tell(self, results: Sequence[SamplerResult]) -> None:
        """Store the results of all runs."""
        in_order(results, 0, self.total)
        self._results = results

    def estimate(self) -> Estimate | None:
        """Return the Clopper-Pearson estimate; None: points not drawn from the distributions, or no results yet."""
        counted = [result.exceeded for result in self._results]
        if not self._drawn or all(exceeded is None for exceeded in counted):
            return None
        exceeded, failed, runs = counted.count(True), counted.count(None), len(counted)
        low, high = clopper_pearson(exceeded, runs, LEVEL).low, clopper_pearson(exceeded + failed, runs, LEVEL).high
        share = exceeded / (runs - failed)
        return Estimate(share, low, high, LEVEL, runs, exceeded, failed, float(exceeded), "Clopper-Pearson")


@dataclass(frozen=True)
class Grid(Settings):
    """Full factorial design: every combination of the values of all variables, which must be of kind choice."""

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: a variable is not discrete, or `runs` is not the grid's size."""
        middles = _middles(space, "grid")
        _all_of(runs, int(np.prod([len(middle) for middle in middles])), "the whole grid")
        axes = np.meshgrid(*middles, indexing="ij")
        return Design(np.stack([axis.ravel() for axis in axes], axis=1), drawn=False)


@dataclass(frozen=True)
class Listed(Settings):
    """List of points: run i uses the i-th value of each variable; all are of kind choice, with equally many values."""

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: a variable is not discrete, or its number of values differs."""
        middles = _middles(space, "list")
        counts = [len(middle) for middle in middles]
        if len(set(counts)) > 1:
            sizes = ", ".join(f"{name} {count}" for name, count in zip(space.names, counts, strict=True))
            raise refused("sweep.vary", sizes, "the same number of values for each variable, with the sampler list")
        _all_of(runs, counts[0], "one for each value")
        return Design(np.stack(middles, axis=1), drawn=False)


@dataclass(frozen=True)
class Random(Settings):
    """Independent draws from the distributions."""

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: `runs` is missing."""
        return Design(np.random.default_rng(seed).random((_required(runs), len(space.names))), drawn=True)


@dataclass(frozen=True)
class Sobol(Settings):
    """Scrambled Sobol sequence: random points that fill the space evenly."""

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: `runs` is missing or no power of two."""
        count = _required(runs)
        if count & (count - 1):
            raise refused(
                "sweep.runs", count, f"a power of two with the sampler sobol; the next one is {_above(count)}"
            )
        return Design(_sobol(len(space.names), count, seed), drawn=True)


@dataclass(frozen=True)
class Lhs(Settings):
    """Latin hypercube: each variable has as many equally likely slices as there are runs, one run in each slice."""

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: `runs` is missing."""
        cube = qmc.LatinHypercube(len(space.names), rng=np.random.default_rng(seed))
        return Design(cube.random(_required(runs)), drawn=True)


@dataclass(frozen=True)
class Saltelli(Settings):
    """Saltelli's design for first-order and total indices (Saltelli et al., Comput. Phys. Commun. 181:259, 2010).

    With n variables and r rows it has r (n + 2) runs: a matrix A, a matrix B, and for each variable the matrix A with
    the column of this variable from B.
    """

    extra: ClassVar[int] = 2

    def sampler(self, space: Space, runs: int | None, seed: int) -> Design:
        """Return the design. Raises ParameterError: correlated variables, or `runs` is not n + 2 times a power of 2."""
        if not space.independent:
            raise refused(
                "sweep.sampler.kind",
                "saltelli",
                "variables without correlation, for which alone the indices are defined",
            )
        count, n = _required(runs), len(space.names)
        rows, rest = divmod(count, n + self.extra)
        if rest or rows < 2 or rows & (rows - 1):
            fits = _above(max(2, -(-count // (n + self.extra)))) * (n + self.extra)
            raise refused("sweep.runs", count, f"{n + self.extra} times a power of two; the next one is {fits}")
        base = _sobol(2 * n, rows, seed)
        a, b = base[:, :n], base[:, n:]
        mixed = [np.where(np.arange(n) == i, b, a) for i in range(n)]
        return Design(np.concatenate([a, b, *mixed]), drawn=False)


def _sobol(dimensions: int, count: int, seed: int) -> FloatArray:
    sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    points: FloatArray = sequence.random_base2(count.bit_length() - 1)
    return points


def _above(count: int) -> int:
    """Return the smallest power of two that is not below `count`."""
    return 1 << (count - 1).bit_length()


def _middles(space: Space, kind: str) -> list[FloatArray]:
    middles = [variable.distribution.middles for variable in space.variables.values()]
    without = [name for name, middle in zip(space.names, middles, strict=True) if not middle.size]
    if without:
        raise refused("sweep.vary", ", ".join(without), f"distributions of kind choice with the sampler {kind}")
    return middles


def _all_of(runs: int | None, total: int, what: str) -> None:
    if runs not in (None, total):
        raise refused("sweep.runs", runs, f"{total}, {what}; or leave it out")


def _required(runs: int | None) -> int:
    if runs is None or runs < 1:
        raise refused("sweep.runs", runs, "a whole number of 1 or more")
    return runs
