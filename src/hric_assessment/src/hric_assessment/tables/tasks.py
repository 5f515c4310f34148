"""Tables of methods that rate tasks: OCRA checklist, and forces of pushing and pulling."""

from collections.abc import Mapping
from dataclasses import dataclass

from hric_assessment.tables.base import TableFile, ValueTable
from hric_core.parameters import Settings, listing, mapping, number, numbers, refused, section, text


@dataclass(frozen=True)
class OcraTable(ValueTable):
    """Table of the OCRA checklist; the comments of its file explain the rows."""

    factors: Mapping[str, Mapping[str, float]] = mapping(mapping(number(minimum=0.0)))
    frequencies: tuple[tuple[float, ...], ...] = listing(numbers(3, minimum=0.0))
    shoulder: tuple[tuple[float, ...], ...] = listing(numbers(2, minimum=0.0))
    others: tuple[tuple[float, ...], ...] = listing(numbers(2, minimum=0.0))
    durations: tuple[tuple[float, ...], ...] = listing(numbers(2, minimum=0.0))
    levels: Mapping[str, str] = mapping(text(empty=False))

    def level(self, score: float) -> str:
        """Return the name of a score's level, such as "acceptable"."""
        return next(name for highest, name in self.levels.items() if score <= float(highest))


@dataclass(frozen=True)
class PushColumns(Settings):
    """Group of columns of a table of forces: distance up to which it holds [m], and intervals between actions [s]."""

    distance: float = number(above=0.0)
    intervals: tuple[float, ...] = numbers(above=0.0)


@dataclass(frozen=True)
class PushRow(Settings):
    """Row of a table of forces: height of the hands [cm], initial and sustained forces of all columns [kg force]."""

    height: float = number(above=0.0)
    initial: tuple[float, ...] = numbers(above=0.0)
    sustained: tuple[float, ...] = numbers(above=0.0)


@dataclass(frozen=True)
class PushTable(TableFile):
    """Acceptable forces of pushing and pulling."""

    columns: tuple[PushColumns, ...] = listing(section(PushColumns))
    push: tuple[PushRow, ...] = listing(section(PushRow))
    pull: tuple[PushRow, ...] = listing(section(PushRow))

    def check(self, where: str) -> None:
        """Refuse a row whose number of forces is not that of the columns."""
        super().check(where)
        count = sum(len(group.intervals) for group in self.columns)
        for row in (*self.push, *self.pull):
            if {len(row.initial), len(row.sustained)} != {count}:
                raise refused(
                    f"{where}height {row.height:g}: number of initial and sustained forces",
                    (len(row.initial), len(row.sustained)),
                    f"{count} each, one per interval of the columns",
                )
