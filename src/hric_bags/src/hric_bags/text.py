"""Text for terminals and text files: aligned tables, and which step of a long computation is under way."""

import sys
import time
from collections.abc import Sequence


def rows(cells: Sequence[Sequence[str]], head: int = 1) -> list[str]:
    """Aligned lines: the first column to the left, the others to the right; a rule below the lines of the head."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = []
    for row in cells:
        first, *others = zip(row, widths, strict=True)
        lines.append("  ".join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]).rstrip())
    return [*lines[:head], "-" * sum(widths, 2 * (len(widths) - 1)), *lines[head:]]


class Steps:
    """Call it with what begins, for stderr: on a terminal one line that changes, elsewhere a line each.

    Args:
        total: number of steps.
    """

    def __init__(self, total: int) -> None:
        self._total, self._begun, self._began = total, 0, time.monotonic()

    def __call__(self, what: str) -> None:
        """The next step begins."""
        self._begun += 1
        line = f"report, step {self._begun} of {self._total} ({time.monotonic() - self._began:.0f} s): {what}"
        print(f"\r{line}\033[K" if sys.stderr.isatty() else f"{line}\n", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        """No step follows: the terminal's line is free again."""
        print("\r\033[K" * sys.stderr.isatty(), end="", file=sys.stderr, flush=True)
