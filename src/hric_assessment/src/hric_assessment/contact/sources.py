"""Numbers behind the findings of a verdict, with their editions and sources, and the mark of each number.

for table in sources(groups, regions, limits_titles):
    table.file, table.table.name, table.numbers
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from hric_assessment import tables
from hric_assessment.ergonomics.scoring import methods
from hric_assessment.findings import CONTACT, LIFT, POSTURE, PUSHING, REPETITION, SEPARATION
from hric_assessment.tables.base import MARKS, Value
from hric_assessment.tables.limits import LimitRow
from hric_assessment.tables.posture import ChosenThreshold
from hric_core.parameters import package_path
from hric_human.body.regions import REGION_MODELS

CONFIRMED = MARKS[:2]
"""Marks of numbers that at least one public source confirms."""
BY_GROUP: Mapping[str, Mapping[str, Callable[[], tables.TableFile]]] = {
    CONTACT: {"episodes": tables.episode_table, "contact_areas": tables.area_table},
    SEPARATION: {"separation": tables.separation_table},
    LIFT: {"niosh": tables.niosh_table},
    REPETITION: {"ocra": tables.ocra_table},
    PUSHING: {"pushing": tables.push_table},
}
"""Tables by group of findings and name of their file, besides contact limits and posture methods."""
SourcedNumber = tuple[str, str, str, str, str]
"""Name of a number, the number as it is printed, its meaning and unit, its mark, and the short names of its sources."""
SPRING = "body model: stiffness [N/mm] of the simulated spring, and effective mass [kg], for comparison only"


@dataclass(frozen=True)
class SourceTable:
    """Table of a file in config/tables; numbers: its single values, and of its limits only those of chosen regions."""

    file: Path
    table: tables.TableFile
    numbers: list[SourcedNumber]


def sources(groups: Collection[str], regions: Collection[str], titles: Collection[str]) -> list[SourceTable]:
    """Return the tables that findings use.

    Args:
        groups: groups of the findings.
        regions: body regions of the findings; contact limits are listed for these only.
        titles: titles of tables of contact limits; a user's own table is left out, since its values are not known here.
    """
    limits = {name: tables.limit_table(name) for name in tables.LIMIT_TABLES}
    found: dict[str, tables.TableFile] = {name: table for name, table in limits.items() if table.title in titles}
    by_group = [reads for group, reads in BY_GROUP.items() if group in groups]
    found |= {name: read() for reads in by_group for name, read in reads.items()}
    found |= {key: method.table() for key, method in methods().items() if POSTURE in groups}
    found["verdict"] = tables.verdict_table()
    return [
        SourceTable(package_path(tables.__file__, f"tables/{name}"), table, _numbers(table, regions))
        for name, table in found.items()
    ]


def _numbers(table: tables.TableFile, regions: Collection[str]) -> list[SourcedNumber]:
    rows: list[tuple[str, Any]] = []
    for field in fields(table):
        content = getattr(table, field.name)
        items = content.items() if isinstance(content, dict) else [(field.name, content)]
        rows += [(name, item) for name, item in items if isinstance(item, Value | ChosenThreshold)]
        if isinstance(content, tuple):
            rows += [(field.name, item) for item in content if isinstance(item, LimitRow) and item.region in regions]
    models = REGION_MODELS if isinstance(table, tables.LimitTable) else {}
    springs = [
        (name, f"{model.stiffness / 1e3:g}, {model.mass:g}", SPRING, MARKS[0], "papers and public code")
        for name, model in models.items()
        if name in regions
    ]
    return [_number(table, name, row) for name, row in rows] + springs


def _number(table: Any, name: str, row: Any) -> SourcedNumber:
    if isinstance(row, ChosenThreshold):
        return (name, f"{row.value:g}", f"{row.text} [deg]", MARKS[-1], "project")
    mark, names = table.mark_of(row), ", ".join(table.source_of(row)) or "none stated"
    if isinstance(row, Value):
        return (name, f"{row.value:g}", row.text, mark, names)
    transient = row.transient_by(table.force_factor if name == "forces" else table.pressure_factor)
    words = "contact is not permitted" if transient is None else f"{transient:g}"
    label = ", ".join(filter(None, (row.region, row.area, getattr(row, "hand", None))))
    meaning = f"limits of {'force [N]' if name == 'forces' else 'pressure [N/cm^2]'}"
    return (label, f"quasi-static {row.quasi_static:g}, transient {words}", meaning, mark, names)
