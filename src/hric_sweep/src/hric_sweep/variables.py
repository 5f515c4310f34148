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
import numpy.typing as npt
from scipy import stats

from hric_core.node import REQUIRED
from hric_core.parameters import Settings, anything, choice, listing, names, number, numbers, refused, text, variant
from hric_sweep import populations

FloatArray = npt.NDArray[np.float64]
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
class Uniform(Distribution):
    """Uniform distribution from low to high."""

    low: float = number(text="lower end, in the variable's unit")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Refuse an empty interval."""
        _ordered(where, low=self.low, high=self.high)

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u: linear interpolation between the ends."""
        return _floats(self.low + u * (self.high - self.low))


@dataclass(frozen=True)
class LogUniform(Distribution):
    """Distribution whose logarithm is uniform from log(low) to log(high)."""

    low: float = number(above=0.0, text="lower end, in the variable's unit")
    high: float = number(above=0.0, text="upper end")

    def check(self, where: str) -> None:
        """Refuse an empty interval."""
        _ordered(where, low=self.low, high=self.high)

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u: geometric interpolation between the ends."""
        return _floats(self.low * np.power(self.high / self.low, u))


@dataclass(frozen=True)
class Triangular(Distribution):
    """Triangular distribution: the density rises from low to mode and falls to high."""

    low: float = number(text="lower end, in the variable's unit")
    mode: float = number(text="where the density is highest")
    high: float = number(text="upper end")

    def check(self, where: str) -> None:
        """Refuse an empty interval and a mode outside it."""
        _ordered(where, low=self.low, high=self.high)
        if not self.low <= self.mode <= self.high:
            raise refused(f"{where}mode", self.mode, f"a finite number from {self.low:g} to {self.high:g}")

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u, from the inverse of the two quadratic branches."""
        span, rise, fall = self.high - self.low, self.mode - self.low, self.high - self.mode
        below = self.low + np.sqrt(u * span * rise)
        above = self.high - np.sqrt((1.0 - u) * span * fall)
        return _floats(np.where(u * span < rise, below, above))


@dataclass(frozen=True)
class Truncated(Distribution):
    """Distribution of scipy, truncated at its lower and upper end if these are set."""

    low: float | None = number(None, text="lower end; none: none")
    high: float | None = number(None, text="upper end; none: none")

    @property
    @abstractmethod
    def whole(self) -> Any:
        """Distribution without its ends, a frozen one of `scipy.stats`."""

    @property
    def shares(self) -> tuple[float, float]:
        """Share of the whole distribution below the lower and below the upper end [1]."""
        ends = -np.inf if self.low is None else self.low, np.inf if self.high is None else self.high
        low, high = self.whole.cdf(ends).tolist()
        return low, high

    def check(self, where: str) -> None:
        """Refuse ends with (almost) nothing of the distribution between them."""
        low, high = self.shares
        if high - low < NARROWEST:
            valid = f"ends with {NARROWEST:g} of the distribution between them"
            raise refused(f"{where}low, high", (self.low, self.high), valid)

    def ppf(self, u: FloatArray) -> Sequence[Any]:
        """Return the values at percentiles u of the truncated distribution."""
        low, high = self.shares
        values = self.whole.ppf(low + u * (high - low))
        return _floats(values if self.low is self.high is None else np.clip(values, self.low, self.high))


@dataclass(frozen=True)
class Normal(Truncated):
    """Normal distribution, truncated if ends are set."""

    mean: float = number(text="in the variable's unit; of the whole distribution")
    std: float = number(above=0.0, text="standard deviation of the whole distribution")

    @property
    def whole(self) -> Any:
        """Normal distribution without its ends."""
        return stats.norm(self.mean, self.std)


@dataclass(frozen=True)
class LogNormal(Truncated):
    """Distribution with a normal natural logarithm, truncated if ends are set."""

    median: float = number(above=0.0, text="in the variable's unit; of the whole distribution")
    log_std: float = number(above=0.0, maximum=5.0, text="standard deviation of the natural logarithm")

    @property
    def whole(self) -> Any:
        """Log-normal distribution without its ends."""
        return stats.lognorm(self.log_std, scale=self.median)


@dataclass(frozen=True)
class Choice(Distribution):
    """Random choice among listed values."""

    discrete: ClassVar[bool] = True
    values: tuple[Any, ...] = listing(anything(), range(1, 10_000), text="what it may be")
    weights: tuple[float, ...] = numbers(default=(), above=0.0, text="how likely, relative to each other; empty: alike")

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
class Population(Distribution):
    """Distribution of a quantity in a named population."""

    people: str = choice(*populations.names(), default=REQUIRED, name="of", text="whose: a named population")
    quantity: str = choice(*populations.QUANTITIES, default=REQUIRED, text="which")
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
        return _floats(populations.quantity(self.people, self.quantity).ppf((low + u * (high - low)) / 100.0))


KINDS: dict[str, type[Settings]] = {
    "uniform": Uniform,
    "log_uniform": LogUniform,
    "triangular": Triangular,
    "normal": Normal,
    "log_normal": LogNormal,
    "choice": Choice,
    "population": Population,
}
"""Distribution classes, by the value of `kind`."""
DISTRIBUTION: Any = variant("kind", KINDS, text="how likely which values are")


@dataclass(frozen=True)
class Variable(Settings):
    """Varied quantity, with its keys in the experiment and its distribution."""

    paths: tuple[str, ...] = names(text="dotted paths of the keys of the experiment that get its value, all the same")
    unit: str = text("", text="of its values; of a population's quantity it is known")
    text: str = text("", text="what it is, for tables and figures")
    distribution: Distribution = DISTRIBUTION

    def check(self, where: str) -> None:
        """Set the unit of a population's quantity; refuse a different one."""
        if not isinstance(self.distribution, Population):
            return
        unit = populations.QUANTITIES[self.distribution.quantity]
        if self.unit not in ("", unit):
            raise refused(f"{where}unit", self.unit, f"{unit}, that of the population's {self.distribution.quantity}")
        object.__setattr__(self, "unit", unit)


def _floats(values: FloatArray) -> list[float]:
    listed: list[float] = values.tolist()
    return listed


def _ordered(where: str, low: float, high: float) -> None:
    if not low < high:
        raise refused(f"{where}high", high, f"a finite number above low, {low:g}")
