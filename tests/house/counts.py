"""Sizes of the code: statements, share of import lines, modules per folder, long functions, short modules."""

import ast
from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import dataclass, fields

from house.sources import Source, covered, is_docstring


@dataclass(frozen=True)
class Sizes:
    """Sizes of one or several Python files, added up.

    Attributes:
        files: number of files.
        statements: number of `ast.stmt` nodes, including nested ones, without docstrings.
        code_lines: number of lines that are not blank, comment or docstring.
        import_lines: number of these lines that belong to an import statement.
        functions: number of functions and methods, including nested ones.
    """

    files: int
    statements: int
    code_lines: int
    import_lines: int
    functions: int

    def __add__(self, other: "Sizes") -> "Sizes":
        return Sizes(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(Sizes)))

    @property
    def import_share(self) -> float:
        """Share of import lines in all code lines [%]."""
        return 100.0 * self.import_lines / max(self.code_lines, 1)


def sizes(source: Source) -> Sizes:
    """Return the sizes of one file."""
    statements = [node for node in source.nodes if isinstance(node, ast.stmt) and not is_docstring(node)]
    imports = covered(node for node in statements if isinstance(node, ast.Import | ast.ImportFrom)) & source.code_lines
    return Sizes(1, len(statements), len(source.code_lines), len(imports), len(source.functions))


def by_package(sources: Sequence[Source]) -> dict[str, Sizes]:
    """Return the sizes of each package by name."""
    sums: dict[str, Sizes] = {}
    for source in sources:
        sums[source.package] = sums.get(source.package, Sizes(0, 0, 0, 0, 0)) + sizes(source)
    return sums


def levels(sources: Sequence[Source]) -> Counter[str]:
    """Return the number of modules by folder, without `__init__`, `__main__` and executables."""
    return Counter(source.level for source in sources if source.level)


def imported_modules(source: Source, modules: Set[str], packages: Set[str]) -> set[str]:
    """Modules of the project that a file imports, anywhere in it; messages and services of a package are one each.

    Args:
        source: the file.
        modules: names of all modules of the project.
        packages: names of all its packages, also of those without Python, as of messages.
    """
    names: set[str] = set()
    for node in source.nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            both = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= both & modules | ({node.module} if both - modules else set())
    return {name for name in names if name.partition(".")[0] in packages}


def long_functions(sources: Sequence[Source], limit: int) -> list[str]:
    """Return the functions with more than `limit` lines, from `def` to the last line, as `path:line name (lines)`."""
    return [
        f"{source.path}:{function.lineno} {name} ({lines} lines)"
        for source in sources
        for name, function in source.functions
        if (lines := (function.end_lineno or 0) - function.lineno + 1) > limit
    ]


def short_modules(sources: Sequence[Source], limit: int) -> list[Source]:
    """Return the modules with fewer than `limit` lines."""
    return [source for source in sources if source.level and len(source.text.splitlines()) < limit]
