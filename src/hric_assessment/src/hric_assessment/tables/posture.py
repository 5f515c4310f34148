"""Tables of posture scoring methods such as RULA and REBA, as they stand in their files."""

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
    """Threshold of an angle that no source gives and this project chose [deg]; text: reason for the choice."""

    value: float = number(unit="deg", minimum=0.0)
    text: str = text(empty=False)


@dataclass(frozen=True)
class Band(Settings):
    """Score by the interval (band) in which an angle lies.

    Attributes:
        angle: name of the posture angle.
        bounds: ascending bounds of the intervals [deg]: numbers, or names of thresholds in `chosen`, with a minus in
            front for their negatives.
        scores: score of each interval, from the lowest on; one more than bounds.
        higher_on: bounds at which the higher of both neighbouring scores counts; at all others the lower counts.
        unless: flag of the posture; if it is True, the score is `then`.
        then: score if the flag `unless` is True.
    """

    angle: str = text(empty=False)
    bounds: tuple[float | str, ...] = listing(either(number(), text(empty=False)))
    scores: tuple[int, ...] = listing(whole())
    higher_on: tuple[float, ...] = numbers(default=())
    unless: str | None = text(None, empty=False)
    then: int = whole(0)

    def check(self, where: str) -> None:
        """Refuse a number of scores that is not one more than the number of bounds."""
        if len(self.scores) != len(self.bounds) + 1:
            raise refused(f"{where}scores", list(self.scores), f"{len(self.bounds) + 1} values, one more than bounds")


@dataclass(frozen=True)
class Condition(Settings):
    """Condition for additional points: a flag, or an angle above a threshold, or beyond it to either side.

    Attributes:
        flag: name of a flag of the posture.
        angle: name of a posture angle.
        above: name of a threshold in `chosen` that the angle must exceed.
        beyond: name of a threshold in `chosen` that the angle's absolute value must exceed.
    """

    flag: str | None = text(None, empty=False)
    angle: str | None = text(None, empty=False)
    above: str | None = text(None, empty=False)
    beyond: str | None = text(None, empty=False)

    def check(self, where: str) -> None:
        """Refuse a condition that is not exactly one of: flag, angle with above, angle with beyond."""
        parts = [name for name in ("flag", "angle", "above", "beyond") if getattr(self, name) is not None]
        if parts not in (["flag"], ["angle", "above"], ["angle", "beyond"]):
            raise refused(where.rstrip(". "), ", ".join(parts), "flag, or angle with above, or angle with beyond")


@dataclass(frozen=True)
class Adder(Settings):
    """Points that are added to a part's score if any of its conditions holds; text: reason in findings."""

    score: int = whole()
    text: str = text(empty=False)
    any: tuple[Condition, ...] = listing(section(Condition))


@dataclass(frozen=True)
class PostureStep(Settings):
    """Scoring rule of one part of the body: start value, bands of angles, and additional points."""

    start: int = whole(0)
    bands: tuple[Band, ...] = listing(section(Band), default=())
    add: tuple[Adder, ...] = listing(section(Adder), default=())


@dataclass(frozen=True)
class PostureTable(TableFile):
    """Table of a posture scoring method.

    Attributes:
        chosen: thresholds of angles that this project chose, by name.
        parts: scoring rules by part of the body.
        static_time: time after which a posture counts as static [s].
        repeats: repetitions above which an action counts as repeated [1/min].
        light, heavy: loads at which the score of the load changes [kg].
        within, warning: highest score that is within limits, and highest score that is a warning.
        levels: name of each level, by its highest score (as text).
        table_a, table_b, table_c: rows of the method's tables by their numbers (as text), with the columns in order.
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

    def degrees(self, bound: float | str, shift: float = 0.0) -> float:
        """Return a bound [deg]; a text is the name of a threshold in `chosen`, negated by a minus in front.

        shift: change of all thresholds in `chosen`, which remain 0 or above [deg].
        """
        if not isinstance(bound, str):
            return bound
        value = max(0.0, self.chosen[bound.lstrip("-")].value + shift)
        return (-1.0 if bound.startswith("-") else 1.0) * value + 0.0  # no -0

    def level(self, score: int) -> str:
        """Return the name of a score's level, such as "acceptable"."""
        return next(name for highest, name in self.levels.items() if score <= int(highest))


@dataclass(frozen=True)
class RulaTable(PostureTable):
    """Table of RULA.

    Attributes:
        older_mark: mark of the older version of table A.
        older_rows: rows of table A that differ in an older worksheet.
    """

    older_mark: str = choice(*MARKS, default="unconfirmed")
    older_rows: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1), 8), default={})


@dataclass(frozen=True)
class RebaTable(PostureTable):
    """Table of REBA; couplings: names of the qualities of grip, in order of their scores from 0 on."""

    couplings: tuple[str, ...] = names()
