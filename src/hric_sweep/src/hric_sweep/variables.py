"""Variables of a sweep and their distributions, each defined by its inverse distribution function.

    vary:
      speed: {paths: [human.walk.speed], unit: m/s, distribution: {kind: normal, mean: 1.2, std: 0.2, low: 0.5}}
      mass: {paths: [human.subject.mass], unit: kg, distribution: {kind: population, of: adult_male, quantity: mass}}

A truncated distribution is the conditional one between its ends; values are not clipped to the ends.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from hric_core.geometry import FloatArray
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, anything, choice, listing, names, number, numbers, refused, text, variant
from hric_sweep import populations
from hric_sweep.registry import Kinds

NARROWEST = 1e-9
"""Minimum share of a distribution between its truncation ends [1], so that double precision suffices."""


@dataclass(frozen=True)
class Distribution(Settings):
    """Distribution of one variable.

    Attributes:
        discrete: True if the variable has a finite set of values.
    """

    discrete: ClassVar[bool] = False

    @abstractmethod
    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the quantiles at given probabilities.

        Args:
            u: cumulative probabilities, each in (0, 1), shape (m,).

        Returns:
            m floats in the variable's unit, or m of the values of a discrete distribution.
        """

    @property
    def middles(self) -> FloatArray:
        """Cumulative probability at the middle of each discrete value's share, shape (count,); empty if continuous."""
        return np.zeros(0)


@dataclass(frozen=True)
class Continuous(Distribution):
    """Continuous distribution, based on one of `scipy.stats`."""

    @property
    @abstractmethod
    def frozen(self) -> Any:
        """Distribution as an object of `scipy.stats`, without truncation."""

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the quantiles at cumulative probabilities u, shape (m,)."""
        values: list[float] = self.frozen.ppf(u).tolist()
        return values


@dataclass(frozen=True)
class Uniform(Continuous):
    """Uniform distribution from low to high."""

    low: float = number(text="lower end, in the variable's unit")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Raise an error for an empty interval."""
        if not self.low < self.high:
            raise refused(f"{where}high", self.high, f"a finite number above low ({self.low:g})")

    @property
    def frozen(self) -> Any:
        """Uniform distribution as an object of `scipy.stats`."""
        return stats.uniform(self.low, self.high - self.low)


@dataclass(frozen=True)
class LogUniform(Uniform):
    """Distribution whose logarithm is uniform from log(low) to log(high)."""

    low: float = number(above=0.0, text="lower end, in the variable's unit")
    high: float = number(above=0.0, text="upper end")

    @property
    def frozen(self) -> Any:
        """Log-uniform distribution as an object of `scipy.stats`."""
        return stats.loguniform(self.low, self.high)


