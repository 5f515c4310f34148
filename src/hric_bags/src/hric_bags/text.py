"""Tables as aligned text, for terminals and text files."""

from collections.abc import Sequence


def rows(cells: Sequence[Sequence[str]], head: int = 1) -> list[str]:
    """Aligned lines: the first column to the left, the others to the right; a rule below the lines of the head."""
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = []
    for row in cells:
        first, *others = zip(row, widths, strict=True)
        lines.append("  ".join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]).rstrip())
    return [*lines[:head], "-" * sum(widths, 2 * (len(widths) - 1)), *lines[head:]]
