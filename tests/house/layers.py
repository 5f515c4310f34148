"""What imports what, held against the layers and the never-list; imports inside functions count."""

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from house.sources import HouseError, Source

Config = Mapping[str, Any]


@dataclass(frozen=True)
class Import:
    """One import of a module, or of a name from it; `importer` and `imported` are names as in `Source.name`."""

    importer: str
    imported: str
    location: str

    def __str__(self) -> str:
        return f"{self.location} {self.importer} imports {self.imported}"

    def matches(self, pattern: str) -> bool:
        """Whether this is a listed exception, written "importer -> imported" with wildcards."""
        importer, arrow, imported = (part.strip() for part in pattern.partition("->"))
        if not arrow:
            raise HouseError(f'ignored import {pattern!r}: write it as "importer -> imported"')
        return fnmatchcase(self.importer, importer) and fnmatchcase(self.imported, imported)


@dataclass
class Ignored:
    """Exceptions of one rule; one that allows nothing any more is a finding: what is gone cannot come back unseen."""

    rule: str
    patterns: Sequence[str]
    used: set[str] = field(default_factory=set)

    def covers(self, edge: Import) -> bool:
        """Whether an exception allows this import."""
        hits = {pattern for pattern in self.patterns if edge.matches(pattern)}
        self.used |= hits
        return bool(hits)

    def unused(self) -> list[str]:
        """Findings about exceptions that allow nothing."""
        unused = [pattern for pattern in self.patterns if pattern not in self.used]
        return [f"{self.rule}: nothing needs the exception {pattern!r}: delete it" for pattern in unused]


def imports(sources: Sequence[Source]) -> list[Import]:
    """All imports, also inside functions and by `import_module` of a constant. Raises HouseError on relative ones."""
    modules = {source.name for source in sources}
    edges = ((source, line, name) for source in sources for line, name in _imported(source, modules))
    return [Import(source.name, name, f"{source.path}:{line}") for source, line, name in dict.fromkeys(edges)]


def findings(sources: Sequence[Source], layers: Config, ros: Config, never: Sequence[Config]) -> list[str]:
    """What breaks the layers, the list of modules that may need a ROS master, or a rule of the never-list.

    Args:
        sources: all files.
        layers: `order`, from the top down, of lists of packages that do not import each other; `ignore`.
        ros: `libraries`, and `modules`, the patterns of those that may import them; nobody else imports either.
        never: each with `rule`, `from`, `but` (exempt from it), `to`, `ignore`; lists of patterns of modules.
    """
    edges = imports(sources)
    broken = _against_layers(sources, edges, layers)
    for edge in edges:
        if _is_any(edge.imported, [*ros["libraries"], *ros["modules"]]) and not _is_any(edge.importer, ros["modules"]):
            broken.append(f"{edge}: not a module that may need a ROS master")
    for rule in never:
        ignored = Ignored(rule["rule"], rule.get("ignore", []))
        for edge in edges:
            applies = _is_any(edge.importer, rule["from"]) and not _is_any(edge.importer, rule.get("but", []))
            if applies and _is_any(edge.imported, rule["to"]) and not ignored.covers(edge):
                broken.append(f"{edge}: {rule['rule']}")
        broken += ignored.unused()
    return broken


def _against_layers(sources: Sequence[Source], edges: Sequence[Import], layers: Config) -> list[str]:
    depth = {package: level for level, packages in enumerate(layers["order"]) for package in packages}
    packages = {source.name: source.package for source in sources}
    broken = [f"package {package} is in no layer" for package in sorted(set(packages.values()) - set(depth))]
    ignored = Ignored("layers", layers.get("ignore", []))
    for edge in edges:
        package, other = packages[edge.importer], packages.get(edge.imported)
        if package == other or package not in depth or other not in depth:
            continue
        if depth[other] <= depth[package] and not ignored.covers(edge):
            relation = "beside" if depth[other] == depth[package] else "above"
            broken.append(f"{edge}: {other} is in the layer {relation} {package}")
    return broken + ignored.unused()


def _is_any(module: str, patterns: Sequence[str]) -> bool:
    """Whether a module, or a package that it lies in, matches one of the patterns."""
    return any(fnmatchcase(module, pattern) or fnmatchcase(module, f"{pattern}.*") for pattern in patterns)


def _imported(source: Source, modules: set[str]) -> Iterator[tuple[int, str]]:
    for node in source.nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level or node.module is None:
                raise HouseError(f"{source.path}:{node.lineno}: a relative import; write the module's full name")
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield node.lineno, name if name in modules else _local(node.module, modules)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "__import__"):
                yield node.lineno, str(node.args[0].value)


def _local(module: str, modules: set[str]) -> str:
    """The name of a module; those of scripts/lib are imported by their file's name."""
    beside = f"scripts/lib/{module.replace('.', '/')}"
    return beside if beside in modules else module