@dataclass(frozen=True)
class Triangular(Uniform):
    """Triangular distribution: the density rises from low to mode and falls to high."""

    low: float = number(text="lower end, in the variable's unit")
    mode: float = number(text="value with the highest density")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Raise an error for an empty interval, or a mode outside it."""
        super().check(where)
        if not self.low <= self.mode <= self.high:
            raise refused(f"{where}mode", self.mode, f"a finite number from {self.low:g} to {self.high:g}")

    @property
    def frozen(self) -> Any:
        """Triangular distribution as an object of `scipy.stats`."""
        span = self.high - self.low
        return stats.triang((self.mode - self.low) / span, self.low, span)


@dataclass(frozen=True)
class Truncated(Continuous):
    """Continuous distribution that is truncated at `low` and at `high` if these are set."""

    low: float | None = number(None, text="lower end; none: not truncated")
    high: float | None = number(None, text="upper end; none: not truncated")

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of the untruncated distribution below `low` and below `high` [1]."""
        low, high = self.frozen.cdf(
            [-np.inf if self.low is None else self.low, np.inf if self.high is None else self.high]
        )
        return float(low), float(high)

    def check(self, where: str) -> None:
        """Raise an error for ends between which (almost) nothing of the distribution lies."""
        low, high = self.shares
        if high - low < NARROWEST:
            valid = f"ends with {NARROWEST:g} of the distribution between them"
            raise refused(f"{where}low, high", (self.low, self.high), valid)

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the quantiles of the truncated distribution at cumulative probabilities u, shape (m,)."""
        low, high = self.shares
        values = super().ppf(low + u * (high - low))
        return values if self.low is self.high is None else np.clip(values, self.low, self.high).tolist()


@dataclass(frozen=True)
class Normal(Truncated):
    """Normal distribution, truncated if ends are set."""

    mean: float = number(text="mean of the untruncated distribution, in the variable's unit")
    std: float = number(above=0.0, text="standard deviation of the untruncated distribution")

    @property
    def frozen(self) -> Any:
        """Normal distribution as an object of `scipy.stats`, without truncation."""
        return stats.norm(self.mean, self.std)


@dataclass(frozen=True)
class LogNormal(Truncated):
    """Distribution with a normal natural logarithm, truncated if ends are set."""

    median: float = number(above=0.0, text="median of the untruncated distribution, in the variable's unit")
    log_std: float = number(above=0.0, maximum=5.0, text="standard deviation of the natural logarithm")

    @property
    def frozen(self) -> Any:
        """Log-normal distribution as an object of `scipy.stats`, without truncation."""
        return stats.lognorm(self.log_std, scale=self.median)


@dataclass(frozen=True)
class Choice(Distribution):
    """Random choice among listed values."""

    discrete: ClassVar[bool] = True
    values: tuple[Any, ...] = listing(anything(), range(1, 10_000), text="possible values")
    weights: tuple[float, ...] = numbers(default=(), above=0.0, text="relative weights of the values; empty: equal")

    def check(self, where: str) -> None:
        """Raise an error for a number of weights that differs from the number of values."""
        if self.weights and len(self.weights) != len(self.values):
            raise refused(f"{where}weights", self.weights, f"{len(self.values)} values, one for each of values")

    @property
    def middles(self) -> FloatArray:
        """Cumulative probability at the middle of each value's share, shape (count,)."""
        ends = self._ends()
        middles: FloatArray = ends - 0.5 * np.diff(ends, prepend=0.0)
        return middles

    def _ends(self) -> FloatArray:
        """Return the cumulative probability at the upper end of each value's share, shape (count,)."""
        weights = np.array(self.weights or [1.0] * len(self.values))
        return np.cumsum(weights / weights.sum())

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the listed values at cumulative probabilities u, shape (m,)."""
        last = len(self.values) - 1
        return [self.values[min(int(i), last)] for i in np.searchsorted(self._ends(), u, side="right")]


@dataclass(frozen=True)
class PopulationDistribution(Distribution):
    """Distribution of a body quantity (e.g. mass) in a named population, between two percentiles."""

    people: str = choice(*populations.names(), default=REQUIRED, name="of", text="named population")
    quantity: str = choice(*populations.QUANTITIES, default=REQUIRED, text="quantity of the population")
    percentiles: tuple[float, float] = numbers(
        2,
        (1.0, 99.0),
        minimum=0.0,
        maximum=100.0,
        unit="%",
        text="percentiles beyond which people are left out, as little is known of the tails of a population",
    )

    def check(self, where: str) -> None:
        """Raise an error unless the first percentile is below the second."""
        if self.percentiles[0] >= self.percentiles[1]:
            raise refused(f"{where}percentiles", self.percentiles, "the lower one first")

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the quantiles, among the people between `percentiles`, at cumulative probabilities u, shape (m,)."""
        low, high = self.percentiles
        values: list[float] = (
            populations.quantity(self.people, self.quantity).ppf((low + u * (high - low)) / 100.0).tolist()
        )
        return values


KINDS = Kinds(
    {
        "uniform": Uniform,
        "log_uniform": LogUniform,
        "triangular": Triangular,
        "normal": Normal,
        "log_normal": LogNormal,
        "choice": Choice,
        "population": PopulationDistribution,
    }
)
"""Distribution classes, by the value of `kind`; `kind: MODULE:CLASS` names a class of another package."""
DISTRIBUTION: Any = variant("kind", KINDS, text="distribution of the values")


@dataclass(frozen=True)
class Variable(Settings):
    """Variable of a sweep: the experiment keys that it sets, and the distribution of its values."""

    paths: tuple[str, ...] = names(text="dotted paths of the experiment keys that are set to the variable's value")
    unit: str = text("", text="unit of the values; set automatically for the quantity of a population")
    text: str = text("", text="description, for tables and figures")
    distribution: Distribution = DISTRIBUTION

    def check(self, where: str) -> None:
        """Set the unit of the quantity of a population; raise an error for a different unit."""
        if not isinstance(self.distribution, PopulationDistribution):
            return
        unit = populations.QUANTITIES[self.distribution.quantity]
        if self.unit not in ("", unit):
            raise refused(f"{where}unit", self.unit, f"{unit}, that of the population's {self.distribution.quantity}")
        object.__setattr__(self, "unit", unit)
