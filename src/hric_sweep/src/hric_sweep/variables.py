"""Variables of a sweep and their distributions, each defined by its percentile function.

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
"""Minimum share of a distribution between its ends: less has no percentiles in double precision."""


@dataclass(frozen=True)
class Distribution(Settings):
    """Distribution of one variable.

    Attributes:
        discrete: True if the variable has a finite set of values.
    """

    discrete: ClassVar[bool] = False

    @abstractmethod
    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles.

        Args:
            u: shares below the values, each in (0, 1), shape (m,).

        Returns:
            m floats in the variable's unit, or m of the values of a discrete distribution.
        """

    @property
    def middles(self) -> FloatArray:
        """Percentile in the middle of each value of a discrete distribution, shape (count,); else empty."""
        return np.zeros(0)


@dataclass(frozen=True)
class Continuous(Distribution):
    """Distribution of real numbers, defined by one of `scipy.stats`."""

    @property
    @abstractmethod
    def frozen(self) -> Any:
        """Frozen distribution of `scipy.stats`, without truncation."""

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at the percentiles u."""
        values: list[float] = self.frozen.ppf(u).tolist()
        return values


@dataclass(frozen=True)
class Uniform(Continuous):
    """Uniform distribution from low to high."""

    low: float = number(text="lower end, in the variable's unit")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Refuse an empty interval."""
        if not self.low < self.high:
            raise refused(f"{where}high", self.high, f"a finite number above low, {self.low:g}")

    @property
    def frozen(self) -> Any:
        """Frozen uniform distribution of `scipy.stats`."""
        return stats.uniform(self.low, self.high - self.low)


@dataclass(frozen=True)
class LogUniform(Uniform):
    """Distribution whose logarithm is uniform from log(low) to log(high)."""

    low: float = number(above=0.0, text="lower end, in the variable's unit")
    high: float = number(above=0.0, text="upper end")

    @property
    def frozen(self) -> Any:
        """Frozen log-uniform distribution of `scipy.stats`."""
        return stats.loguniform(self.low, self.high)


@dataclass(frozen=True)
class Triangular(Uniform):
    """Triangular distribution: the density rises from low to mode and falls to high."""

    low: float = number(text="lower end, in the variable's unit")
    mode: float = number(text="value with the highest density")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Refuse an empty interval and a mode outside it."""
        super().check(where)
        if not self.low <= self.mode <= self.high:
            raise refused(f"{where}mode", self.mode, f"a finite number from {self.low:g} to {self.high:g}")

    @property
    def frozen(self) -> Any:
        """Frozen triangular distribution of `scipy.stats`."""
        span = self.high - self.low
        return stats.triang((self.mode - self.low) / span, self.low, span)


@dataclass(frozen=True)
class Truncated(Continuous):
    """Distribution that is truncated at its lower and upper end if these are set."""

    low: float | None = number(None, text="lower end; none: none")
    high: float | None = number(None, text="upper end; none: none")

    @property
    def shares(self) -> tuple[float, float]:
        """Share of the whole distribution below the lower and below the upper end [1]."""
        low, high = self.frozen.cdf(
            [-np.inf if self.low is None else self.low, np.inf if self.high is None else self.high]
        )
        return float(low), float(high)

    def check(self, where: str) -> None:
        """Refuse ends with (almost) nothing of the distribution between them."""
        low, high = self.shares
        if high - low < NARROWEST:
            valid = f"ends with {NARROWEST:g} of the distribution between them"
            raise refused(f"{where}low, high", (self.low, self.high), valid)

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u of the truncated distribution."""
        low, high = self.shares
        values = super().ppf(low + u * (high - low))
        return values if self.low is self.high is None else np.clip(values, self.low, self.high).tolist()


@dataclass(frozen=True)
class Normal(Truncated):
    """Normal distribution, truncated if ends are set."""

    mean: float = number(text="in the variable's unit; of the whole distribution")
    std: float = number(above=0.0, text="standard deviation of the whole distribution")

    @property
    def frozen(self) -> Any:
        """Frozen normal distribution of `scipy.stats`, without truncation."""
        return stats.norm(self.mean, self.std)


@dataclass(frozen=True)
class LogNormal(Truncated):
    """Distribution with a normal natural logarithm, truncated if ends are set."""

    median: float = number(above=0.0, text="in the variable's unit; of the whole distribution")
    log_std: float = number(above=0.0, maximum=5.0, text="standard deviation of the natural logarithm")

    @property
    def frozen(self) -> Any:
        """Frozen log-normal distribution of `scipy.stats`, without truncation."""
        return stats.lognorm(self.log_std, scale=self.median)


@dataclass(frozen=True)
class Choice(Distribution):
    """Random choice among listed values."""

    discrete: ClassVar[bool] = True
    values: tuple[Any, ...] = listing(anything(), range(1, 10_000), text="possible values")
    weights: tuple[float, ...] = numbers(default=(), above=0.0, text="relative weights of the values; empty: equal")

    def check(self, where: str) -> None:
        """Refuse weights that do not match the number of values."""
        if self.weights and len(self.weights) != len(self.values):
            raise refused(f"{where}weights", self.weights, f"{len(self.values)} values, one for each of values")

    @property
    def middles(self) -> FloatArray:
        """Percentile in the middle of each value, shape (count,)."""
        ends = self._ends()
        middles: FloatArray = ends - 0.5 * np.diff(ends, prepend=0.0)
        return middles

    def _ends(self) -> FloatArray:
        """Return the percentile at which each value ends, shape (count,)."""
        weights = np.array(self.weights or [1.0] * len(self.values))
        return np.cumsum(weights / weights.sum())

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the listed value that contains each percentile of u."""
        last = len(self.values) - 1
        return [self.values[min(int(i), last)] for i in np.searchsorted(self._ends(), u, side="right")]


@dataclass(frozen=True)
class PopulationDistribution(Distribution):
    """Distribution of a quantity in a named population."""

    people: str = choice(*populations.names(), default=REQUIRED, name="of", text="named population")
    quantity: str = choice(*populations.QUANTITIES, default=REQUIRED, text="quantity of the population")
    percentiles: tuple[float, float] = numbers(
        2,
        (1.0, 99.0),
        minimum=0.0,
        maximum=100.0,
        unit="%",
        text="people beyond these are left out: what is known of a population says little of its tails",
    )

    def check(self, where: str) -> None:
        """Refuse percentiles with nobody between them."""
        if self.percentiles[0] >= self.percentiles[1]:
            raise refused(f"{where}percentiles", self.percentiles, "the lower one first")

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u of the people between `percentiles`."""
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
"""Distribution classes, by the value of `kind`; `kind: MODULE:CLASS` is one of another package."""
DISTRIBUTION: Any = variant("kind", KINDS, text="distribution of the values")


@dataclass(frozen=True)
class Variable(Settings):
    """Varied quantity, with its keys in the experiment and its distribution."""

    paths: tuple[str, ...] = names(text="dotted paths of the keys of the experiment that get its value, all the same")
    unit: str = text("", text="unit of the values; set automatically for a population's quantity")
    text: str = text("", text="description, for tables and figures")
    distribution: Distribution = DISTRIBUTION

    def check(self, where: str) -> None:
        """Set the unit of a population's quantity; refuse a different one."""
        if not isinstance(self.distribution, PopulationDistribution):
            return
        unit = populations.QUANTITIES[self.distribution.quantity]
        if self.unit not in ("", unit):
            raise refused(f"{where}unit", self.unit, f"{unit}, that of the population's {self.distribution.quantity}")
        object.__setattr__(self, "unit", unit)
