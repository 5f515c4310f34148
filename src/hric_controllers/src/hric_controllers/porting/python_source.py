"""Reader of the syntax tree of a rospy node or Python controller: its parameters, topics and services."""

import ast
from collections import Counter
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from hric_controllers.porting.reading import LIFE_CYCLE, Source, Use
from hric_core.errors import HricError

CALLS = {
    "Publisher": ("publisher", "name", "data_class"),
    "Subscriber": ("subscriber", "name", "data_class"),
    "wait_for_message": ("subscriber", "topic", "topic_type"),
    "Service": ("service", "name", "service_class"),
    "ServiceProxy": ("service client", "name", "service_class"),
    "SimpleActionServer": ("action", "name", "ActionSpec"),
    "SimpleActionClient": ("action", "ns", "ActionSpec"),
    "get_param": ("parameter", "param_name", "default"),
    "has_param": ("parameter", "param_name", ""),
    "search_param": ("parameter", "param_name", ""),
}
"""Kind of the `Use` and names of the first two arguments, by function or class of rospy and actionlib."""


def read_python(path: Path) -> Source:
    """Return what a Python file uses; the name is that of the class that uses most, or the file's if it has none.

    Raises:
        HricError: the file cannot be read, or is not Python.
    """
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HricError(f"{path}: {error.strerror}") from None
    except (SyntaxError, ValueError) as error:
        raise HricError(f"{path} is not Python 3: {error}") from None
    uses: dict[tuple[str, str], Use] = {}
    for use in (*_uses(tree, path), *_missing(tree, path)):
        uses.setdefault((use.kind, use.name), use)
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    of_class = Counter({node.name: sum(1 for _ in _uses(tree, path, node)) for node in classes})
    name = of_class.most_common(1)[0][0] if classes else "".join(part.title() for part in path.stem.split("_"))
    methods = {
        node.name: f"{path.name}, lines {node.lineno} to {node.end_lineno}"
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name in LIFE_CYCLE
    }
    return Source(name, name, tuple(uses.values()), methods)


def _imported(tree: ast.AST) -> dict[str, str]:
    """Return the top-level package of each imported name; "import a.b" is not in it."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and not node.level:
            names |= {(one.asname or one.name): (node.module or "").split(".")[0] for one in node.names}
        elif isinstance(node, ast.Import):
            names |= {one.asname: one.name.split(".")[0] for one in node.names if one.asname}
    return names


def _missing(tree: ast.AST, path: Path) -> Iterator[Use]:
    """Yield the imported packages that cannot be located here."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Import | ast.ImportFrom) or (isinstance(node, ast.ImportFrom) and node.level):
            continue
        modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else [one.name for one in node.names]
        for package in (module.split(".")[0] for module in modules):
            if find_spec(package) is None and not (path.parent / f"{package}.py").exists():
                yield Use("module", package, "", f"{path.name}:{node.lineno}")


def _uses(tree: ast.AST, path: Path, part: ast.AST | None = None) -> Iterator[Use]:
    """Yield the uses in a part of a syntax tree (None: in all of it)."""
    packages = _imported(tree)
    constants = {
        target.id: node.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(part or tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        origin = f"{path.name}:{node.lineno}"
        if name == "Server" and node.args and "dynamic_reconfigure" in (packages.get(name), _base(node.func, packages)):
            yield Use("live parameters", ast.unparse(node.args[0]), "", origin)
        kind, *keys = CALLS.get(name, ("", "", ""))
        given = dict(zip(keys, node.args, strict=False)) | {one.arg: one.value for one in node.keywords if one.arg}
        first, second = (given.get(key) for key in keys)
        if not kind or first is None:
            continue
        text = first.value if isinstance(first, ast.Constant) else constants.get(ast.unparse(first).split(".")[-1])
        of = _message(second, packages) if kind not in {"action", "parameter"} else ""
        if kind == "action":
            of = "server" if name.endswith("Server") else "client"
        elif kind == "parameter" and second is not None:
            of = ast.unparse(second)
        yield Use(kind, text if isinstance(text, str) else f"({ast.unparse(first)})", of, origin)


def _base(node: ast.expr, packages: dict[str, str]) -> str:
    """Return the package of an expression such as "package.msg.Name"; empty: it is no such expression."""
    base = ast.unparse(node.value).split(".")[0] if isinstance(node, ast.Attribute) else ""
    return packages.get(base, base)


def _message(node: ast.expr | None, packages: dict[str, str]) -> str:
    """Return a message class in the source as "package/Name"; empty: it is not a plain name."""
    if isinstance(node, ast.Name):
        return f"{packages.get(node.id, '')}/{node.id}".removeprefix("/")
    return f"{_base(node, packages)}/{node.attr}" if isinstance(node, ast.Attribute) else ""
