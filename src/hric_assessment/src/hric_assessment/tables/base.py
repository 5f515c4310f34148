"""Common part of all table files (title, sources, marks), and tables of single values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, listing, mapping, number, numbers, section, text, unknown

MARKS = _, _, UNCONFIRMED, _ = ("confirmed twice", "confirmed once", "unconfirmed", "chosen here")
"""Marks that state how well a table's value is confirmed.

In order: by two or more independent public sources, by one, from memory only, chosen by this project without a source.
"""


def _short_names(meaning: str, default: str = "") -> Any:
    return listing(text(empty=False), default=(), different=True, single=True, text=meaning, default_text=default)


@dataclass(frozen=True)
class TableFile(Settings):
    """Head of a table file: title, sources, and default mark of its values."""

    title: str = text(empty=False, text="title of the table in findings")
    edition: str = text(empty=False, figures=True, text="edition of the table in findings")
    sources: Mapping[str, str] = mapping(text(empty=False), text="description of each source by its short name")
    mark: str = choice(*MARKS, default="unconfirmed", text="mark of all values that have none of their own")
    source: tuple[str, ...] = _short_names("short names of the sources of all values that name none")

    def check(self, where: str) -> None:
        """Refuse source names that are not in `sources`."""
        check_sources(self.source, self.sources, where.rstrip(" :."))

    @property
    def name(self) -> str:
        """Title and edition of the table, for findings."""
        return self.title if self.edition in self.title else f"{self.title} ({self.edition})"

    def mark_of(self, row: "MarkedRow") -> str:
        """Return the mark of a row, one of MARKS; by default that of the file."""
        return row.mark or self.mark

    def source_of(self, row: "MarkedRow") -> tuple[str, ...]:
        """Return the short names of a row's sources; by default those of the file."""
        return row.source or self.source


@dataclass(frozen=True)
class MarkedRow(Settings):
    """Row of a table file, with its mark and sources if these differ from the file's."""

    mark: str | None = choice(*MARKS, default=None, default_text="the file's", text="mark of the row")
    source: tuple[str, ...] = _short_names("short names of the sources of the row", "the file's")


def check_sources(names: Sequence[str], sources: Mapping[str, str], where: str) -> None:
    """Raise UnknownParameterError for a source name that is not in `sources`."""
    for name in names:
        if name not in sources:
            raise unknown("source", name, sources, where)


@dataclass(frozen=True)
class Value(MarkedRow):
    """Single value of a table file, in its printed unit; text: its meaning and unit."""

    value: float = number()
    text: str = text("", text="meaning and unit of the value")


@dataclass(frozen=True)
class ValueTable(TableFile):
    """Table of single values in their printed units."""

    values: Mapping[str, Value] = mapping(section(Value))

    def check(self, where: str) -> None:
        """Refuse source names, of the file or of a row, that are not in `sources`."""
        super().check(where)
        for name, row in self.values.items():
            check_sources(row.source, self.sources, f"{where}values.{name}")

    def __getitem__(self, name: str) -> float:
        """Return a value in its printed unit. Raises KeyError."""
        return self.values[name].value

    def value_mark(self, name: str) -> str:
        """Return the mark of a value, one of MARKS. Raises KeyError."""
        return self.mark_of(self.values[name])


@dataclass(frozen=True)
class NioshTable(ValueTable):
    """Values of the NIOSH lifting equation."""

    couplings: Mapping[str, tuple[float, float]] = mapping(numbers(2, minimum=0.0, maximum=1.0))
    durations: tuple[float, ...] = numbers(3, unit="h", above=0.0)
    frequencies: tuple[tuple[float, ...], ...] = listing(numbers(7, minimum=0.0))


@dataclass(frozen=True)
class AreaTable(ValueTable):
    """Possible areas of a contact between robot and person, by body region [m^2]."""

    largest: Mapping[str, float] = mapping(number(above=0.0), text="by region")


@dataclass(frozen=True)
class UncertainNumber(MarkedRow):
    """Number on which verdicts depend and whose value is not confirmed, with the range in which it may lie.

    Attributes:
        low, high: ends of the range, as factors of the value that the verdict uses [1].
        about: name of the number in verdicts.
        reason: reason for the range.
        changes: question of the verdict on which the number has an effect.
    """

    low: float = number(above=0.0, maximum=1.0, unit="1")
    high: float = number(minimum=1.0, unit="1")
    about: str = text(empty=False)
    reason: str = text(empty=False, figures=True)
    changes: str = choice("contact", "distance", default=REQUIRED)


@dataclass(frozen=True)
class UncertainTable(TableFile):
    """Numbers of verdicts that are not confirmed, with their ranges."""

    numbers: Mapping[str, UncertainNumber] = mapping(section(UncertainNumber))
