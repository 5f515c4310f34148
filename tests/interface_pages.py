"""Reader of the tables in INTERFACE.md."""

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
    """Row of a table in an INTERFACE.md.

    Attributes:
        page: path of the INTERFACE.md.
        section: heading above the table: Topics, Services, Actions or Parameters.
        cells: text by column, without backticks.
    """

    page: Path
    section: str
    cells: dict[str, str]

    @property
    def name(self) -> str:
        """Text of the first column: the name of the topic, service, action or parameter."""
        return self.cells[COLUMNS[self.section][0]]

    def matches(self, resolved: str) -> bool:
        """Return True if an absolute ROS name matches this row's name, in which `<placeholder>` matches any text."""
        pattern = "[^/]+".join(map(re.escape, re.split(r"<[^>]*>", self.name.strip("/"))))
        return re.fullmatch(pattern, resolved.strip("/")) is not None


def pages() -> list[Path]:
    """Return the INTERFACE.md files of all packages."""
    return sorted(ROOT.glob("src/*/INTERFACE.md"))


def rows(page: Path) -> list[Row]:
    """Return all rows of the tables in the sections Topics, Services, Actions and Parameters.

    Raises:
        AssertionError: a table does not have the columns of its section, or a row has another number of cells.
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
