"""Command line of scripts/count."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from functools import reduce
from operator import add
from pathlib import Path

from house import counts, limits, prose
from house.limits import Limits
from house.sources import WORKSPACE, HouseError, Source, at_revision, in_folder

PURPOSE = "Sizes of product Python: src/*/src, src/*/nodes, scripts; limits: [tool.hric.house] in pyproject.toml."


def main(arguments: Sequence[str] | None = None, root: Path = WORKSPACE) -> int:
    """Run scripts/count and return its exit code."""
    options = _parser().parse_args(arguments)
    try:
        rules = limits.read_limits(root)
        sources = at_revision(options.at, root) if options.at else in_folder(root)
        if options.check:
            return _check(sources, rules, root)
        if options.twins:
            print(*limits.unlisted_twins(sources, rules)[0], sep="\n")
        elif options.prose:
            return _print_or_pass(_prose(sources, root), "nothing that the style refuses")
        elif options.texts:
            prose.write(prose.in_code(sources), options.texts)
        else:
            _print_sizes(sources, rules)
    except (HouseError, OSError) as error:
        print(f"scripts/count: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="scripts/count", description=PURPOSE)
    parser.add_argument("--at", metavar="REVISION", help="count the code of a git revision, with the present limits")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="check all limits; exit code 1 if one is exceeded")
    what.add_argument("--twins", action="store_true", help="list pairs of similar functions")
    what.add_argument(
        "--prose", action="store_true", help="list violations of the style rules (styles/HRIC) in pages and code"
    )
    what.add_argument(
        "--texts",
        type=Path,
        metavar="FOLDER",
        help="write the texts of the code to a folder, for the program vale (build/texts)",
    )
    return parser


def _check(sources: Sequence[Source], rules: Limits, root: Path) -> int:
    over = [*limits.over_sizes(sources, rules), *limits.over_twins(sources, rules)]
    return _print_or_pass([*over, *_prose(sources, root)], "all within the limits")


def _prose(sources: Sequence[Source], root: Path) -> list[str]:
    return prose.findings([*prose.pages(root), *prose.in_code(sources)], *prose.style(root))


def _print_or_pass(findings: Sequence[str], passed: str) -> int:
    print(*findings or [passed], sep="\n")
    return 1 if findings else 0


def _print_sizes(sources: Sequence[Source], rules: Limits) -> None:
    sizes = counts.by_package(sources)
    sizes["total"] = reduce(add, sizes.values())
    levels = counts.levels(sources)
    long = Counter(source.package for source in sources for _ in counts.long_functions([source], rules.function_lines))
    short = Counter(source.package for source in counts.short_modules(sources, rules.short_module_lines))
    largest = Counter({package: 0 for package in sizes})
    for folder, modules in levels.items():
        package = folder.split("/")[1 if folder.startswith("src/") else 0]
        largest[package] = max(largest[package], modules)
    long["total"], short["total"], largest["total"] = long.total(), short.total(), max(largest.values())
    heads = ["package", "files", "statements", "code lines", "imports %", "functions"]
    rows = [[*heads, f">{rules.function_lines} lines", f"modules <{rules.short_module_lines} lines", "largest level"]]
    for name, size in sizes.items():
        figures = [size.files, size.statements, size.code_lines, f"{size.import_share:.2f}", size.functions]
        rows.append([name, *map(str, [*figures, long[name], short[name], largest[name]])])
    _print_columns(rows)
    before = rules.start["statements"]
    change = 100.0 * (sizes["total"].statements / before - 1.0)
    print(f"\n{change:+.2f} % statements against {before} at {rules.start['revision']}")


def _print_columns(rows: Sequence[Sequence[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        print("  ".join([first.ljust(widths[0]), *cells]))


if __name__ == "__main__":
    sys.exit(main())
