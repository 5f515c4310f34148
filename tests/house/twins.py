"""Search for similar functions (twins), independent of the names of local variables."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from house.sources import Function, Source, covered, is_docstring

WINDOW = 5
"""Number of successive syntax nodes that are compared together.

At revision 3733f5c with a likeness of 0.5, windows of 5 give 17 pairs, all of them similar; windows of 4 give nine
more, two of them not similar; windows of 6 give four fewer.
"""


@dataclass(frozen=True)
class Body:
    """Body of a function for comparison.

    Attributes:
        location: path:line of the function.
        name: `module:function`, with the module as in `Source.name`.
        windows: number of occurrences of each window of syntax nodes.
        lines: first and last line.
    """

    location: str
    name: str
    windows: Counter[tuple[str, ...]]
    lines: tuple[int, int]

    def is_within(self, other: "Body") -> bool:
        """Return True if this function is nested in the other one."""
        same_file = self.location.partition(":")[0] == other.location.partition(":")[0]
        return same_file and other.lines[0] <= self.lines[0] and self.lines[1] <= other.lines[1]


@dataclass(frozen=True)
class Twins:
    """Two similar functions; likeness is the Dice coefficient of their windows, 1 if all are equal."""

    likeness: float
    first: Body
    second: Body

    @property
    def names(self) -> frozenset[str]:
        """Names of the two functions."""
        return frozenset((self.first.name, self.second.name))

    def __str__(self) -> str:
        one, two = (f"{body.location} {body.name.partition(':')[2]}" for body in (self.first, self.second))
        return f"{self.likeness:.2f}  {one}  |  {two}"


def twins(sources: Sequence[Source], lines: int, likeness: float) -> list[Twins]:
    """Return the pairs of functions with at least `lines` code lines and at least this likeness, most similar first.

    A body is compared as the sequence of its syntax nodes. All local names count as equal; docstrings, annotations and
    decorators are left out; names from outside, attributes, keywords and constants are compared.
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
    """Yield the syntax nodes of a function's body in order, as comparable texts."""
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
