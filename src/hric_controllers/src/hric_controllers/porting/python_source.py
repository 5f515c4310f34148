"""Reader of the syntax tree of a rospy node or Python controller: its parameters, topics and services."""

import ast
from collections.abc import Iterator
from pathlib import Path

from hric_controllers.porting.reading import LIFE_CYCLE, Source, Use
from hric_core.errors import HricError

CALLS = {
    "Publisher": "publisher",
    "Subscriber": "subscriber",
    "Service": "service",
    "ServiceProxy": "service",
    "SimpleActionServer": "action",
    "SimpleActionClient": "action",
    "get_param": "parameter",
}
"""Kind of the `Use`, by function or class of rospy and actionlib."""


def read_python(path: Path) -> Source:
    """Return what a Python file uses; the name is that of its first class, or the file's if it has none.

    Raises:
        HricError: the file cannot be read, or is not Python.
    """
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HricError(f"{path}: {error.strerror}") from None
    except (SyntaxError, ValueError) as error:
        raise HricError(f"{path} is not Python 3: {error}") from None
    packages = {
        (name.asname or name.name): (node.module or "").split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    uses: dict[tuple[str, str], Use] = {}
    for use in _uses(tree, path, packages):
        uses.setdefault((use.kind, use.name), use)
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    name = classes[0].name if classes else "".join(part.title() for part in path.stem.split("_"))
    methods = {
        node.name: f"{path.name}, lines {node.lineno} to {node.end_lineno}"
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name in LIFE_CYCLE
    }
    return Source(name, name, tuple(uses.values()), methods)


def _uses(tree: ast.AST, path: Path, packages: dict[str, str]) -> Iterator[Use]:
    """Yield the uses of a syntax tree; `packages` gives the package of each imported name."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or not node.args:
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        kind = CALLS.get(name)
        if kind is None:
            continue
        first, second = node.args[0], node.args[1] if len(node.args) > 1 else None
        label = first.value if isinstance(first, ast.Constant) else f"({ast.unparse(first)})"
        of = _message(second, packages) if kind in {"publisher", "subscriber", "service"} else ""
        if kind == "action":
            of = "server" if name.endswith("Server") else "client"
        elif kind == "parameter" and second is not None:
            of = ast.unparse(second)
        yield Use(kind, str(label), of, f"{path.name}:{node.lineno}")


def _message(node: ast.expr | None, packages: dict[str, str]) -> str:
    """Return a message class in the source as "package/Name"; empty: it is not a plain name."""
    if isinstance(node, ast.Name):
        return f"{packages.get(node.id, '')}/{node.id}".removeprefix("/")
    if isinstance(node, ast.Attribute):
        base = ast.unparse(node.value).split(".")[0]
        package = packages.get(base, base)
        return f"{package}/{node.attr}"
    return ""
