"""Common part of all table files, and tables of single values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_core.parameters import Settings, choice, listing, mapping, number, numbers, section, text, unknown

MARKS = ("confirmed twice", "confirmed once", "unconfirmed", "chosen here")
"""Marks of a value: two or more independent public sources, one source, from memory only, or no source."""


def _short_names(meaning: str, default: str = "") -> Any:
    return listing(text(empty=False), default=(), different=True, single=True, text=meaning, default_text=default)


@dataclass(frozen=True)
class TableFile(Settings):
    """Head of a table file."""

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
        """Title and edition, for findings."""
        return self.title if self.edition in self.title else f"{self.title} ({self.edition})"

    def mark_of(self, row: "MarkedRow") -> str:
        """Return the mark of a row, one of MARKS."""
        return row.mark or self.mark

    def source_of(self, row: "MarkedRow") -> tuple[str, ...]:
        """Return the short names of a row's sources."""
        return row.source or self.source


@dataclass(frozen=True)
class MarkedRow(Settings):
    """Row with its mark and sources, where these differ from the file's."""

    mark: str | None = choice(*MARKS, default=None, default_text="the file's", text="mark of the row")
    source: tuple[str, ...] = _short_names("short names of the sources of the row", "the file's")


def check_sources(names: Sequence[str], sources: Mapping[str, str], where: str) -> None:
    """Raise UnknownParameterError for a source name that is not in `sources`."""
    for name in names:
        if name not in sources:
            raise unknown("source", name, sources, where)


@dataclass(frozen=True)
class Value(MarkedRow):
    """Single value."""

    value: float = number()


@dataclass(frozen=True)
class ValueTable(TableFile):
    """Table of single values, in their printed units; what each of them means is in its file."""

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
    """Values of the lifting equation; explained in config/tables/niosh.yaml."""

    couplings: Mapping[str, tuple[float, float]] = mapping(numbers(2, minimum=0.0, maximum=1.0))
    durations: tuple[float, ...] = numbers(3, unit="h", above=0.0)
    frequencies: tuple[tuple[float, ...], ...] = listing(numbers(7, minimum=0.0))


@dataclass(frozen=True)
class AreaTable(ValueTable):
    """Areas over which a contact can act [m^2]; config/tables/contact_areas.yaml."""

    largest: Mapping[str, float] = mapping(number(above=0.0), text="by region")
