"""Table of an HTML page with cells of plain text, and formatting of numbers."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

NUMERIC = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?( %)?$|[-–]$|never$")


@dataclass(frozen=True)
class PageTable:
    """Table of an HTML page.

    Attributes:
        title: heading; "": no heading.
        head: names of the columns, with units.
        rows: cells of each row; columns of numbers are right-aligned.
        note: text below the heading.
        folded: True if the table is collapsed until it is clicked; in print it is always expanded.
        times: for each row, time to which a click sets the replay [s]; empty: rows cannot be clicked.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False
    times: Sequence[float] = ()

    @property
    def numeric(self) -> list[bool]:
        """True for each column that contains only numbers."""
        columns = zip(*self.rows, strict=True) if self.rows else [("",)] * len(self.head)
        return [all(map(NUMERIC.match, column)) for column in columns]


def number(value: Any, digits: int = 4) -> str:
    """Format a number with `digits` significant digits; None or not finite gives a dash, other values their text."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return f"{value:.{digits}g}"
