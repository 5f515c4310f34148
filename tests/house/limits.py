"""Limits of code sizes, from `[tool.hric.house]` in pyproject.toml, and their check."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

from house import counts
from house.sources import WORKSPACE, HouseError, Source
from house.twins import Twins, twins

SECTION = "[tool.hric.house]"


@dataclass(frozen=True)
class Limits:
    """Limits of code sizes; each is the largest value allowed. pyproject.toml explains them.

    Attributes:
        start: `revision` with which the number of statements is compared, and its number of `statements`.
        statements: statements of all packages together.
        import_share: share of import lines in all code lines [%].
        modules_per_level: modules in one folder.
        imported_modules: modules of the project that one module imports.
        function_lines: lines of a function, from `def` to the last line.
        short_modules: number of modules with fewer than `short_module_lines` lines.
        short_module_lines: number of lines below which a module counts as short.
        twins: limits for similar functions: `lines` of code from which functions are compared, `likeness` from which
            they count as similar, allowed number of `pairs`, and `exceptions`, with two `functions` and a `reason`.
    """

    start: dict[str, Any]
    statements: int
    import_share: float
    modules_per_level: int
    imported_modules: int
    function_lines: int
    short_modules: int
    short_module_lines: int
    twins: dict[str, Any]


def read_limits(root: Path = WORKSPACE) -> Limits:
    """Return the limits of a workspace; raise HouseError if they are invalid."""
    with (root / "pyproject.toml").open("rb") as file:
        section = tomllib.load(file).get("tool", {}).get("hric", {}).get("house", {})
    names = {field.name for field in fields(Limits)}
    if wrong := sorted(names ^ set(section)):
        valid = ", ".join(sorted(names))
        raise HouseError(f"pyproject.toml, {SECTION}: unknown or missing {', '.join(wrong)}; the keys are {valid}")
    return Limits(**section)


def over_sizes(sources: Sequence[Source], limits: Limits) -> list[str]:
    """Return a message for each size above its limit."""
    total = reduce(add, counts.by_package(sources).values())
    short = counts.short_modules(sources, limits.short_module_lines)
    exceeded = [
        _over("statements", total.statements, limits.statements),
        _over("import_share", round(total.import_share, 2), limits.import_share),
        _over("short_modules", len(short), limits.short_modules),
    ]
    for folder, modules in counts.levels(sources).most_common():
        exceeded.append(_over("modules_per_level", modules, limits.modules_per_level, f" in {folder}"))
    names = {source.name for source in sources}
    packages = {path.parent.name for path in (WORKSPACE / "src").glob("*/package.xml")}
    for source in sources:
        imported = len(counts.imported_modules(source, names, packages))
        exceeded.append(_over("imported_modules", imported, limits.imported_modules, f" in {source.path}"))
    for name in counts.long_functions(sources, limits.function_lines):
        exceeded.append(f"function_lines: limit {limits.function_lines}, exceeded by {name}")
    return [message for message in exceeded if message]


def unlisted_twins(sources: Sequence[Source], limits: Limits) -> tuple[list[Twins], list[str]]:
    """Return the pairs of similar functions that are no exceptions, and messages on obsolete exceptions."""
    pairs = twins(sources, limits.twins["lines"], limits.twins["likeness"])
    listed = {frozenset(entry["functions"]): entry["reason"] for entry in limits.twins["exceptions"]}
    gone = sorted(sorted(names) for names in set(listed) - {pair.names for pair in pairs})
    findings = [f"twins: no longer alike, delete the exception {' and '.join(names)}" for names in gone]
    return [pair for pair in pairs if pair.names not in listed], findings


def over_twins(sources: Sequence[Source], limits: Limits) -> list[str]:
    """Return messages that name all pairs of similar functions, if there are more than allowed."""
    pairs, findings = unlisted_twins(sources, limits)
    message = _over("twins.pairs", len(pairs), limits.twins["pairs"])
    return findings + ([message, *(f"  alike: {pair}" for pair in pairs)] if message else [])


def _over(name: str, value: float, limit: float, where: str = "") -> str:
    return f"{name}: {value:g}, limit {limit:g}{where}" if value > limit else ""
