"""Writer of declared parameters into the tables of INTERFACE.md.   python3 tests/interface_tables.py [--write]

A comment above a table names the declarations that it lists: `<!-- declared: PREFIX MODULE:SETTINGS; ... -->`. PREFIX
is optional and is put before the names of the parameters. Rows of declared parameters are replaced, and missing ones
are added; other rows are written by hand. `RULE` is inserted below the heading Parameters if a page has such rows.
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
    """Return the contents of the comments `declared:` in a page."""
    return _MARK.findall(page)


def settings_of(mark: str) -> list[tuple[str, type[Settings]]]:
    """Return the pairs of prefix and declaring class in the content of a comment."""
    found = []
    for item in mark.split(";"):
        *prefix, settings = item.split()
        module, _, name = settings.partition(":")
        found.append(("".join(prefix), getattr(importlib.import_module(module), name)))
    return found


def declared(mark: str) -> dict[str, str]:
    """Return the table rows of the declared parameters by name, for the content of a comment."""
    found = {}
    for prefix, settings in settings_of(mark):
        for cells in rows(settings, prefix):
            found[cells[0]] = (
                "".join(f"| {cell.replace('|', chr(92) + '|')} " if cell else "| " for cell in cells) + "|"
            )
    return found


def printed(page: str) -> str:
    """Return a page with the rows of its declared parameters, and `RULE`."""
    page = _HEADING.sub(rf"\1{RULE}", page) if marks(page) else page
    lines: list[str] = []
    missing: dict[str, str] = {}
    table = False
    for line in [*page.splitlines(), ""]:
        mark = _MARK.fullmatch(line)
        if mark:
            assert not missing, f"two comments for one table: {line[:80]}"
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
    """Return the text that a page should have; None if it is up to date."""
    text = path.read_text()
    wanted = printed(text)
    return None if wanted == text else wanted


if __name__ == "__main__":
    wrong = {path: text for path in pages() if (text := changed(path)) is not None}
    for path, text in wrong.items():
        if "--write" in sys.argv:
            path.write_text(text)
        print(f"{path}: {'written' if '--write' in sys.argv else 'differs from the declarations; call with --write'}")
    sys.exit(bool(wrong) and "--write" not in sys.argv)
