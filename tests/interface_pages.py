"""Reads the tables of INTERFACE.md."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = {
    "Topics": ("topic", "type", "direction", "rate", "description"),
    "Services": ("service", "type", "description"),
    "Actions": ("action", "type", "description"),
    "Parameters": ("parameter", "type", "default", "unit", "description"),
}


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        page: the file.
        section: Topics, Services, Actions or Parameters.
        cells: column -> text, without backticks.
    """

    page: Path
    section: str
    cells: dict[str, str]

    @property
    def name(self) -> str:
        """What the first column says."""
        return self.cells[COLUMNS[self.section][0]]

    def matches(self, resolved: str) -> bool:
        """Whether an absolute name is this one; `<placeholder>` stands for a part of a name, or for a piece of one."""
        pattern = "[^/]+".join(map(re.escape, re.split(r"<[^>]*>", self.name.strip("/"))))
        return re.fullmatch(pattern, resolved.strip("/")) is not None


def pages() -> list[Path]:
    """INTERFACE.md of all packages."""
    return sorted(ROOT.glob("src/*/INTERFACE.md"))


def rows(page: Path) -> list[Row]:
    """All rows of the known tables of a page.

    Raises:
        AssertionError: a table without the agreed columns, or a row with another number of cells.
    """
    found: list[Row] = []
    section, header = "", ()
    for number, line in enumerate(page.read_text().splitlines(), 1):
        if line.startswith("#"):
            section, header = (line.lstrip("# ").strip() if line.startswith("## ") else section), ()
        elif line.startswith("|") and section in COLUMNS:
            cells = tuple(cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1])
            where = f"{page.parent.name}/{page.name}:{number}"
            if not header:
                header = cells
                assert header == COLUMNS[section], f"{where}: columns {header}, wanted {COLUMNS[section]}"
            elif set("".join(cells)) - set("-: "):
                assert len(cells) == len(header), f"{where}: {len(cells)} cells, wanted {len(header)}"
                found.append(
                    Row(page, section, {key: cell.strip("`") for key, cell in zip(header, cells, strict=True)})
                )
    return found
