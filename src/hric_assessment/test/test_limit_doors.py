"""Only hric_assessment/contact and hric_assessment/tables read what a person bears: there is one judge."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2]
DOORS = ("hric_assessment/contact/", "hric_assessment/tables/")
"""Folders that may read the tables of limits; all others ask their functions."""
OWN = ("hric_assessment/", "hric_supervisor/")
"""Packages that may read its other tables: of postures, separation, episodes."""
TABLES = "hric_assessment.tables"
READERS = {"limit_table", "LimitTable", "ForceRow", "PressureRow", "Row"}
"""Names of hric_assessment.tables that give limits of a person."""
ROWS = {"force_rows", "pressure_rows", "force_factor", "pressure_factor", "transient_by"}
"""Attributes of a table of limits."""
PARTS, KINDS = {"force", "pressure"}, {"quasi_static", "transient"}
"""Attributes of a `Limit` and of its `Pair`, in any object's name: limit.force.transient."""
FILES = ("iso_ts_15066.yaml", "bgia2011.yaml")


def offences(path: str, text: str) -> Iterator[str]:
    """Statements of a module that read limits of a person; path: below src/PACKAGE/src/."""
    if path.startswith(DOORS):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom | ast.Import):
            module = getattr(node, "module", None) or ""
            names = {f"{module}.{alias.name}" if module else alias.name for alias in node.names}
            inside = {name for name in names if name == TABLES or name.startswith(f"{TABLES}.")}
            limits = {name for name in inside if name.startswith(f"{TABLES}.limits") or name.split(".")[-1] in READERS}
            if inside if not path.startswith(OWN) else limits:
                yield f"{path}:{node.lineno}: imports {', '.join(sorted(inside))}"
        elif isinstance(node, ast.Attribute):
            name = getattr(node.value, "attr", getattr(node.value, "id", ""))
            if node.attr in ROWS or (node.attr in KINDS and name in PARTS):
                yield f"{path}:{node.lineno}: reads {name}.{node.attr}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.endswith(FILES):
            yield f"{path}:{node.lineno}: names the file {node.value}"


def modules() -> dict[str, str]:
    """Text of all product Python, by its path below src/PACKAGE/src/, or of nodes below src/."""
    paths = dict[str, Path]()
    for package in SOURCE.iterdir():
        own = package / "src"
        paths |= {str(path.relative_to(own)): path for path in own.rglob("*.py")}
        paths |= {str(path.relative_to(SOURCE)): path for path in package.glob("nodes/*") if path.is_file()}
    return {name: path.read_text() for name, path in paths.items()}


def test_nothing_but_the_doors_reads_limits_of_a_person() -> None:
    found = modules()
    assert {"hric_assessment/contact/limits.py", "hric_sweep/approaches/contact_events.py"} <= set(found)
    assert [offence for path, text in found.items() for offence in offences(path, text)] == []


@pytest.mark.parametrize(
    "text",
    [
        "from hric_assessment.tables import limit_table",
        "from hric_assessment.tables import episode_table",
        "from hric_assessment import tables",
        "import hric_assessment.tables.limits",
        "share = contact.peak / limit.force.transient",
        "def held(limit):\n    force = limit.force\n    return force.quasi_static",
        "rows = limits.table.force_rows(region)",
        "path = folder / 'tables/iso_ts_15066.yaml'",
    ],
)
def test_a_judge_of_its_own_elsewhere_is_named(text: str) -> None:
    (offence,) = offences("hric_sweep/approaches/contact_events.py", text)
    assert offence.startswith("hric_sweep/approaches/contact_events.py:")


@pytest.mark.parametrize(
    ("path", "count"),
    [("hric_assessment/verdict/choices.py", 1), ("hric_assessment/contact/limits.py", 0)],
)
def test_within_the_package_only_the_doors_read_the_table(path: str, count: int) -> None:
    assert len(list(offences(path, "from hric_assessment.tables import limit_table"))) == count


def test_other_tables_are_read_within_the_package() -> None:
    assert list(offences("hric_assessment/verdict/lifts.py", "from hric_assessment.tables import niosh_table")) == []
