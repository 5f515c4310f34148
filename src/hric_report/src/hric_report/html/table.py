"""Table of a page, as plain cells, and numbers as text."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

NUMERIC = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?( %)?$|[-–]$|never$")


@dataclass(frozen=True)
class PageTable:
    """Table of a page.

    Attributes:
        title: heading; "": none.
        head: names of the columns, with units.
        rows: cells of each row; columns of numbers are right-aligned.
        note: text below the heading.
        folded: True if the table is collapsed until it is clicked; it is printed anyway.
        times: replay time that a click on each row shows [s]; empty: rows cannot be clicked.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False
    times: Sequence[float] = ()

    @property
    def numeric(self) -> list[bool]:
        """True for each column of numbers."""
        columns = zip(*self.rows, strict=True) if self.rows else [("",)] * len(self.head)
        return [all(map(NUMERIC.match, column)) for column in columns]


def number(value: Any, digits: int = 4) -> str:
    """Format a number with `digits` significant digits; None or not finite: a dash; anything else as text."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return f"{value:.{digits}g}"
