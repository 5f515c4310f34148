"""Texts for terminals and text files: aligned tables, and the progress of a long computation."""

import re
import shutil
import sys
import time
from collections.abc import Sequence


def rows(cells: Sequence[Sequence[str]], head: int = 1) -> list[str]:
    """Return a table as aligned lines: first column left, others right, a rule below the first `head` lines."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = []
    for row in cells:
        first, *others = zip(row, widths, strict=True)
        lines.append("  ".join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]).rstrip())
    return [*lines[:head], "-" * sum(widths, 2 * (len(widths) - 1)), *lines[head:]]


def show(report: str) -> None:
    """Print a report; on a terminal, tables that are wider than it are folded."""
    print(fitted(report, shutil.get_terminal_size().columns) if sys.stdout.isatty() else report)


def fitted(report: str, width: int) -> str:
    """Fold each table (made by `rows`) wider than `width` characters into parts that repeat the first column."""
    blocks = re.split(r"(\n\s*\n)", report)
    return "".join(
        _folded(block, width) if re.search(rf"^-{{{width + 1},}}$", block, re.M) else block for block in blocks
    )


def _folded(block: str, width: int) -> str:
    """Fold one table of a report, with or without lines of text before it."""
    lines = block.split("\n")
    rule = next(i for i, line in enumerate(lines) if len(line) > width and not line.strip("-"))
    heads = [(_spans([*lines[rule - head : rule], *lines[rule + 1 :]], len(lines[rule])), head) for head in (1, 2)]
    spans, head = max(heads[:rule], key=lambda candidate: (len(candidate[0]), candidate[1]))
    first = rule - head
    parts: list[list[tuple[int, int]]] = []
    for span in spans[1:]:
        part = [*parts[-1], span] if parts else [spans[0], span]
        fits = len(part) == 2 or sum(end - begin + 2 for begin, end in part) - 2 <= width
        parts[len(parts) - fits if parts else 0 :] = [part if fits else [spans[0], span]]
    folded = ["\n".join(_part(line, part) for line in lines[first:]) for part in parts]
    return "\n".join([*lines[:first], "\n\n".join(folded)]) if folded else block


def _spans(lines: Sequence[str], width: int) -> list[tuple[int, int]]:
    """Return begin and end [characters] of each column of a table; between columns all lines are blank."""
    columns = zip(*(line.ljust(width)[:width] for line in lines), strict=True)
    filled = "".join("x" if "".join(column).strip() else " " for column in columns)
    return [match.span() for match in re.finditer(r"x+(?: x+)*", filled)]


def _part(line: str, spans: Sequence[tuple[int, int]]) -> str:
    return "  ".join(line[begin:end].ljust(end - begin) for begin, end in spans).rstrip()


class Steps:
    """Progress of a computation on stderr: one changing line on a terminal, else one line per step.

    Call the object with the name of each step that begins.

    Args:
        total: number of steps.
    """

    def __init__(self, total: int) -> None:
        self._total, self._begun, self._began = total, 0, time.monotonic()

    def __call__(self, what: str) -> None:
        """Show that the next step begins; what: name of the step."""
        self._begun += 1
        line = f"report, step {self._begun} of {self._total} ({time.monotonic() - self._began:.0f} s): {what}"
        print(f"\r{line}\033[K" if sys.stderr.isatty() else f"{line}\n", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Clear the line on the terminal after the last step."""
        print("\r\033[K" * sys.stderr.isatty(), end="", file=sys.stderr, flush=True)
