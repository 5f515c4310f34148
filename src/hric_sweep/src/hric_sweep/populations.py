"""Named populations of people: distributions of mass, height, muscle strength and reaction time.

config/populations.yaml defines, for each quantity, the shape of its distribution and two percentiles with their
source. If a subject of `hric_human` represents a percentile, the value comes from that subject's file.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from scipy import stats

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, listing, mapping, number, package_yaml, refused, section, text
from hric_human.body import subject

QUANTITIES = {"mass": "kg", "height": "m", "strength": "1", "reaction_time": "s"}
"""Quantities with their units. strength is a factor on the strength of all muscles of a subject of that sex and mass,
like the parameter `human.muscles.strength`."""
MARKS = ("confirmed", "unconfirmed")
"""Reliability of a value: confirmed in the public source that is named, or unconfirmed (from memory)."""
HALVINGS = 60
"""Number of bisection steps that invert the distribution function of a mixture: enough for double precision."""


class QuantityDistribution(Protocol):
    """Distribution of a quantity in a population."""

    def ppf(self, u: FloatArray) -> FloatArray:
        """Return the quantiles at probabilities `u` in (0, 1), shape (m,), in the quantity's unit."""

    def cdf(self, values: FloatArray) -> FloatArray:
        """Return the share of the people below each value, shape (m,)."""


@dataclass(frozen=True)
class Anchor(Settings):
    """Percentile of a quantity, given by its value or by a subject who has this value."""

    percentile: float = number(above=0.0, maximum=99.999, unit="%", text="share of the people with a smaller value")
    value: float | None = number(None, above=0.0, text="value of the quantity at this percentile, in its unit")
    subject: str = text(
        "", text="subject who has the value: name of a file in config/subjects of hric_human, without its ending"
    )
    mark: str = choice(*MARKS, default=REQUIRED, text="reliability of the value for this percentile")
    source: str = text(empty=False, text="source of the value")

    def check(self, where: str) -> None:
        """Raise an error unless exactly one of value and subject is set."""
        if (self.value is None) is not bool(self.subject):
            raise refused(f"{where}value", self.value, "either value or subject")

    def of_quantity(self, name: str) -> float:
        """Return the value at this percentile; `name`: quantity, one of QUANTITIES."""
        return self.value if self.value is not None else float(getattr(_subject(self.subject), name))


@dataclass(frozen=True)
class Quantity(Settings):
    """Distribution of a quantity in one group of people."""

    shape: str = choice("normal", "log_normal", text="shape of the distribution")
    anchors: tuple[Anchor, ...] = listing(section(Anchor), 2, text="two percentiles that define the distribution")

    def spread(self, name: str) -> QuantityDistribution:
        """Return the normal or log-normal distribution through the two anchors; `name`: quantity, one of QUANTITIES."""
        values = np.array([anchor.of_quantity(name) for anchor in self.anchors])
        scores = stats.norm.ppf([anchor.percentile / 100.0 for anchor in self.anchors])
        log = self.shape == "log_normal"
        ends = np.log(values) if log else values
        std = (ends[1] - ends[0]) / (scores[1] - scores[0])
        mean = ends[0] - std * scores[0]
        frozen: QuantityDistribution = stats.lognorm(std, scale=np.exp(mean)) if log else stats.norm(mean, std)
        return frozen


@dataclass(frozen=True)
class People(Settings):
    """Population, defined by distributions of its quantities or as a mixture of other populations."""

    text: str = text(empty=False, text="description of the people")
    quantities: Mapping[str, Quantity] = mapping(section(Quantity), default={}, text="quantities by name")
    mixed: Mapping[str, float] = mapping(number(above=0.0), default={}, text="share of each population in the mixture")

    def check(self, where: str) -> None:
        """Raise an error if a population lacks a quantity, or has both quantities and a mixture."""
        lacking = [name for name in QUANTITIES if name not in self.quantities and not self.mixed]
        if lacking or (self.mixed and self.quantities):
            raise refused(f"{where}quantities", ", ".join(self.quantities), f"{', '.join(QUANTITIES)}, or mixed")


class Mixture:
    """Mixture of the distributions of several groups of people.

    Args:
        parts: share of each group with its distribution; the shares are normalised to a sum of 1.
    """

    def __init__(self, parts: list[tuple[float, QuantityDistribution]]) -> None:
        total = sum(share for share, _ in parts)
        self._parts = [(share / total, spread) for share, spread in parts]

    def cdf(self, values: FloatArray) -> FloatArray:
        """Return the share of the people below each value, shape (m,): the weighted sum over the groups."""
        total: FloatArray = sum(share * spread.cdf(values) for share, spread in self._parts)  # type: ignore[assignment]
        return total

    def ppf(self, u: FloatArray) -> FloatArray:
        """Return the quantiles at probabilities `u` in (0, 1), shape (m,), by bisection."""
        each = np.array([spread.ppf(u) for _, spread in self._parts])
        low: FloatArray = each.min(axis=0)
        high: FloatArray = each.max(axis=0)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = self.cdf(middle) < u
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return 0.5 * (low + high)


def names() -> tuple[str, ...]:
    """Return the names of all populations."""
    return tuple(_populations())


@cache
def quantity(of: str, name: str) -> QuantityDistribution:
    """Return the distribution of a quantity in a population.

    Args:
        of: name of the population, one of `names`.
        name: name of the quantity, one of QUANTITIES.
    """
    people = _populations()[of]
    if people.mixed:
        return Mixture([(share, quantity(part, name)) for part, share in people.mixed.items()])
    return people.quantities[name].spread(name)


@cache
def _populations() -> dict[str, People]:
    content = package_yaml(__file__, "populations")
    return {name: People.of(people, f"populations.yaml: {name}") for name, people in content.items()}


@cache
def _subject(name: str) -> Any:
    try:
        return subject.Subject.of(package_yaml(subject.__file__, f"subjects/{name}"), f"{name}.yaml:")
    except ParameterError as error:
        raise ParameterError(f"populations.yaml: no subject {name}: {error}") from None
