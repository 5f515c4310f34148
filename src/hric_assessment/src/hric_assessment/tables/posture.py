"""Tables of RULA and REBA, as in their files."""

from collections.abc import Mapping
from dataclasses import dataclass

from hric_assessment.tables.base import MARKS, TableFile, Value
from hric_core.parameters import (
    Settings,
    choice,
    either,
    listing,
    mapping,
    names,
    number,
    numbers,
    refused,
    section,
    text,
    unknown,
    whole,
)


@dataclass(frozen=True)
class ChosenThreshold(Settings):
    """Threshold that no source has [deg]."""

    value: float = number(unit="deg", minimum=0.0)
    text: str = text(empty=False)


@dataclass(frozen=True)
class Band(Settings):
    """Scores between the bounds of an angle [deg], from below.

    Attributes:
        bounds: numbers, or names of thresholds in `chosen`, with a minus in front for their negatives.
        higher_on: bounds on which the higher score counts; on all others the lower.
        unless: a flag where the score is `then`.
    """

    angle: str = text(empty=False)
    bounds: tuple[float | str, ...] = listing(either(number(), text(empty=False)))
    scores: tuple[int, ...] = listing(whole())
    higher_on: tuple[float, ...] = numbers(default=())
    unless: str | None = text(None, empty=False)
    then: int = whole(0)

    def check(self, where: str) -> None:
        """Refuse bounds and scores whose numbers do not match."""
        if len(self.scores) != len(self.bounds) + 1:
            raise refused(f"{where}scores", list(self.scores), f"{len(self.bounds) + 1} values, one more than bounds")


@dataclass(frozen=True)
class Condition(Settings):
    """Flag; or an angle above a threshold, or beyond it to either side; the threshold is one of `chosen`."""

    flag: str | None = text(None, empty=False)
    angle: str | None = text(None, empty=False)
    above: str | None = text(None, empty=False)
    beyond: str | None = text(None, empty=False)

    def check(self, where: str) -> None:
        """Refuse all but exactly one of the three forms."""
        parts = [name for name in ("flag", "angle", "above", "beyond") if getattr(self, name) is not None]
        if parts not in (["flag"], ["angle", "above"], ["angle", "beyond"]):
            raise refused(where.rstrip(". "), ", ".join(parts), "flag, or angle with above, or angle with beyond")


@dataclass(frozen=True)
class Adder(Settings):
    """Score that is added if any of some conditions holds."""

    score: int = whole()
    text: str = text(empty=False)
    any: tuple[Condition, ...] = listing(section(Condition))


@dataclass(frozen=True)
class PostureStep(Settings):
    """Part of the body."""

    start: int = whole(0)
    bands: tuple[Band, ...] = listing(section(Band), default=())
    add: tuple[Adder, ...] = listing(section(Adder), default=())


@dataclass(frozen=True)
class PostureTable(TableFile):
    """Table of a method that scores postures.

    Attributes:
        within, warning: highest score that is within limits, and that is a warning.
        levels: name of each level by its highest score, as text.
        table_a, table_b, table_c: rows by their numbers, as text, with the columns in order.
    """

    chosen: Mapping[str, ChosenThreshold] = mapping(section(ChosenThreshold))
    parts: Mapping[str, PostureStep] = mapping(section(PostureStep))
    static_time: float = number(unit="s", above=0.0)
    repeats: float = number(unit="1/min", above=0.0)
    light: float = number(unit="kg", minimum=0.0)
    heavy: float = number(unit="kg", minimum=0.0)
    within: Value = section(Value)
    warning: Value = section(Value)
    levels: Mapping[str, str] = mapping(text(empty=False))
    table_a: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))
    table_b: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))
    table_c: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))

    def check(self, where: str) -> None:
        """Refuse thresholds that are not in `chosen`."""
        super().check(where)
        for name, part in self.parts.items():
            bounds = [bound.lstrip("-") for band in part.bands for bound in band.bounds if isinstance(bound, str)]
            conditions = [condition for adder in part.add for condition in adder.any if condition.angle]
            for threshold in [*bounds, *(item.above or item.beyond for item in conditions)]:
                if threshold not in self.chosen:
                    raise unknown("threshold", threshold, self.chosen, f"{where}parts.{name}")

    def level(self, score: int) -> str:
        """Return the name of the level of a score."""
        return next(name for highest, name in self.levels.items() if score <= int(highest))


@dataclass(frozen=True)
class RulaTable(PostureTable):
    """Table of RULA; older_rows: rows of table A that differ in an older worksheet, with the mark older_mark."""

    older_mark: str = choice(*MARKS, default="unconfirmed")
    older_rows: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1), 8), default={})


@dataclass(frozen=True)
class RebaTable(PostureTable):
    """Table of REBA; couplings: in order of their scores from 0 on."""

    couplings: tuple[str, ...] = names()
