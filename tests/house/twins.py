"""Finds functions that are alike though their local names differ."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from house.sources import Function, Source, covered, is_docstring

WINDOW = 5
"""Consecutive pieces of a function that are compared as one. At 3733f5c and a likeness of 0.5, windows of 5 give 17
pairs, all of them alike; of 4 nine more, two of them unlike; of 6 four fewer."""


@dataclass(frozen=True)
class Body:
    """A function as it is compared.

    Attributes:
        location: path:line.
        name: `module:function`, with the module's name as in `Source.name`.
        windows: its windows, counted.
        lines: first and last line.
    """

    location: str
    name: str
    windows: Counter[tuple[str, ...]]
    lines: tuple[int, int]

    def is_within(self, other: "Body") -> bool:
        """Whether this is a nested function of the other."""
        same_file = self.location.partition(":")[0] == other.location.partition(":")[0]
        return same_file and other.lines[0] <= self.lines[0] and self.lines[1] <= other.lines[1]


@dataclass(frozen=True)
class Twins:
    """Two functions that are alike; likeness: windows in common, 1 where all are (Dice coefficient)."""

    likeness: float
    first: Body
    second: Body

    @property
    def names(self) -> frozenset[str]:
        """Names of the two."""
        return frozenset((self.first.name, self.second.name))

    def __str__(self) -> str:
        one, two = (f"{body.location} {body.name.partition(':')[2]}" for body in (self.first, self.second))
        return f"{self.likeness:.2f}  {one}  |  {two}"


def twins(sources: Sequence[Source], lines: int, likeness: float) -> list[Twins]:
    """Pairs of functions of at least `lines` lines of code whose bodies are at least so alike, most alike first.

    A body is read as the sequence of its syntax: local names are all one, and what only describes (docstrings,
    annotations, decorators) is left out; names from elsewhere, attributes, keywords and constants count as they are.
    """
    bodies = [body for source in sources for body in _bodies(source, lines)]
    holders: dict[tuple[str, ...], list[tuple[int, int]]] = defaultdict(list)
    for index, body in enumerate(bodies):
        for window, count in body.windows.items():
            holders[window].append((index, count))
    shared: Counter[tuple[int, int]] = Counter()
    for held in holders.values():
        for (i, count_i), (j, count_j) in combinations(held, 2):
            shared[i, j] += min(count_i, count_j)
    pairs = []
    for (i, j), common in shared.items():
        one, two = bodies[i], bodies[j]
        ratio = 2.0 * common / (one.windows.total() + two.windows.total())
        if ratio >= likeness and not (one.is_within(two) or two.is_within(one)):
            pairs.append(Twins(ratio, one, two))
    return sorted(pairs, key=lambda pair: (-pair.likeness, pair.first.location))


def _bodies(source: Source, lines: int) -> Iterator[Body]:
    for name, function in source.functions:
        if len(covered([function]) & source.code_lines) >= lines:
            pieces = list(_pieces(function))
            windows = Counter(zip(*(pieces[start:] for start in range(WINDOW)), strict=False))
            extent = function.lineno, function.end_lineno or 0
            yield Body(f"{source.path}:{function.lineno}", f"{source.name}:{name}", windows, extent)


def _pieces(function: Function) -> Iterator[str]:
    """The syntax of a function's body, in order, one piece per node."""
    nodes = list(ast.walk(function))
    local = {node.arg for node in nodes if isinstance(node, ast.arg)} - {"self", "cls"}
    local |= {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    for statement in function.body:
        yield from _walk(statement, local)


def _walk(node: ast.AST, local: set[str]) -> Iterator[str]:
    if is_docstring(node) or isinstance(node, ast.expr_context):
        return
    if isinstance(node, ast.Name):
        yield "local" if node.id in local else node.id
    elif isinstance(node, ast.Constant):
        yield repr(node.value)
    else:
        label = getattr(node, "attr", getattr(node, "arg", None))
        yield type(node).__name__ if label is None or isinstance(node, ast.arg) else label
        for field, value in ast.iter_fields(node):
            if field not in ("annotation", "returns", "decorator_list"):
                for child in value if isinstance(value, list) else [value]:
                    if isinstance(child, ast.AST):
                        yield from _walk(child, local)
