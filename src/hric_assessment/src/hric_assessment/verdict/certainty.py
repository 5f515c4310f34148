"""Certainty of a verdict's conclusions: the unconfirmed numbers that move each of them, ranked, and an interval.

The interval has the root of the summed squares of the changes to either side, as for independent errors. It is no
confidence interval: the ranges of most numbers are choices of this project (config/tables/uncertain.yaml).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from hric_assessment.typed_json import Content
from hric_assessment.verdict.conclusions import POSTURE, QUESTIONS

SHOWN = 5
"""Maximum number of influences on one conclusion that texts show; verdict.json has all."""
NEGLIGIBLE = 5e-3
"""Relative change of a quantity below which texts do not show it [1]; project default."""


@dataclass(frozen=True)
class Influence:
    """Change of a conclusion by one number that is not confirmed, at that end of its range which changes it most.

    Attributes:
        number: name of the number.
        end: value at that end, as a factor or a difference, such as "x 2".
        mark: how well the number is confirmed.
        change: change of the conclusion's value at that end, in its unit.
        lower, upper: largest changes of the conclusion's value down and up, at either end, in its unit; 0: none.
        effects: relative changes of further quantities at that end [1], by name.
    """

    number: str
    end: Annotated[str, "as a factor or a difference"]
    mark: Annotated[str, "how well the number is confirmed"]
    change: Annotated[float, "at that end, in the unit of the value"]
    lower: Annotated[float, "largest change down, 0 or below, in the unit of the value"]
    upper: Annotated[float, "largest change up, 0 or above"]
    effects: Annotated[Mapping[str, float], ("description", "relative changes at that end [1]")]

    @property
    def shown_effects(self) -> list[str]:
        """Effects that are not negligible, as text; of several permitted speeds the one that changes most."""
        largest: dict[str, tuple[str, float]] = {}
        for name, effect in self.effects.items():
            kind = " ".join(name.split()[:2])
            if abs(effect) >= max(NEGLIGIBLE, abs(largest.get(kind, ("", 0.0))[1])):
                largest[kind] = name, effect
        return [f"{name} {100.0 * effect:+.0f} %" for name, effect in largest.values()]


@dataclass(frozen=True)
class Certainty:
    """Certainty of the conclusion about one question.

    Attributes:
        question: one of QUESTIONS.
        quantity: quantity that the conclusion compares with its limit.
        value, limit: that quantity, and its limit, in `unit`; limit None: it is the limit itself.
        unit: unit of value, limit, and changes.
        low, high: interval of the value.
        moved_by: influences of unconfirmed numbers, the largest first.
        unknown: effects that are not known, one sentence each; the interval does not contain them.
    """

    question: Annotated[str, ("enum", QUESTIONS)]
    quantity: str
    value: float
    limit: Annotated[float | None, "null: the value is the limit itself"]
    unit: str
    low: Annotated[float, "lower end of the interval"]
    high: Annotated[float, "upper end of the interval"]
    moved_by: Annotated[tuple[Influence, ...], "the largest first"]
    unknown: Annotated[tuple[str, ...], "effects that are not known and that the interval does not contain"] = ()

    @classmethod
    def of(
        cls,
        question: str,
        quantity: tuple[str, float, float | None, str],
        influences: Sequence[Influence],
        unknown: Sequence[str] = (),
    ) -> "Certainty":
        """Return the certainty that follows from some influences; quantity: its name, value, limit and unit."""
        name, value, limit, unit = quantity
        ends = (math.hypot(*(getattr(item, side) for item in influences)) for side in ("lower", "upper"))
        low, high = next(ends), next(ends)
        order = sorted(
            influences, key=lambda item: (-abs(item.change), -max(map(abs, item.effects.values()), default=0.0))
        )
        return cls(question, name, value, limit, unit, value - low, value + high, tuple(order), tuple(unknown))

    @classmethod
    def read(cls, entry: Content) -> "Certainty":
        """Return the certainty from its entry in verdict.json."""
        moved = tuple(Influence(**item) for item in entry["moved_by"])
        return cls(**{**entry, "moved_by": moved, "unknown": tuple(entry["unknown"])})

    @property
    def doubtful(self) -> bool:
        """True if the value is within its limit, and the upper end of the interval is not."""
        return self.limit is not None and self.value <= self.limit < self.high

    @property
    def interval(self) -> str:
        """Sentence with the range of the value within the ranges of unconfirmed numbers; no confidence interval."""
        form = ".0f" if self.question == POSTURE else ".3f" if self.unit == "m" else ".3g"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.quantity} {self.low:{form}} to {self.high:{form}}{unit} within the ranges of unconfirmed numbers"

    def lines(self) -> Iterator[str]:
        """Yield the interval, and a line for each of the largest influences, and each effect that is not known."""
        moved = [item for item in self.moved_by if item.change or item.shown_effects]
        yield self.interval if moved else f"no unconfirmed number moves the {self.quantity}"
        for item in moved[:SHOWN]:
            parts = [f"{item.change:+.2g} {self.unit}".rstrip(), *item.shown_effects]
            yield f"moved by {item.number} {item.end} ({item.mark}): {', '.join(parts)}"
        if len(moved) > SHOWN:
            yield f"and by {len(moved) - SHOWN} further numbers, none of them by more: see verdict.json"
        yield from self.unknown
