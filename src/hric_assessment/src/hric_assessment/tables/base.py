"""Common part of all table files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_core.parameters import Settings, choice, listing, mapping, text, unknown

MARKS = ("confirmed twice", "confirmed once", "unconfirmed", "chosen here")
"""Marks of a value: two or more independent public sources, one source, from memory only, or no source."""


def _short_names(of: str, default: str = "") -> Any:
    return listing(text(empty=False), default=(), different=True, single=True, text=of, default_text=default)


@dataclass(frozen=True)
class Table(Settings):
    """Head of a table file."""

    title: str = text(empty=False, text="as findings name it")
    edition: str = text(empty=False, figures=True, text="likewise")
    sources: Mapping[str, str] = mapping(text(empty=False), text="by short name")
    mark: str = choice(*MARKS, default="unconfirmed", text="of all values that have none of their own")
    source: tuple[str, ...] = _short_names("of all values that have none of their own, short names")

    def check(self, where: str) -> None:
        """Refuse sources that the file does not describe."""
        check_sources(self.source, self.sources, where.rstrip(" :."))

    @property
    def name(self) -> str:
        """Title and edition, for findings."""
        return self.title if self.edition in self.title else f"{self.title} ({self.edition})"

    def mark_of(self, row: "Marked") -> str:
        """Return the mark of a row, one of MARKS."""
        return row.mark or self.mark

    def source_of(self, row: "Marked") -> tuple[str, ...]:
        """Return the short names of a row's sources."""
        return row.source or self.source


@dataclass(frozen=True)
class Marked(Settings):
    """Row with its mark and sources, where these differ from the file's."""

    mark: str | None = choice(*MARKS, default=None, default_text="the file's", text="of the row")
    source: tuple[str, ...] = _short_names("of the row", "the file's")


def check_sources(given: Sequence[str], sources: Mapping[str, str], where: str) -> None:
    """Raise UnknownParameterError for a source that the file does not describe."""
    for name in given:
        if name not in sources:
            raise unknown("source", name, sources, where)
