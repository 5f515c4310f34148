"""Prints declared parameters into the tables of INTERFACE.md.   python3 tests/interface_tables.py [--write]

A line above a table names what it lists: `<!-- declared: PREFIX MODULE:SETTINGS; ... -->`, where PREFIX, or nothing,
stands before the names. A row of that name is replaced by what the declaration says, one that is missing is added;
other rows are written by hand. Below the heading Parameters of a page with declared ones stands `RULE`.
"""

import importlib
import re
import sys
from pathlib import Path

from interface_pages import pages

from hric_core.parameters import Settings, rows

_MARK = re.compile(r"<!-- declared: (.+) -->")
_HEADING = re.compile(r"^(##+ Parameters\n)(?!An unknown parameter)", re.MULTILINE)
RULE = """\
An unknown parameter is refused before anything starts, with the nearest valid name: a node ends with exit code 2, a controller is not loaded.
"""  # noqa: E501


def marks(page: str) -> list[str]:
    """What the marks of a page hold."""
    return _MARK.findall(page)


def settings_of(mark: str) -> list[tuple[str, type[Settings]]]:
    """(prefix, declarations) that a mark names."""
    found = []
    for item in mark.split(";"):
        *prefix, settings = item.split()
        module, _, name = settings.partition(":")
        found.append(("".join(prefix), getattr(importlib.import_module(module), name)))
    return found


def declared(mark: str) -> dict[str, str]:
    """Printed rows by name, for what stands in a mark."""
    found = {}
    for prefix, settings in settings_of(mark):
        for cells in rows(settings, prefix):
            found[cells[0]] = (
                "".join(f"| {cell.replace('|', chr(92) + '|')} " if cell else "| " for cell in cells) + "|"
            )
    return found


def printed(page: str) -> str:
    """A page with the rows that its marks name, and the rule for all parameters."""
    page = _HEADING.sub(rf"\1{RULE}", page) if marks(page) else page
    lines: list[str] = []
    missing: dict[str, str] = {}
    table = False
    for line in [*page.splitlines(), ""]:
        mark = _MARK.fullmatch(line)
        if mark:
            missing, table = declared(mark[1]), False
        elif line.startswith("|"):
            table = True
            line = missing.pop(line.split("|")[1].strip(), line)
        elif table:
            lines += missing.values()
            missing, table = {}, False
        lines.append(line)
    return "\n".join(lines[:-1]) + "\n"


def changed(path: Path) -> str | None:
    """What the page should hold, if it does not."""
    text = path.read_text()
    wanted = printed(text)
    return None if wanted == text else wanted


if __name__ == "__main__":
    wrong = {path: text for path in pages() if (text := changed(path)) is not None}
    for path, text in wrong.items():
        if "--write" in sys.argv:
            path.write_text(text)
        print(f"{path}: {'written' if '--write' in sys.argv else 'differs from the declarations'}")
    sys.exit(bool(wrong) and "--write" not in sys.argv)
